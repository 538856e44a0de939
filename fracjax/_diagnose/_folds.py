"""Stretches set aside: how well the others predict them with an effect's columns and without.

What an effect is named for it must also take from data that its coefficients have not seen: what
only follows a misfit does not.  To first order, beside the fit's tangent and loop shapes: with A
the whitened columns of all that, each of unit prior sd, and b the whitened residual, the
coefficients without the fold k are (1 + AᵀA - A_kᵀA_k)⁻¹ (Aᵀb - A_kᵀb_k).
"""

from __future__ import annotations

import numpy as np

from ._fitted import Fitted
from ._held_out import FOLDS, fold_of_sample

_FREE = 1e3
"""Prior sd of the tangent's coefficients, in units of one standard error: nothing holds them."""


class Folds:
    """Squares of the errors (FOLDS,) of a fit's stretches, set aside in turn."""

    def __init__(self, fitted: Fitted, shapes: np.ndarray, residual: np.ndarray):
        """`shapes` (ΣL, S) and `residual` (ΣL,) are whitened; shapes have their prior's size."""
        tangent = fitted.whitened(fitted.tangent)
        tangent = _FREE * tangent / (np.linalg.norm(tangent, axis=0) + 1e-300)
        self._fixed, self._residual = np.concatenate([tangent, shapes], axis=1), residual
        takes, problems = fitted.preparation.takes, fitted.problems
        pairs = zip(takes, problems, strict=True)
        fold = np.concatenate([fold_of_sample(t.recording, len(p.response)) for t, p in pairs])
        self._folds = [np.flatnonzero(fold == k) for k in range(FOLDS)]
        self._own = [self._products(rows) for rows in self._folds]
        self._all = tuple(map(sum, zip(*self._own, strict=True)))

    def _products(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        fixed = self._fixed[rows]
        return fixed.T @ fixed, fixed.T @ self._residual[rows]

    def squares(self, columns: np.ndarray) -> np.ndarray:
        """Those of each fold beside whitened columns (ΣL, k), which have their prior's size."""
        gram, along = self._all
        between, own = self._fixed.T @ columns, columns.T @ columns
        toward, found = columns.T @ self._residual, []
        for rows, (fold_gram, fold_along) in zip(self._folds, self._own, strict=True):
            fixed, added = self._fixed[rows], columns[rows]
            across = between - fixed.T @ added
            left = np.block([[gram - fold_gram, across], [across.T, own - added.T @ added]])
            right = [along - fold_along, toward - added.T @ self._residual[rows]]
            known = np.linalg.solve(np.eye(len(left)) + left, np.concatenate(right))
            error = self._residual[rows] - np.concatenate([fixed, added], axis=1) @ known
            found.append(error @ error)
        return np.array(found)
