r"""Memory that fades along the path, and change with the path travelled: dense columns.

The memory of Duhem's operators (Bouc–Wen, Jiles–Atherton, presliding friction) fades along the path
of the drive and not in time, so that a branch is never met again exactly: states
dx = -x/λ |du| + T_k(u) du and + T_k(u) |du|, of many lengths λ, beside the free curves.

Source: Visintin, Differential Models of Hysteresis (1994), chapter V.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev

from ._memory import without_ripple

_LENGTHS = np.array([0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2])
"""Lengths over the drive's span along which a memory fades: from the distance of a few knots to a
few cycles.  With none below .1 and polynomials of order 2, a recording of Jiles and Atherton's law
kept 1.5 times its noise, and a sensor's lag was named for it; so it keeps .84, as others do."""
_SETTLING = np.array([0.5, 1.0, 2.0, 4.0, 8.0])
"""Lengths, over the drive's span, along which a loop settles at the start."""
_LOOP = 0.2
"""The length over the drive's span along which a typical loop opens."""
_BLOCK = 300.0
"""Lengths that a block goes on."""
_ORDERS = 4
"""Order of the polynomials of the drive."""


def path_length(drive: np.ndarray, error: float) -> np.ndarray:
    """The path (N,) that a drive (N,) of an rms error has travelled, over its span."""
    steps = np.abs(np.diff(without_ripple(drive, error)))
    return np.concatenate([[0.0], np.cumsum(steps)]) / np.ptp(drive)


def fading_memory(drive: np.ndarray, low: float, span: float, error: float) -> np.ndarray:
    """Columns (N, K) of memory that fades along the path of a drive (N,) of an rms error, whose
    range over all recordings begins at `low` and is `span`; each at most 1 in size."""
    scaled = (drive - low) / span
    steps = np.diff(without_ripple(drive, error), prepend=drive[0]) / span
    path = np.cumsum(np.abs(steps))
    curves = chebyshev.chebvander(2 * scaled - 1, _ORDERS)
    added = np.concatenate([curves[:, 1:] * steps[:, None], curves * np.abs(steps)[:, None]], 1)
    states = [_faded(added, path / length) for length in _LENGTHS]
    fading = np.exp(-path[:, None] / _SETTLING)
    columns = np.concatenate([*states, fading, fading * curves[:, 1:2]], axis=1)
    return columns / np.maximum(np.abs(columns).max(axis=0), 1e-300)


def loop_of(drive: np.ndarray, span: float) -> np.ndarray:
    """The opening (N,) of a loop of a drive (N,), from -½ to ½: Dahl's memory, which fades along a
    fifth of the drive's `span`."""
    steps = np.diff(drive, prepend=drive[0]) / span
    path = np.cumsum(np.abs(steps))
    return _faded(steps[:, None], path / _LOOP)[:, 0] / (2 * _LOOP)


def openings_of(drive: np.ndarray, widths: Sequence[float]) -> np.ndarray:
    """How far plays of some half-widths, in the drive's unit, are behind a drive (N,): (N, K).

    A play's step is a clipping to v ± r, and so are several of its steps in a row, of which there
    are twice as many in each round.
    """
    openings = np.empty((drive.size, len(widths)))
    for k, width in enumerate(widths):
        low, high = drive - width, drive + width
        low[0] = high[0] = drive[0]
        steps = 1
        while steps < drive.size:
            ends = low[steps:].copy(), high[steps:].copy()
            low[steps:], high[steps:] = (np.clip(v[:-steps], *ends) for v in (low, high))
            steps *= 2
        openings[:, k] = low - drive
    return openings


def _faded(added: np.ndarray, path: np.ndarray) -> np.ndarray:
    """The sums Σ_(j ≤ k) e^(p_j - p_k) a_j (N, K) of what is added (N, K) along a path p (N,), by
    blocks in which e^p does not overflow."""
    faded, last = np.empty_like(added), 0.0
    ends = np.flatnonzero(np.diff((path / _BLOCK).astype(int))) + 1
    for first, stop in pairwise([0, *ends.tolist(), path.size]):
        growth = np.exp(path[first:stop] - path[first])[:, None]
        carried = last * np.exp(path[first - 1] - path[first]) if first else 0.0
        faded[first:stop] = (np.cumsum(added[first:stop] * growth, axis=0) + carried) / growth
        last = faded[stop - 1]
    return faded
