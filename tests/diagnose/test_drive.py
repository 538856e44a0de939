"""What is corrected in a recording before its diagnosis."""

import numpy as np
import pytest

from fracjax._diagnose._drive import lead_of, shortened, thinned
from fracjax._recording import Recording
from tests.diagnose.helpers import relaxing_after_a_step


def swept(samples: int, rate: float, highest: float) -> Recording:
    """A sweep up to a frequency, and a response."""
    times = np.arange(samples) / rate
    drive = 50 + 40 * np.sin(np.pi * highest * times**2 / times[-1])
    return Recording(drive, 0.1 * drive, 1 / rate, "V", "um", source="a.csv")


@pytest.mark.parametrize(
    ("rate", "highest", "used", "words"),
    [
        (10_000.0, 20.0, 12_000, "every 10th of 120000 samples"),
        (10_000.0, 3000.0, 24_000, "the first 2.4 s of 12 s were used"),
    ],
)
def test_long_recordings_keep_what_the_drive_needs(rate, highest, used, words):
    recording = swept(120_000, rate, highest)
    fewer, first = thinned(recording)
    kept, second = shortened(fewer)
    assert len(kept) == used
    assert words in first + second
    np.testing.assert_array_equal(
        kept.drive, recording.drive[:: len(recording) // len(fewer)][:used]
    )


def test_a_recording_of_usual_length_stays_whole():
    recording = swept(20_000, 10_000.0, 3000.0)
    assert shortened(recording) == (recording, "")


def test_one_step_leads_nothing_and_a_loop_the_wrong_way_round_does():
    assert lead_of(relaxing_after_a_step(0.002)) == 0
    phase = 2 * np.pi * np.arange(1000) / 250
    leading = Recording(np.sin(phase), np.sin(phase + 0.2), 1e-3, "V", "um")
    assert lead_of(leading) == pytest.approx(np.degrees(0.2), rel=0.01)
