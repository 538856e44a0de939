"""The colour of what no column follows: misfit counts as noise, with its neighbours alike."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_toeplitz

_LARGEST_ORDER = 8
_RIDGE = 1e-6


def colour_of(left: np.ndarray) -> np.ndarray:
    """The filter (p+1,) that whitens a residual (n,) to unit variance, p by BIC (Yule–Walker).

    Unlike a noise's, it holds the lines too: those of the drive's harmonics are what misfit has.
    """
    lags = np.arange(_LARGEST_ORDER + 1)
    covariance = np.array([left[: left.size - k] @ left[k:] for k in lags]) / left.size
    covariance[0] *= 1 + _RIDGE
    best, least = np.ones(1) / np.sqrt(covariance[0]), left.size * np.log(covariance[0])
    for order in lags[1:]:
        coefficients = solve_toeplitz(covariance[:order], covariance[1 : order + 1])
        variance = covariance[0] - coefficients @ covariance[1 : order + 1]
        score = left.size * np.log(variance) + order * np.log(left.size)
        if score < least:
            best, least = np.concatenate([[1.0], -coefficients]) / np.sqrt(variance), score
    return best
