"""One truth, and the cross-check of its fit."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import fracjax as fj
from benchmarks.concealed.truth import BASES, OVER
from fracjax._crosscheck import Crosscheck
from fracjax._crosscheck._box import objective
from tests.helpers import specified

STEP, SAMPLES, SIGMA = 2e-3, 400, 5e-3
LAW = {"alpha": 0.45, "beta": -0.1, "k_l": 0.07, "k_h": 0.02, "k_p": 0.0}
HELD = {"k_p": 0.0, "beta": -0.1}
# Of negative orders the best, with k_h below 0, is a minimum of its own: it can catch a search that
# moves gains too.
KEPT = {"alpha": (0.0, 0.9)}
NOISE = specified(SIGMA)
# Enough where a search has the shapes alone to move.
FEW = {"population": 8, "iterations": 40}


def recording() -> fj.Recording:
    """FOH under three tones, simulated by other numerics on a grid 32 times finer."""
    times = np.arange((SAMPLES - 1) * OVER + 1) * STEP / OVER
    parts = ((15, 1.3, 0.0), (10, 4.1, 1.0), (6, 11.7, 2.0))
    drive = 40 + np.sum([a * np.sin(2 * np.pi * f * times + p) for a, f, p in parts], axis=0)
    clean = BASES["foh"].response(drive, STEP / OVER, LAW)[::OVER]
    noise = SIGMA * np.random.default_rng(0).standard_normal(SAMPLES)
    return fj.Recording(
        drive[::OVER], clean + 1.0 + noise, STEP, "V", "um", source="three_tones.csv"
    )


def check(seed: int = 0, population: int = 24, iterations: int = 300) -> Crosscheck:
    return fj.crosscheck(
        fj.parse_model("foh"),
        recording(),
        noise=NOISE,
        fixed=HELD,
        bounds=KEPT,
        starts=2,
        population=population,
        iterations=iterations,
        seed=seed,
    )


@eqx.filter_jit
def cost_at(block, problems, position):
    return objective(block, problems)(jnp.asarray(position))
