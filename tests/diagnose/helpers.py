"""Recordings to diagnose, made up."""

import numpy as np

import fracjax as fj
from fracjax._prepare import Noise
from fracjax._recording import Recording

STEP = 2e-3
CYCLES = 12
TIMES = STEP * np.arange(CYCLES * 500)
TONE = 50 - 40 * np.cos(2 * np.pi * TIMES)


def recording_of(case) -> Recording:
    """A built case's recording."""
    return Recording(case.voltage, case.displacement, float(case.time[1] - case.time[0]))


def creeping(noise: np.ndarray) -> Recording:
    """A law that the model creep holds exactly, under some noise."""
    law = fj.simulate(fj.parse_model("creep"), TONE, STEP, "constant").response
    return Recording(TONE, law + noise, STEP, "V", "um")


def white(sigma: float) -> Noise:
    """White noise of a known size."""
    return Noise(sigma, "um", "specification", np.ones(1), sigma)
