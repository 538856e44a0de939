"""A truth of other numerics, and fits to it."""

import numpy as np

import fracjax as fj
from benchmarks.concealed.truth import BASES, OVER
from tests.helpers import specified

STEP = 2e-3
SAMPLES = 1200
LAW = {"alpha": 0.14, "beta": -0.13, "k_l": 0.07, "k_h": 0.04, "k_p": 1.5e-4}
STARTS = 2


def several_tones(times: np.ndarray) -> np.ndarray:
    """A drive [V] of three frequencies."""
    parts = ((15, 1.3, 0.0), (10, 4.1, 1.0), (6, 11.7, 2.0))
    return 40 + np.sum([a * np.sin(2 * np.pi * f * times + p) for a, f, p in parts], axis=0)


def truth(drive_of, law: dict[str, float], base: str = "foh") -> tuple[np.ndarray, np.ndarray]:
    """Drive [V] and displacement [um] at the samples, simulated on a grid 32 times finer."""
    fine = drive_of(np.arange((SAMPLES - 1) * OVER + 1) * STEP / OVER)
    return fine[::OVER], BASES[base].response(fine, STEP / OVER, law)[::OVER]


def white(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(SAMPLES)


DRIVE, CLEAN = truth(several_tones, LAW)
SIGMA = 1e-3 * np.ptp(CLEAN)
KNOWN = specified(SIGMA)


def record(seed: int, offset: float = 1.0) -> fj.Recording:
    return fj.Recording(DRIVE, CLEAN + offset + SIGMA * white(seed), STEP, "V", "um")


def fit_foh(recording: fj.Recording, **options) -> fj.Fit:
    options = {"noise": KNOWN, "starts": STARTS} | options
    return fj.fit(fj.parse_model("foh"), recording, **options)
