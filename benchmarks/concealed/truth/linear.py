"""Linear filters, exact for an input that is linear between fine samples."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from ..drives import Array


def relax(v: Array, h: float, tau: float) -> Array:
    """tau w' + w = v from rest."""
    if tau <= 0:
        return v
    x = h / tau
    c = -np.expm1(-x)
    last = 1 - c / x if x > 1e-4 else x / 2
    return lfilter([last, c - last], [1.0, -np.exp(-x)], v)


def follow(v: Array, h: float, pole: complex, of_rate: bool = False) -> Array:
    """z' = p z + v (or + dv/dt) from z = 0; the pole p in 1/s may be complex, Re p < 0."""
    x = pole * h
    decay = np.exp(x)
    c = np.expm1(x) / pole
    if of_rate:
        return np.concatenate([[0.0], lfilter([c], [1.0, -decay], np.diff(v) / h)])
    last = h * ((decay - 1 - x) / x**2 if abs(x) > 1e-3 else 0.5 + x / 6 + x * x / 24)
    return lfilter([last, c - last], [1.0, -decay], v)


def state_space(v: Array, h: float, a: Array, b: Array, c: Array) -> Array:
    """c x with x' = a x + b v from rest, by its modes (distinct eigenvalues)."""
    poles, vectors = np.linalg.eig(a)
    drive, read = np.linalg.solve(vectors, b), c @ vectors
    out = np.zeros(len(v))
    for p, gain in zip(poles, drive * read, strict=True):
        if p.imag >= 0:  # the conjugate mode adds the conjugate
            out += (2 if p.imag > 0 else 1) * np.real(gain * follow(v, h, p))
    return out
