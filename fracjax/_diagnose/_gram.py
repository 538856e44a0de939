r"""Every inner product that the selection asks for, computed once.

With r the whitened residual, D the whitened columns of all effects and N those of the loop shapes,
each without what the fit's tangent can take up, a covariance 1 + τ² N Nᵀ in the noise's stead makes
of any inner product

    a · b   →   a · b - (Nᵀa)ᵀ (τ⁻² + NᵀN)⁻¹ (Nᵀb)

so that one Gram matrix and the eigenvalues of NᵀN answer for every τ.
Source: Woodbury's identity; Rasmussen & Williams, Gaussian Processes (2006), A.3.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import qr

_INDEPENDENT = 1e-7
_SEEN = 1e-5


class Inner(NamedTuple):
    """Inner products under one τ: of columns (K, K), of columns with the residual (K,), of the
    residual with itself, and the logarithm of the covariance's determinant."""

    columns: np.ndarray
    along: np.ndarray
    square: float
    log_determinant: float

    def given(self, chosen: np.ndarray, sizes: np.ndarray) -> Inner:
        """The same where the columns `chosen` (k,) may be there too, with coefficients normal about
        0 of these `sizes` (k,)."""
        own = self.columns[np.ix_(chosen, chosen)]
        known = np.linalg.solve(
            np.diag(sizes**-2) + own, np.column_stack([self.columns[chosen], self.along[chosen]])
        )
        return Inner(
            self.columns - self.columns[:, chosen] @ known[:, :-1],
            self.along - self.columns[:, chosen] @ known[:, -1],
            self.square - float(self.along[chosen] @ known[:, -1]),
            self.log_determinant
            + float(np.linalg.slogdet(np.eye(chosen.size) + sizes[:, None] * own * sizes)[1]),
        )


class Gram:
    """Inner products of a whitened residual (L,), columns (L, K) and shapes (L, S), of which a
    tangent (L, P) has taken what it can; `count`: how many samples count beside it."""

    def __init__(
        self,
        residual: np.ndarray,
        columns: np.ndarray,
        shapes: np.ndarray,
        tangent: np.ndarray,
        samples: int,
    ):
        basis = _basis(tangent)

        def beside(signals: np.ndarray) -> np.ndarray:
            return signals - basis @ (basis.T @ signals)

        self.count = samples - basis.shape[1]
        self.residual, self.shapes = beside(residual), beside(shapes)
        self.columns = beside(columns)
        lengths, whole = (np.linalg.norm(x, axis=0) for x in (self.columns, columns))
        self.columns[:, lengths <= _SEEN * np.maximum(whole, 1e-12)] = 0.0
        self.concealments = 1 - (lengths / np.maximum(whole, 1e-300)) ** 2
        values, self._turned = np.linalg.eigh(self.shapes.T @ self.shapes)
        self.values = np.maximum(values, 0.0)
        self._columns = self.columns.T @ self.columns
        self._along = self.columns.T @ self.residual
        self.square = float(self.residual @ self.residual)
        turned = self.shapes @ self._turned
        self._shared, self._shared_residual = turned.T @ self.columns, turned.T @ self.residual

    @property
    def width(self) -> int:
        """How many columns there are."""
        return self.columns.shape[1]

    def under(self, tau: float) -> Inner:
        """Inner products where loop shapes may be of this size."""
        known = tau**2 / (1 + tau**2 * self.values)
        weighted = known[:, None] * self._shared
        return Inner(
            self._columns - self._shared.T @ weighted,
            self._along - weighted.T @ self._shared_residual,
            self.square - float(known @ self._shared_residual**2),
            float(np.log1p(tau**2 * self.values).sum()),
        )

    def left(self, tau: float, chosen: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """The residual (L,) without the shapes and columns that are most probable."""
        design = np.concatenate([tau * self.shapes, sizes * self.columns[:, chosen]], axis=1)
        known = np.linalg.solve(
            np.eye(design.shape[1]) + design.T @ design, design.T @ self.residual
        )
        return self.residual - design @ known


def _basis(tangent: np.ndarray) -> np.ndarray:
    """An orthonormal basis (L, r) of what the columns (L, P) span."""
    scaled = tangent / (np.linalg.norm(tangent, axis=0) + 1e-300)
    found: Any = qr(scaled, mode="economic", pivoting=True, check_finite=False)
    left, triangle, _ = found
    return left[:, np.abs(np.diag(triangle)) > _INDEPENDENT]
