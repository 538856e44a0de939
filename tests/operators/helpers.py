"""Signals of the tests of operators."""

import numpy as np

SAMPLES = 200
GENERATOR = np.random.default_rng(0)
WALK = 2 + 0.1 * np.cumsum(GENERATOR.standard_normal(SAMPLES))


def triangle(positions: np.ndarray, first_corner: int = 0, length: int = 24) -> np.ndarray:
    """A triangle between 0 and 1 that turns every 24 samples, or another number, from
    `first_corner` on."""
    return np.abs(((positions - first_corner) / length) % 2 - 1)
