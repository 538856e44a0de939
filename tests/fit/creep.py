"""A creep law, and fits to its recordings."""

import jax.numpy as jnp
import numpy as np

import fracjax as fj
from tests.helpers import specified

STEP, SAMPLES, SIGMA = 2e-3, 600, 0.01
TIMES = STEP * np.arange(SAMPLES)
DRIVE = 40 + 15 * np.sin(2 * np.pi * 1.3 * TIMES) + 10 * np.sin(2 * np.pi * 4.1 * TIMES + 1)
KNOWN = specified(SIGMA)
TRUE = {"k_c": 0.08, "mu": 0.02}


def response_of(values: dict[str, float], drive=DRIVE, model: str = "creep") -> np.ndarray:
    """By the package's own simulation: here nothing is asked of the numerics."""
    block = fj.parse_model(model).with_values(values).block
    return np.asarray(block(jnp.asarray(drive), fj.Grid(STEP)))


CLEAN = response_of(TRUE)


def record(response: np.ndarray, drive: np.ndarray = DRIVE, seed: int = 0) -> fj.Recording:
    noise = SIGMA * np.random.default_rng(seed).standard_normal(len(response))
    return fj.Recording(drive, response + noise, STEP, "V", "um")


def fit(recording, model: str | fj.Model = "creep", **options) -> fj.Fit:
    options = {"noise": KNOWN, "starts": 1, "history": "constant", "settling": 0} | options
    model = fj.parse_model(model) if isinstance(model, str) else model
    return fj.fit(model, recording, **options)


def errors(found: fj.Fit) -> list[float]:
    """How far the estimates are from the truth, in standard errors."""
    return [abs(e.value - TRUE[e.name]) / e.standard_error for e in found.estimates]
