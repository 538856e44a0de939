"""Recordings of which nothing but the residual of a fit tells the noise."""

import numpy as np
import pytest
from scipy.signal import lfilter

import fracjax as fj
from fracjax._recording import Recording

STEP, SIZE = 2e-3, 2500
TIMES = STEP * np.arange(SIZE)
DRIVE = 50 + 45 * np.sin(2 * np.pi * 1.1 * TIMES) * np.exp(-TIMES / 6)


def loop() -> np.ndarray:
    return fj.simulate(fj.parse_model("bouc_wen"), DRIVE, STEP, "constant").response


def slow(seed: int, share: float) -> np.ndarray:
    """Noise of first order, correlated over a few samples."""
    drawn = np.random.default_rng(seed).standard_normal(SIZE)
    return share * np.asarray(lfilter([1.0], [1.0, -0.7], drawn))


@pytest.mark.parametrize("seed", [1, 2])
def test_coloured_noise_is_not_called_unexplained(seed):
    """It depends on nothing: not on time, on the drive or on its past."""
    law = loop()
    noise = slow(seed, 2e-3 * np.ptp(law))
    diagnosis = fj.diagnose("bouc_wen", Recording(DRIVE, law + noise, STEP, "V", "um"))
    assert diagnosis.noise.method == "residual"
    assert diagnosis.verdict == "none"
    assert "was estimated from that same residual" in diagnosis.sentence
    assert diagnosis.noise.sigma == pytest.approx(np.std(noise), rel=0.1)


def test_what_depends_on_the_drive_is_no_coloured_noise():
    """A ripple of the position, as of a ruler's grating, is smooth and has no name here."""
    law = loop()
    size = np.ptp(law)
    ripple = 6e-3 * size * np.sin(2 * np.pi * law / (0.11 * size))
    noise = 2e-3 * size * np.random.default_rng(3).standard_normal(SIZE)
    diagnosis = fj.diagnose("bouc_wen", Recording(DRIVE, law + ripple + noise, STEP, "V", "um"))
    assert diagnosis.verdict != "none"
