"""Jumps of the response that no drive causes, as of a mount that slips: a sum of steps in time.

No effect of the catalogue is one, but drifts resemble it.
Source: Yao, Stat. Probab. Lett. 6 (1988) 181 (the number of steps by the Schwarz criterion).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._folds import FREE
from ._view import View

_GRID, _FINER = 96, 24
"""Times that are tried at first in all recordings, and again about the best; chosen by
judgement."""
_MOST = 5
"""Jumps at most; chosen by judgement."""


class Jumps(NamedTuple):
    """The samples (k,) of all recordings at which the response jumps, by how much, in the
    response's unit, and the reduction of χ² minus its price."""

    samples: tuple[int, ...]
    sizes: tuple[float, ...]
    worth: float


def jumps_of(view: View, tau: float) -> Jumps:
    """The jumps that explain most of a fit's residual beside loop shapes of size τ, one after
    another, as many as are worth their price of 2 ln N."""
    error, _, shapes = view.white
    tangent = view.fitted.whitened(view.fitted.tangent)
    tangent = FREE * tangent / (np.linalg.norm(tangent, axis=0) + 1e-300)
    fixed = np.concatenate([tangent, tau * shapes], axis=1) if tau > 0 else tangent
    inverse = np.linalg.inv(np.eye(fixed.shape[1]) + fixed.T @ fixed)

    def beside(signals: np.ndarray) -> np.ndarray:
        return signals - fixed @ (inverse @ (fixed.T @ signals))

    counted = np.flatnonzero(view.fitted.counted)
    ends = np.cumsum([len(problem.response) for problem in view.fitted.problems])

    def steps(samples: np.ndarray) -> np.ndarray:
        """Whitened steps (ΣL, k) that last to the end of their recording."""
        times = np.arange(error.size)[:, None]
        last = ends[np.searchsorted(ends, samples, side="right")]
        return view.fitted.whitened(((times >= samples) & (times < last)).astype(float))

    price, residual = 2 * np.log(view.gram.count), beside(error)
    chosen: list[int] = []
    columns, taken = np.zeros((error.size, 0)), 0.0
    # Grids leave out the first sample, at which a step is the offset.
    grid = counted[1:][:: max(1, counted.size // _GRID)]
    while len(chosen) < _MOST:
        tried, spacing = grid, np.diff(grid).max(initial=1)
        for _ in range(2):
            added = beside(steps(tried))
            falls = [_taken(np.column_stack([columns, a]), residual) for a in added.T]
            best = int(np.argmax(falls))
            close = np.abs(counted - tried[best]) <= spacing
            now, fall, column = int(tried[best]), falls[best], added[:, best]
            tried = counted[1:][close[1:]]
            tried = tried[:: max(1, tried.size // _FINER)]
        if fall - taken < price:
            break
        chosen.append(now)
        columns, taken = np.column_stack([columns, column]), fall
    sizes = np.linalg.lstsq(columns, residual, rcond=None)[0] if chosen else np.zeros(0)
    order = np.argsort(chosen)
    samples = tuple(chosen[k] for k in order)
    return Jumps(samples, tuple(sizes[order].tolist()), taken - price * len(chosen))


def _taken(columns: np.ndarray, residual: np.ndarray) -> float:
    """The reduction of χ² by columns (ΣL, k) with free gains."""
    gains = np.linalg.lstsq(columns, residual, rcond=None)[0]
    return float(residual @ (columns @ gains))
