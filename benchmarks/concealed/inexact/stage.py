"""One stage on one drive: its law scaled to volts and micrometres, and the effects beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..drives import Array, Drive
from ..truth import Effect, Scene, drive_side, response_side
from .laws import Law, Params

OVER = 8  # fine steps per recorded sample; the tests halve the step
COARSE = 4  # for the effects that a truth is compared with
HISTORIES = ("fresh", "cycled", "demagnetised")
Pairs = list[tuple[Effect, Mapping]]


def history(kind: str, x0: float) -> Array:
    """The slow path to x0 before the record: from below, after a cycle, or after shrinking ones."""
    corners = {
        "fresh": [-1.0],
        "cycled": [-1.0, 1.0, -1.0],
        "demagnetised": [-1.0, *(x0 + (1 - abs(x0)) * (-0.8) ** np.arange(16))],
    }[kind]
    corners = np.array([*corners, x0])
    length = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))])
    points = np.union1d(length, np.linspace(0, length[-1], 2 + int(length[-1] / 0.02)))
    return np.interp(points, length, corners)


@dataclass(frozen=True)
class Stage:
    """A stage whose law answers to volts between `rated` with `gain` um per unit of the law.

    `before` is the slow path to the start of the record, in rated half ranges.
    """

    law: Law
    params: Params
    gain: float
    rated: tuple[float, float]
    drive: Drive
    before: Array
    over: int = OVER

    @cached_property
    def t(self) -> Array:
        """Fine instants in s, the last of them the last recorded sample."""
        many = (len(self.drive.times) - 1) * self.over + 1
        return np.arange(many) / (self.drive.rate * self.over)

    @cached_property
    def u(self) -> Array:
        """Drive in V at the fine instants."""
        return self.drive(self.t)

    @cached_property
    def plain(self) -> Array:
        """Response in um at the fine instants, without effects."""
        return self.response(self.u)

    @cached_property
    def scene(self) -> Scene:
        return Scene.of(self.u, self.plain, self.t[1], 1 / self.drive.rate)

    def response(self, u: Array) -> Array:
        """Response in um to volts at the fine instants."""
        middle, half = 0.5 * (self.rated[1] + self.rated[0]), 0.5 * (self.rated[1] - self.rated[0])
        x = (u - middle) / half
        return self.gain * self.law.response(x, self.t[1], self.params, self.before)

    def recorded(self, pairs: Pairs) -> Array:
        """Response in um at the recorded samples, with effects, without noise."""
        on_drive = any(e.side == "I" for e, _ in pairs)
        y = self.response(drive_side(pairs, self.drive, self.t)) if on_drive else self.plain
        return response_side(pairs, self.drive, self.t, y)[:: self.over]

    def with_params(self, params: Params) -> Stage:
        """The same stage with other numbers in its law."""
        return replace(self, params=params)

    def coarse(self) -> Stage:
        """The same stage on a coarser grid."""
        return replace(self, over=COARSE)
