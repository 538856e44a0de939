r"""The path state of a drive: the turning points that are not wiped out.

Of a rate-independent law with return-point memory the response is one function of the turning
points that the drive has not passed again since (Madelung's rules), the direction, and the drive.
Samples with the same turning points and direction are on the same branch, whenever they are met.
The first value of a drive is no turning point: what came before it is not known.

Source: Madelung, Annalen der Physik 322 (1905) 861; Brokate & Sprekels, Hysteresis and Phase
Transitions (1996), chapter 2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

TURN = 0.004
"""The smallest reversal, over the drive's span, that counts as a turning point.  Smaller ones are
noise or ripple, whose minor loops are of second order."""
SAME = 0.01
"""Turning points nearer than this, over the drive's span, are one: loops that begin so near to each
other differ by less than the noise of any recording here."""

NOISE = 8.0
"""The same over the error of the drive, which alone hardly ever reverses by as much."""


def turning_points(drive: np.ndarray, smallest: float) -> np.ndarray:
    """The samples (K,) at which a drive (N,) turns by at least `smallest` [drive unit]; of a hold
    at an extreme the last one."""
    steps = np.sign(np.diff(drive))
    moving = np.flatnonzero(steps)
    turned = moving[1:][steps[moving[1:]] != steps[moving[:-1]]]
    turns: list[int] = []
    way, extreme, lowest, highest = 0, 0, 0, 0
    for k in [*turned.tolist(), drive.size - 1]:
        value = drive[k]
        if way == 0:
            lowest = k if value <= drive[lowest] else lowest
            highest = k if value >= drive[highest] else highest
            if drive[highest] - drive[lowest] > smallest:
                way, extreme = (1, highest) if highest > lowest else (-1, lowest)
                first = min(lowest, highest)
                if abs(drive[first] - drive[0]) > smallest:
                    turns.append(first)
        elif way * (value - drive[extreme]) >= 0:
            extreme = k
        elif way * (drive[extreme] - value) > smallest:
            turns.append(extreme)
            way, extreme = -way, k
    return np.array(turns, dtype=int)


def without_ripple(drive: np.ndarray, error: float) -> np.ndarray:
    """A drive (N,) of an rms error, of one way between the turning points that noise does not make:
    what noise travels is no path."""
    if error == 0:
        return drive
    steady, first = drive.copy(), 0
    for last in [*turning_points(drive, NOISE * error).tolist(), drive.size - 1]:
        way = 1 if drive[last] >= drive[first] else -1
        steady[first : last + 1] = way * np.maximum.accumulate(way * drive[first : last + 1])
        first = last
    return steady


def branches_of(drives: Sequence[np.ndarray], error: float = 0.0) -> tuple[list[np.ndarray], int]:
    """The branch that each sample is on.

    Args:
        drives: recordings (N,) of one actuator, in the drive's unit; a branch that two of them
            meet is one.
        error: the rms error of the drives, in their unit.

    Returns:
        The number of its branch for each sample (N,) of each drive, and how many there are.
    """
    low, high = min(d.min() for d in drives), max(d.max() for d in drives)
    smallest = max(TURN * (high - low), NOISE * error)
    same = max(SAME * (high - low), smallest)
    index: dict[tuple, int] = {}
    numbers = []
    turns = [turning_points(drive, smallest) for drive in drives]
    names = _names([drive[at] for drive, at in zip(drives, turns, strict=True)], same)
    for k, (drive, at, own) in enumerate(zip(drives, turns, names, strict=True)):
        # What came before a start is not known: no two are the same.
        numbers.append(_along(drive, at, own, smallest, -1 - k, index))
    return numbers, len(index)


def _names(values: Sequence[np.ndarray], same: float) -> list[np.ndarray]:
    """A number for each turning point, alike for those that are the same: a cluster of values that
    is no wider than `same` is one, a wider one is cut into pieces of that width."""
    every = np.concatenate([np.zeros(0), *values])
    if not every.size:
        return [np.zeros(0, dtype=int) for _ in values]
    order = np.argsort(every)
    ranked, name = every[order], np.zeros(every.size, dtype=int)
    begins, number = ranked[0], 0
    for k in range(1, ranked.size):
        if ranked[k] - begins > same:
            begins, number = ranked[k], number + 1
        name[order[k]] = number
    ends = np.cumsum([v.size for v in values])[:-1]
    return list(np.split(name, ends))


def _along(
    drive: np.ndarray,
    turns: np.ndarray,
    names: np.ndarray,
    smallest: float,
    start: int,
    index: dict,
) -> np.ndarray:
    """The branch of each sample (N,) of one drive, whose first value, which is no turning point,
    has the name `start`; `index` numbers the branches."""
    numbers = np.empty(drive.size, dtype=int)
    stack: list[tuple[float, int]] = [(float(drive[0]), start)]
    ends = [*turns.tolist(), drive.size - 1]
    first = 0
    for k, last in enumerate(ends):
        way = 1 if drive[last] >= drive[first] else -1
        reached = np.maximum.accumulate(way * drive[first : last + 1])
        at = first
        while True:
            key = (way, *(name for _, name in stack))
            number = index.setdefault(key, len(index))
            if len(stack) < 2:
                numbers[at : last + 1] = number
                break
            # Passing the turning point before the last wipes out both; a start goes alone.
            passed = way * stack[-2][0] - 0.5 * smallest
            stop = first + int(np.searchsorted(reached, passed))
            numbers[at : min(stop, last + 1)] = number
            if stop > last:
                break
            at = stop
            if stack[-2][1] == start:
                del stack[-2]
                # A start that has been passed leaves the turning point that is left behind.
                continue
            del stack[-2:]
        if k < turns.size:
            stack.append((float(drive[last]), int(names[k])))
            first = last + 1 if last + 1 < drive.size else last
    return numbers
