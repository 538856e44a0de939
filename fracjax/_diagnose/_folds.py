"""Held-out stretches: how well the others predict them with and without an effect's columns.

A named effect must also reduce χ² on data that its coefficients have not been fitted to; one that
only follows a misfit does not.  To first order: with A the whitened columns of the effect, of the
fit's tangent and of loop shapes, each of unit prior sd, and b the whitened residual, the
coefficients without the fold k are (1 + AᵀA - A_kᵀA_k)⁻¹ (Aᵀb - A_kᵀb_k).
"""

from __future__ import annotations

import numpy as np

from ._fitted import Fitted
from ._held_out import FOLDS, folds_of

FREE = 1e3
"""Prior sd of the tangent's coefficients in standard errors: in effect they are free."""


class Folds:
    """A fit's stretches, held out in turn."""

    def __init__(self, fitted: Fitted, shapes: np.ndarray, residual: np.ndarray):
        """`shapes` (ΣL, S), scaled to unit prior sd, and `residual` (ΣL,) are whitened."""
        tangent = fitted.whitened(fitted.tangent)
        tangent = FREE * tangent / (np.linalg.norm(tangent, axis=0) + 1e-300)
        self._fixed, self._residual = np.concatenate([tangent, shapes], axis=1), residual
        fold = folds_of(fitted)
        self._folds = [np.flatnonzero(fold == k) for k in range(FOLDS)]
        self._own = [self._products(rows) for rows in self._folds]
        self._all = tuple(map(sum, zip(*self._own, strict=True)))

    def _products(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """AᵀA and Aᵀb of some rows, of the tangent and the shapes."""
        fixed = self._fixed[rows]
        return fixed.T @ fixed, fixed.T @ self._residual[rows]

    def squares(self, columns: np.ndarray) -> np.ndarray:
        """The sums of squared errors (FOLDS,) with whitened columns (ΣL, k) of unit prior sd."""
        gram, along = self._all
        between, own = self._fixed.T @ columns, columns.T @ columns
        toward, squares = columns.T @ self._residual, []
        for rows, (fold_gram, fold_along) in zip(self._folds, self._own, strict=True):
            fixed, added = self._fixed[rows], columns[rows]
            across = between - fixed.T @ added
            normal = np.block([[gram - fold_gram, across], [across.T, own - added.T @ added]])
            right = [along - fold_along, toward - added.T @ self._residual[rows]]
            coefficients = np.linalg.solve(np.eye(len(normal)) + normal, np.concatenate(right))
            design = np.concatenate([fixed, added], axis=1)
            error = self._residual[rows] - design @ coefficients
            squares.append(error @ error)
        return np.array(squares)
