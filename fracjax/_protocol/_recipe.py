"""The recipe of a drive that can tell: its parts, and how long and how large each is.

Two samples at the same turning points and drive are alike under any law of hysteresis.  So one path
is travelled at two rates and more (dynamics differ), held on the way for three decades of time
(creep), and again at the end (drifts); small tones at several levels show modes.  The path begins
with the whole range, after which its state is known, so that every later piece of it is a meeting.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from ._drive import Drive, Pen, corners_rounded
from ._limits import Limits
from ._multisine import MEASURED, SETTLING, multisine

RATIO = 8.0
"""The least ratio of the slow path's rate to the fast one's, as far as the limits allow."""
LEAST_RATIO = 2.0
"""The ratio below which two rates are none."""
_FEWEST = 8
"""Samples of a rest at least: the rounding of a corner takes some of them."""
_FITTINGS, _MARGIN = 6, 8
"""How often the parts are shortened until they fit, and by how many samples more than are over."""
_STROKE = 16
"""Fewest samples of a move over the whole range: how a law runs within a sample, nobody knows."""
_LEAST_LEG, _LEAST_PERIOD = 12, 64
"""Fewest samples of a leg of the fast path, and of a period of the tones."""
_DECADES = (1.0, 0.1, 0.01)
"""Durations of the holds, over the longest."""
_HOLDS = ((0.7, 0.3), (0.5, 0.5), (0.9, 0.1))
"""Their levels, upwards and downwards, over the range."""
_SPARE = 0.97
"""The share of the fastest change that the tones use."""


@dataclass(frozen=True)
class Recipe:
    """How long, over each other, and how large the parts of a drive are.

    Attributes:
        slow: the slow path.
        ratio: the rate of the fast path over the slow one's.
        passes: how often the fast path is travelled.
        between: how often the path is travelled at the geometric mean of both rates.
        rungs: amplitudes of the path's inner loops, how many.
        minor: depth of the minor loop of each, over its amplitude; 0 for none.
        holds: all holds.
        tones: all tones.
        size: of the tones, peak to peak over the range.
        tilt: the power of frequency with which their amplitudes fall.
        biases: levels about which there are tones.
        again: the share of the slow path that is repeated at the end.
        rests: both rests.
    """

    slow: float = 0.34
    ratio: float = 10.0
    passes: int = 2
    between: int = 0
    rungs: int = 2
    minor: float = 0.5
    holds: float = 0.2
    tones: float = 0.1
    size: float = 0.05
    tilt: float = 0.5
    biases: int = 3
    again: float = 0.6
    rests: float = 0.05

    def __str__(self) -> str:
        return ", ".join(f"{f.name} {getattr(self, f.name):.3g}" for f in fields(self))

    @property
    def path(self) -> list[float]:
        """The levels of the path over the range, from 0: the whole range, then inner loops with
        minor loops on their way."""
        levels = [1.0, 0.0]
        for k in range(self.rungs):
            top = (k + 1) / (self.rungs + 1)
            levels += [top, top * (1 - self.minor), top, 0.0] if self.minor else [top, 0.0]
        return levels

    @property
    def travelled(self) -> float:
        """The length of the path over the range."""
        return float(np.abs(np.diff([0.0, *self.path])).sum())

    def slow_share(self, ratio: float) -> float:
        """The share of the whole duration that the slow path takes."""
        moving = self.slow * (1 + self.again + self.passes / ratio + self.between / ratio**0.5)
        return self.slow / (moving + self.holds + self.tones + self.rests)

    def fastest(self, limits: Limits, duration: float, step: float) -> float:
        """The ratio of rates that limits allow in a duration [s] and with samples `step` [s]
        apart, at most the recipe's own."""
        slow = duration * self.slow_share(self.ratio)
        shortest = max(
            self.travelled * limits.span / resolved(limits, step).slew,
            len(self.path) * _LEAST_LEG * step,
        )
        return min(self.ratio, slow / shortest)


def resolved(limits: Limits, step: float) -> Limits:
    """The limits, with no move faster than samples `step` [s] apart resolve."""
    return replace(limits, slew=min(limits.slew, limits.span / (_STROKE * step)))


def drive_of(
    recipe: Recipe, limits: Limits, duration: float, step: float, top: float
) -> Drive | None:
    """The drive of a recipe within the limits, of a duration [s], with samples `step` [s] apart and
    tones up to the frequency `top` [Hz]; None where its parts do not fit."""
    wanted, room = round(duration / step), duration
    for _ in range(_FITTINGS):
        ratio = recipe.fastest(limits, room, step)
        if ratio < LEAST_RATIO:
            return None
        pen = _written(recipe, limits, room, step, top, ratio)
        spare = wanted - pen.samples
        if spare >= 0:
            pen.hold(spare * step)
            break
        room += (spare - _MARGIN) * step
    else:
        return None
    drive = pen.drive(f"a designed drive of {duration:.4g} s")
    values = np.clip(limits.rounded(corners_rounded(drive.values)), limits.low, limits.high)
    return replace(drive, values=values[:wanted])


def _written(
    recipe: Recipe, limits: Limits, room: float, step: float, top: float, ratio: float
) -> Pen:
    """All parts but the end of the last rest, in about the time `room` [s]."""
    slow = room * recipe.slow_share(ratio)
    unit = slow / recipe.slow
    pen = Pen(resolved(limits, step), step)

    def along(levels: list[float], rate: float) -> None:
        """A path at so many times the slow rate."""
        here = (pen.level - limits.low) / limits.span
        for level, length in zip(levels, np.abs(np.diff([here, *levels])), strict=True):
            pen.go(limits.low + level * limits.span, length / recipe.travelled * slow / rate)

    pen.begin("rest", "the noise, and a drift that is under way")
    pen.hold(max(0.5 * recipe.rests * unit, _FEWEST * step))
    whole = recipe.path
    pen.begin("slow path", "the hysteresis: each branch of the path as if at rest")
    along(whole, 1.0)
    # What follows is met again: branches of the same path at other rates.
    for times, own, name in (
        (recipe.between, ratio**0.5, "path between"),
        (recipe.passes, ratio, "fast path"),
    ):
        if times:
            pen.begin(name, f"lags, delays and creep: the same path {own:.3g} times as fast")
            for _ in range(times):
                along(whole, own)
    if recipe.holds:
        pen.begin("holds", "creep and ringing: steps both ways, held over three decades of time")
        _hold(pen, limits, recipe.holds * unit)
    if recipe.tones:
        pen.begin(
            "tones",
            "modes, and the frequency response with its noise and its odd and even distortions",
        )
        _sound(pen, limits, recipe, recipe.tones * unit, top)
    if recipe.again:
        pen.begin("first part again", "drifts and wear: the slow path once more")
        along(_beginning(whole, recipe.again), 1.0)
    pen.begin("rest", "what still creeps, and the noise once more")
    pen.go(limits.start, 0.02 * unit)
    pen.hold(max(0.45 * recipe.rests * unit, _FEWEST * step))
    return pen


def _beginning(levels: list[float], share: float) -> list[float]:
    """The first levels of a path, as much of its length as a share, at least the whole range."""
    lengths = np.cumsum(np.abs(np.diff([0.0, *levels])))
    count = int(np.searchsorted(lengths, share * lengths[-1] * (1 + 1e-9), side="right"))
    return levels[: max(count, 2)]


def _hold(pen: Pen, limits: Limits, seconds: float) -> None:
    """Steps to levels on both main branches, held over three decades of time."""
    longest = seconds / (2 * sum(_DECADES))
    pen.go(limits.low)
    for duration, (up, down) in zip(_DECADES, _HOLDS, strict=True):
        for level, turn in ((up, limits.high), (down, limits.low)):
            pen.go(limits.low + level * limits.span)
            pen.hold(longest * duration)
            pen.go(turn)


def _sound(pen: Pen, limits: Limits, recipe: Recipe, seconds: float, top: float) -> None:
    """Small tones about several levels."""
    step = pen.step
    periods = recipe.biases * (SETTLING + MEASURED)
    samples = max(int(seconds / periods / step), _LEAST_PERIOD)
    wave = multisine(samples, max(int(top * samples * step), 3), recipe.tilt)
    steepest = np.abs(np.diff(wave, append=wave[:1])).max()
    size = min(0.5 * recipe.size * limits.span, _SPARE * limits.slew * step / steepest)
    for bias in np.linspace(0, 1, recipe.biases + 2)[1:-1]:
        level = limits.low + bias * limits.span
        pen.wave(level + size * np.tile(wave, SETTLING + MEASURED))
        pen.go(limits.low)
