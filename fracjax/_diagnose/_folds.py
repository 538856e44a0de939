"""Held-out stretches: how well the others predict them with and without an effect's columns.

An effect that is there improves the prediction of most parts of a recording; one that only follows
a misfit improves some and spoils others.  To first order: with A the whitened columns of the
effect, of the fit's tangent and of loop shapes, each of unit prior sd, and b the whitened residual,
the coefficients without the fold k are (1 + AᵀA - A_kᵀA_k)⁻¹ (Aᵀb - A_kᵀb_k).
Source: Wilcoxon, Biometrics Bulletin 1 (1945) 80 (signed ranks).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.stats import wilcoxon

from ._fitted import Fitted
from ._held_out import FOLDS, STRETCHES, folds_of
from ._thresholds import DOUBT


class Gain(NamedTuple):
    """What columns improve in held-out parts of a recording: the median `share` of a part's excess
    over the noise that they explain, and the p-value of the signed-rank test that they improve no
    part more than by chance."""

    share: float
    p_value: float


class Folds:
    """A fit's stretches, held out in turn."""

    def __init__(self, fitted: Fitted, shapes: np.ndarray, residual: np.ndarray):
        """`shapes` (ΣL, S), scaled to unit prior sd, and `residual` (ΣL,) are whitened."""
        free = fitted.whitened(fitted.free_directions)
        self._fixed, self._residual = np.concatenate([free, shapes], axis=1), residual
        fold = folds_of(fitted)
        self._folds = [np.flatnonzero(fold == k) for k in range(FOLDS)]
        self._own = [self._products(rows) for rows in self._folds]
        self._all = tuple(map(sum, zip(*self._own, strict=True)))
        self._parts = np.array_split(np.flatnonzero(fitted.counted), STRETCHES)

    def _products(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """AᵀA and Aᵀb of some rows, of the tangent and the shapes."""
        fixed = self._fixed[rows]
        return fixed.T @ fixed, fixed.T @ self._residual[rows]

    def gain(self, before: np.ndarray, columns: np.ndarray) -> Gain:
        """What whitened columns (ΣL, k) of unit prior sd predict better than others, whose squared
        errors (STRETCHES,) are those `before`."""
        after = self.squares(columns)
        counts = np.array([part.size for part in self._parts])
        share = (before - after) / np.maximum(before - counts, DOUBT * counts)
        test: Any = wilcoxon(before, after, alternative="greater")
        return Gain(float(np.median(share)), float(test.pvalue))

    def squares(self, columns: np.ndarray) -> np.ndarray:
        """The sums of squared errors of each part (STRETCHES,) with whitened columns (ΣL, k) of
        unit prior sd."""
        error = self.errors(columns)
        return np.array([error[part] @ error[part] for part in self._parts])

    def errors(self, columns: np.ndarray) -> np.ndarray:
        """The errors (ΣL,) of held-out stretches with whitened columns (ΣL, k) of unit prior
        sd."""
        gram, along = self._all
        between, own = self._fixed.T @ columns, columns.T @ columns
        toward, error = columns.T @ self._residual, np.empty_like(self._residual)
        for rows, (fold_gram, fold_along) in zip(self._folds, self._own, strict=True):
            fixed, added = self._fixed[rows], columns[rows]
            across = between - fixed.T @ added
            normal = np.block([[gram - fold_gram, across], [across.T, own - added.T @ added]])
            right = [along - fold_along, toward - added.T @ self._residual[rows]]
            coefficients = np.linalg.solve(np.eye(len(normal)) + normal, np.concatenate(right))
            design = np.concatenate([fixed, added], axis=1)
            error[rows] = self._residual[rows] - design @ coefficients
        return error
