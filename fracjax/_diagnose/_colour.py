"""The colour of a misfit: what no column explains counts as coloured noise."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_toeplitz

_LARGEST_ORDER = 8
"""Of the autoregression; chosen by judgement."""
_RIDGE = 1e-6
"""White noise that is added for stability, as a share of the variance."""


def colour_of(residual: np.ndarray) -> np.ndarray:
    """The filter (p+1,) that whitens a residual (n,) to unit variance, p by BIC (Yule–Walker).

    Unlike a noise's, it includes spectral lines, since a misfit follows the drive's harmonics.
    """
    lags = np.arange(_LARGEST_ORDER + 1)
    covariance = (
        np.array([residual[: residual.size - k] @ residual[k:] for k in lags]) / residual.size
    )
    covariance[0] *= 1 + _RIDGE
    best, least = np.ones(1) / np.sqrt(covariance[0]), residual.size * np.log(covariance[0])
    for order in lags[1:]:
        coefficients = solve_toeplitz(covariance[:order], covariance[1 : order + 1])
        variance = covariance[0] - coefficients @ covariance[1 : order + 1]
        score = residual.size * np.log(variance) + order * np.log(residual.size)
        if score < least:
            best, least = np.concatenate([[1.0], -coefficients]) / np.sqrt(variance), score
    return best
