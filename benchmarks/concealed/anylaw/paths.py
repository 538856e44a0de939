"""Path states: where a drive stands in its own past, for whatever law remembers return points.

A state is the sequence of turning points that later motion has not wiped out (Madelung's rules),
and the drive.  The start of a recording is no turning point, for what came before is not known.
Source: M. Brokate and J. Sprekels, Hysteresis and Phase Transitions (1996), section 2.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..drives import Array
from ..truth.branches import branches

SAME = 3e-4  # of the span: turning points this near are one
Key = tuple[float | str, ...]


@dataclass
class States:
    """Samples by their branch, and where one branch goes over into another.

    A branch is one function of the drive: its key is the way that the drive goes, 1 or -1, and the
    open turning points.  `joints` are (branch, branch, drive): there both functions are one, for
    responses do not jump.
    """

    branches: dict[Key, list[np.ndarray]]
    joints: set[tuple[Key, Key, float]]


def rounded(turns: Array, near: float) -> Array:
    """Turning points, those at most so far above the lowest of a group at one value."""
    order, out, lowest = np.argsort(turns), np.empty_like(turns), -np.inf
    for k in order.tolist():
        if turns[k] - lowest > near:
            lowest = turns[k]
        out[k] = lowest
    return out


def states(drives: Sequence[Array]) -> States:
    """Path states of the samples of recordings, numbered through all of them.

    Args:
        drives: The drive of each recording in V, in steps so fine that turning points are sharp.

    Returns:
        Branches with the indices of their samples.  Recordings share those between both extremes
        so far, where what came before the start adds the same to every sample.
    """
    span = float(np.ptp(np.concatenate(drives)))
    parts = [branches(u) for u in drives]
    corners = [u[ends] for u, (ends, _) in zip(drives, parts, strict=True)]
    every = rounded(np.concatenate(corners), SAME * span)
    met, first, at = States({}, set()), 0, 0
    for which, (u, (ends, ways)) in enumerate(zip(drives, parts, strict=True)):
        levels = every[at : at + len(ends)]
        _follow(met, which, first, u, ends, ways, levels, SAME * span)
        first, at = first + len(u), at + len(ends)
    return met


def _follow(met: States, which: int, first: int, u: Array, ends: Array, ways: Array,
            levels: Array, near: float) -> None:  # fmt: skip
    """Go along one recording, from its sample's number `first` on.

    `turns` begins with the two extremes so far, the last visited second.  Beyond them there is only
    the opposite extreme, and each stretch is a branch of its own: what the past before the start
    has left there is met for the first time.
    """
    moving = np.flatnonzero(ways)
    way = float(ways[moving[0]]) if len(moving) else 1.0
    turns, beyond = [float(levels[0])], 0

    def enter(drive: float, before: Key | None) -> Key:
        now = (way, *turns) if len(turns) > 1 else (way, *turns, f"beyond {which} {beyond}")
        met.branches.setdefault(now, [np.zeros(0, int)])
        if before is not None and before != now:
            met.joints.add((before, now, drive))
        return now

    now = enter(float(u[0]), None)
    met.branches[now].append(np.array([first]))
    for k, (a, b) in enumerate(pairwise(ends.tolist())):
        if ways[k] and ways[k] != way:
            level = float(levels[k])
            if len(turns) > 1 and level == turns[-2]:  # a loop that closes to a hair
                turns = turns[:-2] if len(turns) > 2 else turns[1:]
                beyond += len(turns) == 1
                now = enter(level, now)
            turns = [*turns, level]
            way = float(ways[k])
            now = enter(level, now)
        at = a + 1
        while at <= b:
            n = b + 1 - at
            if ways[k] and len(turns) > 1:  # up to the turning point before last
                n = int(np.searchsorted(way * u[at : b + 1], way * turns[-2] + near))
            met.branches[now].append(np.arange(first + at, first + at + n))
            at += n
            if at <= b:
                level = turns[-2]
                turns = turns[:-2] if len(turns) > 2 else turns[1:]
                beyond += len(turns) == 1
                now = enter(level, now)
