"""Filters of finite and of infinite response, along the first axis.

`scipy.signal` has both; it takes longer to import than a fit takes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import get_lapack_funcs
from scipy.ndimage import uniform_filter1d

_SOLVE: Any
(_SOLVE,) = get_lapack_funcs(("tbtrs",))
_BAND = 20
"""The part of a spectrum over which it is averaged; chosen by judgement."""


def moving_sum(taps: np.ndarray, signals: np.ndarray) -> np.ndarray:
    """Σ_k taps_k x_{t-k} of signals x (L, …), which are zero before the first sample."""
    summed = taps[0] * signals
    for lag, tap in enumerate(taps[1:], start=1):
        summed[lag:] += tap * signals[:-lag]
    return summed


def averaged(spectrum: np.ndarray) -> np.ndarray:
    """A spectrum (F,), each of its lines the mean of those near it."""
    return uniform_filter1d(spectrum, 2 * (spectrum.size // (2 * _BAND)) + 1)


def solve_recursion(taps: np.ndarray, signals: np.ndarray) -> np.ndarray:
    """The y with Σ_k taps_k y_{t-k} = x_t of signals x (L, …), zero before the first sample.

    That is a triangular system with a band of the taps' width.
    """
    length = len(signals)
    band = np.broadcast_to(np.asarray(taps, float)[:, None], (len(taps), length))
    solution, _ = _SOLVE(band, signals.reshape(length, -1), uplo="L")
    return solution.reshape(signals.shape)
