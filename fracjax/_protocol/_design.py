"""The design: the recipe whose drive shows the least visible effect best.

How small an effect a drive shows is known from the drive alone, and is the same for a drive at a
lower rate whose parts take as long: recipes are compared on few samples.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from .._path import Signal, detectabilities
from ._drive import Drive
from ._limits import Limits
from ._recipe import Recipe, drive_of
from ._signals import few_samples, ideal_signal

_SAMPLES = 2400
"""Samples of a drive on which recipes are compared: what is better on them is better on more."""
TOP = 0.1
"""The highest tone over the sampling rate: lines between ten samples a period miss its amplitude by
3 %."""
_OTHERS = 0.3
"""The weight of the mean effect beside the one that is seen worst, in the logarithm of
detectability; chosen by judgement."""
_STEPS: dict[str, tuple[float, ...]] = {
    "ratio": (8.0, 12.0, 20.0, 40.0),
    "passes": (1, 2, 3, 5, 8),
    "between": (0, 1, 2),
    "rungs": (0, 1, 2, 3),
    "minor": (0.0, 0.35, 0.5, 0.7),
    "again": (0.3, 0.6, 1.0, 1.5),
}
"""Values that are tried.  Rests and tones, of which few samples cannot judge, stay as they are."""
_SHARES, _FACTORS = ("slow", "holds"), (0.5, 0.71, 1.41, 2.0)
"""Parts whose duration is changed, and by which factors."""
_OPTIONAL = ("holds", "tones")
"""Those that are left out where what is recorded already shows what they would."""
_GAIN = 1e-3
"""The least gain of a step."""


@dataclass(frozen=True)
class Task:
    """What a drive is designed for.

    Attributes:
        limits: of the drive.
        duration: of it [s].
        step: between its samples [s].
        top: the highest frequency of tones [Hz].
        slope: of the response by the drive [response unit/drive unit].
        noise: of the response, rms [response unit].
        effects: that it is to show.
        before: what is recorded already.
    """

    limits: Limits
    duration: float
    step: float
    top: float
    slope: float
    noise: float
    effects: Collection[str]
    before: Sequence[Signal] = ()

    def coarse(self) -> Task:
        """The same at a lower rate, in no codes."""
        step = max(self.step, self.duration / _SAMPLES)
        limits, top = replace(self.limits, code=0.0), min(self.top, TOP / step)
        before = tuple(few_samples(signal, _SAMPLES) for signal in self.before)
        return replace(self, limits=limits, step=step, top=top, before=before)

    def drive(self, recipe: Recipe) -> Drive | None:
        """The drive of a recipe; None where its parts do not fit."""
        return drive_of(recipe, self.limits, self.duration, self.step, self.top)

    def seen(self, recipe: Recipe) -> dict[str, float]:
        """How well each effect is seen, over what is needed to name it; {} for a recipe whose parts
        do not fit."""
        drive = self.drive(recipe)
        if drive is None:
            return {}
        own = ideal_signal(drive.values, self.step, self.slope, self.noise)
        return detectabilities([*self.before, own], self.effects)


def worth(seen: dict[str, float]) -> float:
    """How good a drive is: the logarithm of the least detectability, and a little of the others."""
    if not seen:
        return -inf
    logs = np.log(list(seen.values()))
    return float(logs.min() + _OTHERS * logs.mean())


def designed(task: Task, most: int, progress: Callable[[str], None]) -> Recipe:
    """The best recipe that a coordinate search finds, from the plain one, with at most so many
    evaluations."""
    coarse, best, count = task.coarse(), Recipe(), 0
    highest, improved = worth(coarse.seen(best)), True
    optional = _OPTIONAL if task.before else ()
    fields = dict.fromkeys((*_SHARES, *_STEPS, *optional))
    while improved and count < most:
        improved = False
        for one in (one for field in fields for one in _varied(best, field, optional)):
            if count == most:
                break
            count += 1
            value = worth(coarse.seen(one))
            if value > highest + _GAIN:
                best, highest, improved = one, value, True
            progress(f"designing the drive: {count} tried")
    return best


def _varied(recipe: Recipe, field: str, optional: Collection[str]) -> Iterator[Recipe]:
    """The recipe with other values of a field."""
    own = getattr(recipe, field)
    values = list(_STEPS.get(field, ()))
    if field in _SHARES:
        values = [(own or getattr(Recipe(), field)) * factor for factor in _FACTORS]
    if field in optional:
        values = [*values, 0.0, getattr(Recipe(), field)]
    for value in values:
        if value != own:
            yield replace(recipe, **{field: value})
