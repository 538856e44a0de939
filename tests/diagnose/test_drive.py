"""What is corrected in a recording before its diagnosis."""

import numpy as np
import pytest

from fracjax._diagnose._drive import lead_of, parted, thinned
from fracjax._recording import Recording
from tests.diagnose.helpers import relaxing_after_a_step


def swept(samples: int, rate: float, highest: float) -> Recording:
    """A sweep up to a frequency, and a response."""
    times = np.arange(samples) / rate
    drive = 50 + 40 * np.sin(np.pi * highest * times**2 / times[-1])
    return Recording(drive, 0.1 * drive, 1 / rate, "V", "um", source="a.csv")


def test_long_recordings_keep_what_the_drive_needs():
    recording = swept(120_000, 10_000.0, 20.0)
    fewer, words = thinned(recording)
    assert "every 10th of 120000 samples" in words
    assert parted(fewer) == ([fewer], "")
    np.testing.assert_array_equal(fewer.drive, recording.drive[::10])


def test_a_recording_that_is_fast_all_along_is_used_in_part():
    recording = swept(120_000, 10_000.0, 3000.0)
    (kept,), words = parted(thinned(recording)[0])
    assert len(kept) == 12_000
    assert kept.dt == recording.dt
    assert "of 120000 samples all from" in words
    start = int(np.argmax(recording.drive == kept.drive[0]))
    np.testing.assert_array_equal(kept.drive, recording.drive[start : start + len(kept)])


def test_the_fast_stretch_of_a_long_recording_is_one_of_its_own():
    times = np.arange(100_000) / 5000
    drive = 50 - 50 * np.cos(2 * np.pi * times / 20)
    own = (times > 9) & (times < 9.6)
    drive[own] += 5 * np.sin(2 * np.pi * 200 * times[own])
    recording = Recording(drive, 0.1 * drive, 1 / 5000, "V", "um", source="a.csv")
    (whole, stretch), words = parted(recording)
    assert (whole.dt, stretch.dt) == pytest.approx((9 / 5000, 1 / 5000))
    assert whole.masked is not None
    kept = times[::9]
    assert whole.masked[(kept > 9) & (kept < 9.6)].all()
    assert whole.masked.mean() < 0.1
    assert 0.6 < len(stretch) / 5000 < 1.0
    assert "every 9th from 0 to 20 s and all from 8.9" in words


def test_a_recording_of_usual_length_stays_whole():
    recording = swept(20_000, 10_000.0, 3000.0)
    assert parted(recording) == ([recording], "")


def test_one_step_leads_nothing_and_a_loop_the_wrong_way_round_does():
    assert lead_of(relaxing_after_a_step(0.002)) == 0
    phase = 2 * np.pi * np.arange(1000) / 250
    leading = Recording(np.sin(phase), np.sin(phase + 0.2), 1e-3, "V", "um")
    assert lead_of(leading) == pytest.approx(np.degrees(0.2), rel=0.01)
