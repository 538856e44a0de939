"""Measurement noise of four kinds, and the filter that whitens it."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from ..drives import Array

NOISES = ("white", "ar", "heavy", "varying")
AR = 0.6


def noise(kind: str, n: int, sd: float, rng: np.random.Generator) -> Array:
    """Noise of standard deviation sd: white, ar (AR(1), 0.6), heavy (Student t, 4), varying."""
    e = rng.standard_normal(n)
    if kind == "ar":
        long = rng.standard_normal(n + 99)  # the first 99 settle the filter
        return sd * np.sqrt(1 - AR**2) * lfilter([1.0], [1.0, -AR], long)[99:]
    if kind == "heavy":
        return sd * rng.standard_t(4, n) / np.sqrt(2.0)
    if kind == "varying":
        size = 1 + 0.6 * np.sin(2 * np.pi * (np.arange(n) / n * 3 + rng.uniform()))
        return sd * e * size / np.sqrt(1 + 0.18)
    if kind == "white":
        return sd * e
    raise ValueError(f"noise is {', '.join(NOISES)}, not {kind!r}")


def whiten(kind: str, x: Array, sd: float) -> Array:
    """x in units in which the noise is white with variance 1 (columns along axis 0)."""
    if kind != "ar":
        return x / sd
    return lfilter([1.0, -AR], [1.0], x, axis=0) / (sd * np.sqrt(1 - AR**2))
