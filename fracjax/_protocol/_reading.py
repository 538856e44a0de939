"""How a long drive is read with few samples: evenly, and its longest fast stretch for itself.

Lines between the samples of a coarse reading miss a fast drive.  There it does not count, and the
longest such stretch is read at the coarsest rate that shows it.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation, label

MISSED = 0.01
"""How far lines between samples may miss the drive, over its span: turning points nearer than this
are one."""
_AROUND = 4
"""Coarse samples before and after a fast stretch that are read with it."""
_LEAST = 1000
"""Samples of the reading of a fast stretch at least: what a fast change leaves behind comes after
it."""
_NEAR = 16
"""Coarse samples between two fast stretches that are one."""


class Reading(NamedTuple):
    """Samples of a drive that are read: from `start` to `stop`, every `every`th; `counted` says
    which of them (n,) count."""

    start: int
    stop: int
    every: int
    counted: np.ndarray

    @property
    def samples(self) -> slice:
        """The samples that are read."""
        return slice(self.start, self.stop, self.every)


def readings_of(drive: np.ndarray, most: int) -> list[Reading]:
    """The readings of a drive (N,) by at most `most` samples each: of the whole of it, and where
    that misses it, of the longest stretch."""
    every = -(-drive.size // most)
    missed = _missed(drive, every)
    readings = [Reading(0, drive.size, every, ~missed[::every])]
    if missed.any():
        readings.append(_longest(drive, missed, every, most))
    return readings


def _longest(drive: np.ndarray, missed: np.ndarray, every: int, most: int) -> Reading:
    """The longest stretch that every `every`th sample misses, as much of it as `most` samples
    hold at the rate that shows it."""
    marks, _ = label(missed)  # type: ignore[misc]
    at = np.flatnonzero(marks == np.argmax(np.bincount(marks[missed])))
    start, stop = int(at[0]), int(at[-1]) + 1
    finer = every // 2
    while finer > 1 and _missed(drive[start:stop], finer).any():
        finer //= 2
    finer = max(finer, 1)
    stop = min(max(stop, start + _LEAST * finer), start + most * finer, drive.size)
    return Reading(start, stop, finer, np.ones(-(-(stop - start) // finer), dtype=bool))


def _missed(drive: np.ndarray, every: int) -> np.ndarray:
    """The samples (N,) of stretches that lines between every `every`th sample miss."""
    if every == 1:
        return np.zeros(drive.size, dtype=bool)
    kept = np.arange(0, drive.size, every)
    lines = np.interp(np.arange(drive.size), kept, drive[kept])
    off = np.abs(lines - drive) > MISSED * np.ptp(drive)
    marked = np.flatnonzero(off)
    for one, other in pairwise(marked.tolist()):
        if 1 < other - one < _NEAR * every:
            off[one:other] = True
    return np.asarray(binary_dilation(off, iterations=_AROUND * every)) if marked.size else off
