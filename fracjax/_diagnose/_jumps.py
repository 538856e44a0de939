"""Jumps of the response that no drive causes, as of a mount that slips: a sum of steps in time.

No effect of the catalogue is one, but drifts resemble it.
Source: Yao, Stat. Probab. Lett. 6 (1988) 181 (the number of steps by the Schwarz criterion).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ._views import ModelView

_GRID, _FINER = 96, 24
"""Times that are tried at first in all recordings, and again about the best; chosen by
judgement."""
_MOST, _SEEN = 5, 1e-3
"""Jumps at most, and the square of a whitened step below which the fit absorbs it; chosen by
judgement."""


class Jumps(NamedTuple):
    """The samples (k,) of all recordings at which the response jumps, by how much, in the
    response's unit, the reduction of χ² minus its price, and the excess κ - 1 beside them."""

    samples: tuple[int, ...]
    sizes: tuple[float, ...]
    worth: float
    excess: float


def jumps_of(view: ModelView) -> Jumps:
    """The jumps that explain most of a fit's residual, one after another, as many as are worth
    their price of 2 ln N."""
    fitted, counted = view.fitted, np.flatnonzero(view.fitted.counted)
    ends = np.cumsum([len(problem.response) for problem in fitted.problems])
    times = np.arange(ends[-1])[:, None]

    def steps(samples: np.ndarray) -> np.ndarray:
        """Whitened steps (ΣL, k) that last to the end of their recording, beside the fit."""
        last = ends[np.searchsorted(ends, samples, side="right")]
        raw = ((times >= samples) & (times < last)).astype(float)
        return view.prior.weighted(fitted.whitened(raw))

    remaining = view.prior.weighted(fitted.whitened(fitted.error)[:, None])[:, 0]
    chosen, earlier, worth = np.zeros(0, dtype=int), np.zeros((ends[-1], 0)), 0.0
    price = 2 * np.log(view.law.count)

    def falls(columns: np.ndarray) -> np.ndarray:
        """The reductions of χ² (k,) by each column beside the earlier ones."""
        basis = np.linalg.qr(earlier)[0]
        beside = columns - basis @ (basis.T @ columns)
        squares = np.sum(beside**2, axis=0)
        return (beside.T @ remaining) ** 2 / np.maximum(squares, _SEEN)

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
    heights = np.linalg.lstsq(earlier, remaining, rcond=None)[0]
    square = float(np.sum((remaining - earlier @ heights) ** 2))
    order = np.argsort(chosen)
    return Jumps(
        tuple(chosen[order].tolist()), tuple(heights[order].tolist()), worth,
        square / view.law.count - 1,
    )  # fmt: skip
