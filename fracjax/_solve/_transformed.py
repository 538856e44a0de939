"""Drives transformed on a circle |ζ| = r, where linear blocks multiply them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import ceil
from typing import Any, NamedTuple

import numpy as np
import scipy.fft
from scipy.fft import next_fast_len

from .._operators import Grid, History, circle

AT_ONCE = 8
"""Signals transformed together: enough for the processor's vectors, few enough for its cache."""
_SHORT, _SHORT_WRAP = 1.25, 1e-8
"""Length of a short circle in signals, and its r^L.  Terms that wrap round and rounding, which
grows as r^-M, are then equal: against the compiled programs a response's error is 2e-10 to 5e-10 of
its size (FOH, orders to ±0.6, 5,000 samples), on a circle of twice the length 1e-11."""
_POINTS = 80
"""Points ζ at which transfer functions are compared.  Chosen by judgement."""


class _Circle(NamedTuple):
    """Where signals of M samples are transformed.

    Attributes:
        zeta: (F,) the points of the transform, dimensionless.
        length: the transform's length.
        damping: (M,) that of the samples on the circle, dimensionless.
        growth: (M,) its inverse.
    """

    zeta: np.ndarray
    length: int
    damping: np.ndarray
    growth: np.ndarray


@lru_cache(maxsize=4)
def _circle(samples: int, history: History, short: bool) -> _Circle:
    """The circle for signals of a length, kept because all recordings of a stack share it."""
    if history == "periodic":
        zeta = np.exp(-2j * np.pi * np.arange(1, samples // 2 + 1) / samples)
        return _Circle(zeta, samples, np.ones(samples), np.ones(samples))
    length, radius = circle(samples)
    if short:
        length = int(next_fast_len(ceil(_SHORT * samples), real=True))  # type: ignore[arg-type]
        radius = _SHORT_WRAP ** (1 / length)
    zeta = radius * np.exp(-2j * np.pi * np.arange(length // 2 + 1) / length)
    damping = radius ** np.arange(samples)
    return _Circle(zeta, length, damping, 1 / damping)


@dataclass(frozen=True)
class Transformed:
    """Drives, transformed once for any number of linear blocks.

    Attributes:
        moving: (d, M) the drives without the constant part that their history makes known.
        history: the drive before the first sample.
        short: whether the circle is a short one.
    """

    moving: np.ndarray
    history: History
    short: bool

    @classmethod
    def of(cls, drives: np.ndarray, grid: Grid, short: bool = False) -> Transformed:
        """The transforms of drives (M, d)."""
        rows = np.ascontiguousarray(drives.T)
        moving = rows - rows[:, :1] if grid.history == "constant" else rows
        return cls(moving, grid.history, short)

    @property
    def _on(self) -> _Circle:
        return _circle(self.moving.shape[1], self.history, self.short)

    @property
    def zeta(self) -> np.ndarray:
        """The points (F,) of the transform, dimensionless."""
        return self._on.zeta

    @property
    def growth(self) -> np.ndarray:
        """What undoes (M,) the damping of the samples on the circle, dimensionless."""
        return self._on.growth

    def of_rows(self, rows: Any) -> np.ndarray:
        """The transforms (r, F) of some of the drives, by their indices (r,) or a slice."""
        zeta, length, damping, _ = self._on
        start = 1 if self.history == "periodic" else 0
        moving = self.moving[rows] * damping
        return np.asarray(scipy.fft.rfft(moving, length))[:, start:][:, : zeta.size]

    @cached_property
    def drives(self) -> np.ndarray:
        """The drives' transforms (d, F), which all chains share."""
        return self.of_rows(slice(None))

    def back(self, transforms: np.ndarray, every: int = 1) -> np.ndarray:
        """Signals (K, ⌈M/every⌉) at each `every`-th sample, from their transforms (K, F).

        Where only every other sample is wanted, the upper half of the transform is added to the
        lower one, which halves the length of the inverse.
        """
        zeta, length, _, growth = self._on
        growth = growth[::every]
        missing = length // 2 + 1 - zeta.size
        if missing:  # the mean, which a block without static gain cannot pass on
            transforms = np.pad(transforms, [(0, 0), (missing, 0)])
        halvings = 0
        while every % 2 == 0 and length % 4 == 0:
            half = length // 4
            upper = np.conj(transforms[:, : half - 1 : -1])
            upper += transforms[:, : half + 1]
            transforms, length, every, halvings = upper, length // 2, every // 2, halvings + 1
        signals = np.asarray(scipy.fft.irfft(transforms, length, axis=-1))[:, ::every]
        return signals[:, : growth.size] * (growth / 2**halvings if halvings else growth)

    @cached_property
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """Points ζ (F,) on |ζ| = r, r^M = e^-2, and the square root of the drives' power near each.

        The total power is scaled to 1.
        """
        samples, spectrum = self.moving.shape[1], np.zeros(1)
        radius, length = np.exp(-2 / samples), self._on.length
        for first in range(0, len(self.moving), AT_ONCE):
            if self.history == "periodic":
                transforms = self.of_rows(slice(first, first + AT_ONCE))
            else:
                damped = self.moving[first : first + AT_ONCE] * radius ** np.arange(samples)
                transforms = np.asarray(scipy.fft.rfft(damped, length))
            spectrum = spectrum + np.sum(np.abs(transforms) ** 2, axis=0)
        at = _spread(spectrum.size)
        steady = self.history == "periodic"
        zeta = self.zeta[at] if steady else radius * np.exp(-2j * np.pi * at / length)
        middles = (at[1:] + at[:-1] + 1) // 2
        # If the signals are zero, all points have the same weight.
        spectrum = spectrum if spectrum.any() else np.ones(spectrum.size)
        gathered = np.add.reduceat(spectrum, np.concatenate([[0], middles]))
        # Padded to one size, for which one program is compiled.
        padding = _POINTS - at.size
        zeta, gathered = np.pad(zeta, (0, padding), mode="edge"), np.pad(gathered, (0, padding))
        return zeta, np.sqrt(gathered / gathered.sum())


def _spread(count: int) -> np.ndarray:
    """Up to `_POINTS` integers below `count`, evenly spaced in their logarithm."""
    return np.unique(np.round(np.geomspace(1, count, _POINTS)).astype(int)) - 1
