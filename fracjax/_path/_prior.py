r"""Normal priors of whitened signals, by inner products under their inverse covariances.

Everything that a posterior over effects needs of a law are inner products of columns and of the
response under the inverse of the law's covariance, and that covariance's determinant.

Source: Woodbury's identity; Rasmussen & Williams, Gaussian Processes (2006), A.3.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

Reduced = Callable[[np.ndarray], np.ndarray]
"""Whitened signals (ΣN, k) times the inverse covariance of everything that is not dense."""


class Inner(NamedTuple):
    """Inner products under the inverse covariance: of columns (K, K), of columns with the response
    (K,), of the response with itself, and the logarithm of the covariance's determinant."""

    columns: np.ndarray
    along: np.ndarray
    square: float
    log_determinant: float

    def coefficients(self, chosen: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """The most probable coefficients (k,) of the columns `chosen` (k,), of these prior standard
        deviations (k,)."""
        own = self.columns[chosen][:, chosen]
        return np.linalg.solve(np.diag(sizes**-2) + own, self.along[chosen])

    def given(self, chosen: np.ndarray, sizes: np.ndarray) -> Inner:
        """The same with the columns `chosen` (k,) in the covariance too, with coefficients of these
        standard deviations (k,)."""
        own = self.columns[chosen][:, chosen]
        coefficients = np.linalg.solve(
            np.diag(sizes**-2) + own, np.column_stack([self.columns[chosen], self.along[chosen]])
        )
        return Inner(
            self.columns - self.columns[:, chosen] @ coefficients[:, :-1],
            self.along - self.columns[:, chosen] @ coefficients[:, -1],
            self.square - float(self.along[chosen] @ coefficients[:, -1]),
            self.log_determinant
            + float(np.linalg.slogdet(np.eye(chosen.size) + sizes[:, None] * own * sizes)[1]),
        )


def log_likelihood(square, log_determinant, count: float):
    """The log likelihood up to a constant; the variance is κ ≥ 1 times that of the noise, κ at its
    most likely value: what nothing explains counts as noise."""
    excess = np.maximum(1.0, square / count)
    return -0.5 * (count * np.log(excess) + square / excess + log_determinant)


def square_at(value: float, log_determinant: float, count: float) -> float:
    """χ² at which the log likelihood has a value."""
    square = -2 * value - log_determinant
    return square if square <= count else count * float(np.exp(square / count - 1))


class Prior:
    """A covariance 1 + D Dᵀ of whitened signals beside what `reduced` takes out of them: D are
    dense columns (ΣN, k) of unit prior sd, `log_determinant` is that of the rest."""

    def __init__(
        self,
        dense: np.ndarray,
        reduced: Reduced,
        log_determinant: float,
        beside: np.ndarray | None = None,
    ):
        self._dense, self._reduced = dense, reduced
        self._beside = reduced(dense) if beside is None else beside
        self._normal = np.eye(dense.shape[1]) + dense.T @ self._beside
        extra = float(np.linalg.slogdet(self._normal)[1]) if dense.size else 0.0
        self._log_determinant = log_determinant + extra

    def weighted(self, white: np.ndarray) -> np.ndarray:
        """Whitened signals (ΣN, K) times the inverse covariance."""
        reduced = self._reduced(white)
        return reduced - self._beside @ np.linalg.solve(self._normal, self._dense.T @ reduced)

    def inner(self, columns: np.ndarray, white: np.ndarray) -> Inner:
        """Inner products of whitened columns (ΣN, K) and of a whitened response (ΣN,)."""
        signals = np.column_stack([columns, white])
        gram = signals.T @ self.weighted(signals)
        return Inner(gram[:-1, :-1], gram[:-1, -1], float(gram[-1, -1]), self._log_determinant)

    def coefficients(self, white: np.ndarray) -> np.ndarray:
        """The most probable coefficients (k,) of the dense columns."""
        return np.linalg.solve(self._normal, self._beside.T @ white)
