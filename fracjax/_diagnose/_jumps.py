"""Jumps of the response that no drive causes, as of a mount that slips: a sum of steps in time.

No effect of the catalogue is one, but drifts resemble it.
Source: Yao, Stat. Probab. Lett. 6 (1988) 181 (the number of steps by the Schwarz criterion).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._view import View

_GRID, _FINER = 96, 24
"""Times that are tried at first in all recordings, and again about the best; chosen by
judgement."""
_MOST, _SEEN = 5, 1e-3
"""Jumps at most, and the square of a whitened step below which the fit absorbs it; chosen by
judgement."""


class Jumps(NamedTuple):
    """The samples (k,) of all recordings at which the response jumps, by how much, in the
    response's unit, the reduction of χ² minus its price, and χ² per sample beside them."""

    samples: tuple[int, ...]
    sizes: tuple[float, ...]
    worth: float
    misfit: float


def jumps_of(view: View, tau: float) -> Jumps:
    """The jumps that explain most of a fit's residual beside loop shapes of size τ, one after
    another, as many as are worth their price of 2 ln N."""
    gram, counted = view.gram, np.flatnonzero(view.fitted.counted)
    ends = np.cumsum([len(problem.response) for problem in view.fitted.problems])
    times = np.arange(ends[-1])[:, None]

    def steps(samples: np.ndarray) -> np.ndarray:
        """Whitened steps (ΣL, k) that last to the end of their recording."""
        last = ends[np.searchsorted(ends, samples, side="right")]
        return view.fitted.whitened(((times >= samples) & (times < last)).astype(float))

    remaining = gram.weighted(gram.residual[:, None], tau)[:, 0]
    chosen, earlier = np.zeros(0, dtype=int), np.zeros((ends[-1], 0))

    def falls(columns: np.ndarray) -> np.ndarray:
        """The reductions of χ² (k,) by each column beside the earlier ones."""
        shared = gram.weighted(earlier, tau)
        inverse, across = np.linalg.inv(earlier.T @ shared), columns.T @ shared
        along = columns.T @ remaining - across @ (inverse @ (earlier.T @ remaining))
        squares = np.sum(columns * gram.weighted(columns, tau), axis=0)
        squares = squares - np.sum((across @ inverse) * across, axis=1)
        return along**2 / np.maximum(squares, _SEEN)

    price, worth = 2 * np.log(gram.count), 0.0
    # A step at the first sample is the offset.
    later = counted[1:]
    grid = later[:: max(1, counted.size // _GRID)]
    while chosen.size < _MOST:
        best = grid[np.argmax(falls(steps(grid)))]
        close = later[np.abs(later - best) <= np.diff(grid).max(initial=1)]
        close = close[:: max(1, close.size // _FINER)]
        columns = steps(close)
        each = falls(columns)
        k = int(np.argmax(each))
        if each[k] < price:
            break
        chosen, worth = np.append(chosen, close[k]), worth + float(each[k]) - price
        earlier = np.concatenate([earlier, columns[:, [k]]], axis=1)
    heights = np.linalg.solve(earlier.T @ gram.weighted(earlier, tau), earlier.T @ remaining)
    order = np.argsort(chosen)
    square = float(gram.residual @ remaining) - worth - price * chosen.size
    return Jumps(
        tuple(chosen[order].tolist()), tuple(heights[order].tolist()), worth, square / gram.count
    )
