r"""Loop shapes beyond the model's: columns that span rate-independent hysteresis.

Two families, each linear in its columns, span it to a grid's resolution:

- A Preisach operator of any density, Prandtl–Ishlinskii sums and static curves among them, is a sum
  over plays of functions of their states alone, y(t) = ∫ g(r, p_r(t)) dr, with p_r the play of the
  drive u with radius r and p_0 = u: Chebyshev polynomials T_k of the states of many plays.
- Operators whose memory fades along the path of the drive and not in time (Duhem, Jiles–Atherton,
  Bouc–Wen, presliding friction): states dx = -x/λ |du| + T_k(u) du, and + T_k(u) |du|, of many
  lengths λ.

Their coefficients are normal about 0, of sd τ · span · k^-2, or 1/k along the path; this
discrepancy is added to the noise's covariance, Σ + τ² D Dᵀ.
Source: Brokate & Sprekels, Hysteresis and Phase Transitions (1996), chapter 2 (Preisach operators
by plays); Visintin, Differential Models of Hysteresis (1994), chapter V (Duhem's); Kennedy &
O'Hagan, J. R. Stat. Soc. B 63 (2001) 425 (discrepancy).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial import chebyshev

from .._prepare import Preparation

# Grids and orders are chosen by judgement; tests measure how well they span hysteresis.
_RADII = np.geomspace(0.004, 0.5, 20)
"""Radii of the plays, over the drive's span."""
_BEGUN = np.geomspace(0.02, 0.5, 7)
"""The same for plays with another prior history."""
_ORDERS, _STATIC_ORDERS, _BEGUN_ORDERS = 10, 12, 4
"""Orders of the polynomials of plays, of the drive, and of plays with another prior history."""
_PATHS, _PATH_ORDERS = np.geomspace(0.05, 0.5, 4), 2
"""Lengths of the drive's path, over its span, along which a memory fades; orders of the
polynomials."""
_LONG_PATHS = np.geomspace(0.25, 4.0, 5)
"""The same for the state at the start: the half-cycles in which loops settle."""


def loop_shapes(preparation: Preparation) -> np.ndarray:
    """Columns (ΣL, K) of loop shapes beyond the model's, each scaled to its prior sd for τ = 1, in
    the response's unit."""
    setting = preparation.setting
    parts = []
    for take, problem in zip(preparation.takes, preparation.problems(), strict=True):
        drive = (take.recording.drive - setting.drive_low) / setting.drive_span
        rest = -setting.drive_low / setting.drive_span
        shapes = _shapes_of(drive, take.history, rest) * setting.response_span
        parts.append(np.pad(shapes, ((0, len(problem.response) - len(shapes)), (0, 0))))
    return np.concatenate(parts)


def _shapes_of(drive: np.ndarray, history: str, rest: float) -> np.ndarray:
    """Columns (N, K) for a drive (N,) scaled to 0 … 1; `rest` is zero drive on that scale."""
    start = rest if history == "rest" else drive[0]
    states = plays(drive, _RADII, np.full(_RADII.size, start), again=history == "periodic")
    beside = _polynomials(drive[:, None], _ORDERS)
    inner = _polynomials(states, _ORDERS).reshape(drive.size, _RADII.size, _ORDERS)
    inner = (inner - beside[:, None, :]).reshape(drive.size, -1) / np.sqrt(_RADII.size)
    again = history == "periodic"
    parts = [_polynomials(drive[:, None], _STATIC_ORDERS), inner, _fading(drive, again=again)]
    if history != "periodic":
        # The prior history has an effect until it is wiped out, or fades along the drive's path.
        virgin = _polynomials(plays(drive, _BEGUN, np.full(_BEGUN.size, start)), _BEGUN_ORDERS)
        for sign in (-1, 1):
            states = plays(drive, _BEGUN, start + sign * _BEGUN)
            parts.append((_polynomials(states, _BEGUN_ORDERS) - virgin) / np.sqrt(_BEGUN.size))
        path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(drive)))])
        fading = np.exp(-path[:, None] / _LONG_PATHS) / np.sqrt(_LONG_PATHS.size)
        parts += [fading, fading * (2 * drive - 1)[:, None]]
    return np.concatenate(parts, axis=1)


def _polynomials(states: np.ndarray, orders: int) -> np.ndarray:
    """Chebyshev polynomials (N, R · orders) of states (N, R) within 0 … 1, scaled by k^-2."""
    values = chebyshev.chebvander(2 * states - 1, orders)[:, :, 1:] / np.arange(1, orders + 1) ** 2
    return values.reshape(len(states), -1)


def _fading(drive: np.ndarray, *, again: bool) -> np.ndarray:
    """States (N, K) that fade along the path of a drive (N,), from 0, or, if it runs `again`, from
    those at the end of one pass."""
    steps = np.diff(drive, prepend=drive[0])
    kept = np.exp(-np.abs(steps)[:, None, None] / _PATHS[:, None])
    orders = np.arange(_PATH_ORDERS + 1)
    curves = chebyshev.chebvander(2 * drive - 1, _PATH_ORDERS) / np.maximum(orders, 1)
    added = np.concatenate([curves[:, 1:] * steps[:, None], curves * np.abs(steps)[:, None]], 1)
    states = np.zeros((drive.size, _PATHS.size, added.shape[1]))
    for _ in range(2 if again else 1):
        state = states[-1]
        for k in range(drive.size):
            state = kept[k] * state + added[k]
            states[k] = state
    return 2 * states.reshape(drive.size, -1) / np.sqrt(_PATHS.size)


def plays(
    drive: np.ndarray,
    radii: np.ndarray,
    start: Sequence[float] | np.ndarray,
    *,
    again: bool = False,
) -> np.ndarray:
    """Play operators (N, R) of a drive (N,) from states `start` (R,), or, if it runs `again`, from
    those at the end of one pass; computed for each stretch between turning points at once."""
    states = np.empty((drive.size, radii.size))
    states[0] = np.clip(start, drive[0] - radii, drive[0] + radii)
    for first, last in _stretches(drive):
        inside = drive[first + 1 : last + 1, None]
        states[first + 1 : last + 1] = (
            np.maximum(states[first], inside - radii)
            if drive[last] >= drive[first]
            else np.minimum(states[first], inside + radii)
        )
    return plays(drive, radii, states[-1]) if again else states


def _stretches(drive: np.ndarray) -> list[tuple[int, int]]:
    """First and last sample of each stretch in which a drive (N,) does not turn."""
    way = np.sign(np.diff(drive))
    last_moved = np.maximum.accumulate(np.where(way != 0, np.arange(way.size), 0))
    way = way[last_moved]
    turns = np.flatnonzero(way[1:] * way[:-1] < 0) + 1
    ends = np.concatenate([[0], turns, [drive.size - 1]])
    return list(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))
