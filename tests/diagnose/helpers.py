"""Recordings to diagnose, made up."""

import numpy as np
from scipy.signal import lfilter

import fracjax as fj
from fracjax._prepare import Noise
from fracjax._recording import Recording

STEP = 2e-3
CYCLES = 12
TIMES = STEP * np.arange(CYCLES * 500)
TONE = 50 - 40 * np.cos(2 * np.pi * TIMES)


def recording_of(case) -> Recording:
    """A built case's recording."""
    return Recording(case.voltage, case.displacement, float(case.time[1] - case.time[0]), "V", "um")


def creeping(noise: np.ndarray) -> Recording:
    """A law that the model creep holds exactly, under some noise."""
    law = fj.simulate(fj.parse_model("creep"), TONE, STEP, "constant").response
    return Recording(TONE, law + noise, STEP, "V", "um")


def white(sigma: float) -> Noise:
    """White noise of a known size."""
    return Noise(sigma, "um", "specification", np.ones(1), sigma)


def relaxing_after_a_step(sigma: float) -> Recording:
    """A force that relaxes in three exponentials after one step of a displacement."""
    times = 0.05 * np.arange(1100)
    drive = 50 * np.clip(times - 1, 0, 1)
    force, steps = 0.05 * drive, np.diff(drive, prepend=0.0)
    for constant in (1.0, 6.0, 40.0):
        force = force + 0.01 * np.asarray(lfilter([1.0], [1.0, -np.exp(-0.05 / constant)], steps))
    noise = sigma * np.random.default_rng(0).standard_normal(times.size)
    return Recording(drive, force + noise, 0.05, "mm", "N")
