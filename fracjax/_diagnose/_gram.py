r"""Every inner product that the selection needs, computed once.

The whitened residual r, the whitened columns D of all effects and N of the loop shapes are
projected onto the complement of the fit's tangent.  A covariance 1 + τ² N Nᵀ instead of the noise's
1 changes any inner product to

    a · b   →   a · b - (Nᵀa)ᵀ (τ⁻² + NᵀN)⁻¹ (Nᵀb)

so that one Gram matrix and the eigenvalues of NᵀN suffice for every τ.
Source: Woodbury's identity; Rasmussen & Williams, Gaussian Processes (2006), A.3.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import qr

_INDEPENDENT = 1e-7
"""The smallest diagonal element of a QR factor, over unit columns, that counts as independent."""
_SEEN = 1e-5
"""The length below which a projected column counts as absorbed, over its own."""


class Inner(NamedTuple):
    """Inner products under one τ: of columns (K, K), of columns with the residual (K,), of the
    residual with itself, and the logarithm of the covariance's determinant."""

    columns: np.ndarray
    along: np.ndarray
    square: float
    log_determinant: float

    def given(self, chosen: np.ndarray, sizes: np.ndarray) -> Inner:
        """The same with the columns `chosen` (k,) in the covariance too, with coefficients of these
        standard deviations (k,)."""
        own = self.columns[np.ix_(chosen, chosen)]
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


class Gram:
    """Inner products of a whitened residual (L,), columns (L, K) and shapes (L, S), projected onto
    the complement of a tangent (L, P); `count`: the samples minus its rank."""

    def __init__(
        self,
        residual: np.ndarray,
        columns: np.ndarray,
        shapes: np.ndarray,
        tangent: np.ndarray,
        samples: int,
    ):
        self._basis = _basis(tangent)
        self.count = samples - self._basis.shape[1]
        self.residual, self.shapes = self._beside(residual), self._beside(shapes)
        self.columns = self._beside(columns)
        lengths, whole = (np.linalg.norm(x, axis=0) for x in (self.columns, columns))
        self.columns[:, lengths <= _SEEN * np.maximum(whole, 1e-12)] = 0.0
        self.concealments = 1 - (lengths / np.maximum(whole, 1e-300)) ** 2
        values, self._turned = np.linalg.eigh(self.shapes.T @ self.shapes)
        self.values = np.maximum(values, 0.0)
        self._columns = self.columns.T @ self.columns
        self._along = self.columns.T @ self.residual
        self.square = float(self.residual @ self.residual)
        self._principal = self.shapes @ self._turned
        self._shared = self._principal.T @ self.columns
        self._shared_residual = self._principal.T @ self.residual

    def _beside(self, signals: np.ndarray) -> np.ndarray:
        """What the tangent does not explain of signals (L, …)."""
        return signals - self._basis @ (self._basis.T @ signals)

    def weighted(self, signals: np.ndarray, tau: float) -> np.ndarray:
        """Whitened signals (L, k), projected, times the inverse covariance with loop shapes of size
        τ."""
        projected = self._beside(signals)
        along = self._principal.T @ projected
        return projected - self._principal @ (self._weights(tau)[:, None] * along)

    def _weights(self, tau: float) -> np.ndarray:
        """What loop shapes of size τ take of a signal along each of their principal directions."""
        return tau**2 / (1 + tau**2 * self.values)

    @property
    def width(self) -> int:
        """How many columns there are."""
        return self.columns.shape[1]

    def under(self, tau: float) -> Inner:
        """Inner products with loop shapes of size τ in the covariance."""
        weights = self._weights(tau)
        weighted = weights[:, None] * self._shared
        return Inner(
            self._columns - self._shared.T @ weighted,
            self._along - weighted.T @ self._shared_residual,
            self.square - float(weights @ self._shared_residual**2),
            float(np.log1p(tau**2 * self.values).sum()),
        )

    def remainder(self, tau: float, chosen: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """The residual (L,) minus the most probable combination of shapes and columns."""
        design = np.concatenate([tau * self.shapes, sizes * self.columns[:, chosen]], axis=1)
        coefficients = np.linalg.solve(
            np.eye(design.shape[1]) + design.T @ design, design.T @ self.residual
        )
        return self.residual - design @ coefficients


def _basis(tangent: np.ndarray) -> np.ndarray:
    """An orthonormal basis (L, r) of what the columns (L, P) span."""
    scaled = tangent / (np.linalg.norm(tangent, axis=0) + 1e-300)
    factors: Any = qr(scaled, mode="economic", pivoting=True, check_finite=False)
    basis, triangle, _ = factors
    return basis[:, np.abs(np.diag(triangle)) > _INDEPENDENT]
