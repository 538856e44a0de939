"""The noise of recordings: what makes it white, of unit variance."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np
import scipy.sparse as sp


class Whitening:
    """Noise filters and weights of recordings: `taps` (p+1,) and `weights` (N,), one each."""

    def __init__(self, taps: Sequence[np.ndarray], weights: Sequence[np.ndarray]):
        parts = []
        for own, weight in zip(taps, weights, strict=True):
            lags: Any = [-k for k in range(own.size)]
            shape = (weight.size, weight.size)
            filtered = sp.diags_array(list(own), offsets=lags, shape=shape)
            parts.append(sp.diags_array(weight) @ filtered)
        self.matrix = sp.csr_array(sp.block_diag(parts, format="csr"))
        self.innovation = float(np.median([1 / abs(own[0]) for own in taps]))
        self.counted = np.concatenate(list(weights)) > 0
        self.lost = 0.0
        """How many samples' worth an error that may be there leaves out."""

    def loosened(self, error: np.ndarray) -> Whitening:
        """The same with an error (ΣN,) of each sample in the noise [response unit]."""
        other = copy(self)
        weights = 1 / np.hypot(1.0, error / self.innovation)
        other.matrix = sp.csr_array(sp.diags_array(weights) @ self.matrix)
        other.lost = float(np.sum(1 - weights[self.counted] ** 2))
        return other

    @property
    def count(self) -> int:
        """How many samples count."""
        return int(np.count_nonzero(self.counted))

    def __call__(self, signals):
        """Signals (ΣN, …), dense or sparse, of unit variance where they count."""
        return self.matrix @ signals
