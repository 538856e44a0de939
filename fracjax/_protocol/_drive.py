"""A drive to be recorded, and the pieces that it is made of."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ._limits import Limits

_ROUNDING = np.array([1, 4, 6, 4, 1]) / 16
"""Binomial weights by which corners are rounded."""


@dataclass(frozen=True)
class Part:
    """A stretch of a drive and what it is for.

    Attributes:
        name: in a word or two.
        start: its beginning [s].
        stop: its end [s].
        purpose: what it shows.
    """

    name: str
    start: float
    stop: float
    purpose: str


@dataclass(frozen=True)
class Drive:
    """A drive that could be recorded next.

    Attributes:
        description: in words.
        values: (N,) [drive unit].
        step: time between samples [s].
        parts: its stretches, in order; of a drive of one piece none.
    """

    description: str
    values: np.ndarray
    step: float
    parts: tuple[Part, ...] = field(default=())

    @property
    def times(self) -> np.ndarray:
        """Times (N,) [s] of the samples."""
        return self.step * np.arange(self.values.size)


def corners_rounded(drive: np.ndarray) -> np.ndarray:
    """A drive (N,) with its corners rounded over four samples, since samples do not show how a
    drive with corners runs between them; neither its range nor its fastest change grows."""
    beyond = _ROUNDING.size // 2
    return np.convolve(np.pad(drive, beyond, mode="edge"), _ROUNDING, "valid")


class Pen:
    """Writes a drive piece by piece, never faster than the limits allow."""

    def __init__(self, limits: Limits, step: float):
        self._most = limits.slew * step
        self.step = step
        self._pieces = [np.array([limits.start])]
        self._parts: list[tuple[str, int, str]] = []

    @property
    def level(self) -> float:
        """Where the drive is [drive unit]."""
        return float(self._pieces[-1][-1])

    @property
    def samples(self) -> int:
        """How many samples there are."""
        return sum(piece.size for piece in self._pieces)

    def begin(self, name: str, purpose: str) -> None:
        """Begin a part."""
        self._parts.append((name, self.samples - 1, purpose))

    def hold(self, seconds: float) -> None:
        """Stay where it is."""
        self._pieces.append(np.full(max(round(seconds / self.step), 1), self.level))

    def go(self, level: float, seconds: float = 0.0) -> None:
        """A straight line to a level [drive unit] in a time, or in the shortest that is allowed,
        and a stay as long as rounded corners need to reach it."""
        distance = abs(level - self.level)
        fewest = int(np.ceil(distance / self._most * (1 - 1e-12)))
        count = max(fewest, round(seconds / self.step))
        line = np.linspace(self.level, level, count + 1)[1:]
        self._pieces.append(np.append(line, np.full(_ROUNDING.size - 1, level)))

    def wave(self, values: np.ndarray) -> None:
        """A piece (N,) [drive unit] that itself keeps the limits, reached by a line."""
        self.go(float(values[0]))
        self._pieces.append(values[1:])

    def drive(self, description: str) -> Drive:
        """The drive so far."""
        ends = [start for _, start, _ in self._parts[1:]] + [self.samples - 1]
        parts = tuple(
            Part(name, start * self.step, stop * self.step, purpose)
            for (name, start, purpose), stop in zip(self._parts, ends, strict=True)
        )
        return Drive(description, np.concatenate(self._pieces), self.step, parts)
