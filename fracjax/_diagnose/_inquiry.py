"""From a fitted model to what is named: columns, posterior, names, refits."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._blocks import EFFECTS, AbstractBlock
from .._prepare import Preparation
from .._solve import Progress, tolerated_error
from ._fitted import Fitted
from ._names import Judge, Name
from ._refits import Explanation, beside, explained_by
from ._thresholds import ALIKE, APART, MISFIT, NUMERICS, SURE
from ._view import View, columns_of, view_of, with_misfit_as_noise

_MOST_RIVALS, _MOST_NAMES, _MOST_TRIED = 4, 3, 6
_ALIKE_EXACT = 0.01
_MINOR = 0.1
_HALF = 0.5
_SMALL = 1.0


class Clock:
    """The seconds that a diagnosis may take; `stopped` where it was interrupted."""

    def __init__(self, seconds: float):
        self._end = time.monotonic() + seconds
        self.stopped = False

    @property
    def is_over(self) -> bool:
        """Whether no further refit is to be begun."""
        self.stopped = self.stopped or time.monotonic() > self._end
        return self.stopped


@dataclass(frozen=True, eq=False)
class Inquiry:
    """What was seen about the base fit, what is named, and what it was refitted with.

    `first` is in units of the noise alone, `seen` counts what is left over as noise.  `rivals` are
    for each name the refits with what may stand in its place.  `is_carried` where one effect,
    refitted, carries all of what loop shapes would, with fewer numbers.
    """

    base: Fitted
    first: View
    seen: View
    judge: Judge
    names: tuple[Name, ...]
    explanation: Explanation | None
    rivals: tuple[tuple[Explanation, ...], ...]
    is_carried: bool = False

    def unnamed(self) -> Inquiry:
        """The same without names."""
        return replace(self, names=(), explanation=None, rivals=(), is_carried=False)

    @property
    def is_shape(self) -> bool:
        """Whether the loop's shape is surely not the model's."""
        inexact = self.judge.is_inexact and not self.is_carried
        return inexact and self.seen.posterior.shape > SURE

    @property
    def taken_by_shape(self) -> np.ndarray:
        """What loop shapes, with the model's numbers following, take from the error (ΣL,), in the
        response's unit."""
        return self.first.fitted.error - self.first.left_of(self.judge.alone)


def inquire(
    base: Fitted,
    nominal: AbstractBlock,
    progress: Progress,
    clock: Clock,
    *,
    may_name: bool,
) -> Inquiry:
    """Ask what a base leaves out, and name it where the recording `may_name` anything."""
    progress("computing every effect's columns")
    guessed = any(_is_guessed(take) for take in base.preparation.takes)
    takes = base.preparation.takes
    innovation = np.median([take.noise.innovation for take in takes if take.noise is not None])
    small = _SMALL * float(innovation) / base.preparation.setting.response_span
    columns = columns_of(base)
    progress("weighing effects, pairs and loop shapes")
    first = view_of(base, columns, small, thinned=True, most=2)
    best, seen = first.posterior.best, None
    if first.misfit(best) > MISFIT:
        coloured = replace(base, preparation=with_misfit_as_noise(first, best))
        seen = view_of(coloured, columns, small)
        if guessed:
            first = seen
    seen = seen or view_of(base, columns, small)
    judge = Judge(first, seen, small)
    # A simulation that is off by more than the noise names nothing.
    may_name = may_name and base.numerics <= tolerated_error(NUMERICS, base.solved, _MINOR)
    names = judge.names() if may_name else ()
    found = Inquiry(base, first, seen, judge, names, None, ())
    if not may_name:
        return found
    try:
        alone = not judge.is_inexact and len(names) < 2
        carried = None if alone else _carried(found, nominal, progress, clock)
        if carried is not None:
            return carried
        return _refitted(found, nominal, progress, clock) if names else found
    except KeyboardInterrupt:
        clock.stopped = True
        return found.unnamed()


def _is_guessed(take) -> bool:
    return take.noise.method == "residual"


def _refitted(found: Inquiry, nominal: AbstractBlock, progress: Progress, clock: Clock) -> Inquiry:
    """The names after refits of what they stand for and of what may stand in their place."""
    judge, tau = found.judge, found.seen.posterior.best.tau
    preparation: Preparation = found.seen.fitted.preparation
    tau = tau if judge.is_inexact else 0.0

    def explained(names: Sequence[str]) -> Explanation:
        progress(f"refitting with {' and '.join(names)}")
        return explained_by(names, judge, nominal, preparation, tau)

    kept = [name.effect for name in found.names][:_MOST_NAMES]
    best = explained(kept)
    if clock.is_over:
        return replace(found, explanation=best)
    names, rivals = [], []
    for k, name in enumerate(found.names[:_MOST_NAMES]):
        rest = [other for other in kept if other != name.effect]
        gain = _gain(found, best, rest)
        special = EFFECTS[name.effect].special_case
        near, larger = [], [e.name for e in EFFECTS.values() if e.special_case == name.effect]
        larger += [special] if special else []
        if not judge.is_inexact and len(kept) == 1:
            larger += judge.leading(_MOST_TRIED)
        for other in dict.fromkeys([*larger, *name.alike[:_MOST_RIVALS]]):
            if clock.is_over:
                break
            if other not in kept:
                near.append(explained([*kept[:k], other, *kept[k + 1 :]]))
        margin = max(APART, (ALIKE if judge.is_inexact else _ALIKE_EXACT) * gain)
        leading = min([best, *near], key=lambda e: e.cost)
        near = [e if e is leading else beside(e, leading, preparation) for e in near]
        winner = _simplest([best, *near], margin)
        together = sorted([best, *near], key=lambda e: (e is not winner, e.standing))
        together = [e for e in together if e.cost - winner.cost < margin]
        if len(kept) == 1:
            best = winner
        listed = [_other_name(e, rest) for e in together]
        first = _other_name(best, rest)
        names.append(replace(name, effect=first, alike=tuple(n for n in listed if n != first)))
        rivals.append(tuple(together))
    return replace(found, names=tuple(names), explanation=best, rivals=tuple(rivals))


def _simplest(explanations: Sequence[Explanation], margin: float) -> Explanation:
    """The best of some explanations, or of those that are as good the special case of it."""
    best = min(explanations, key=lambda e: e.standing)
    special = {EFFECTS[name].special_case for name in best.names}
    simpler = [
        e for e in explanations if special & set(e.names) and e.standing < best.standing + margin
    ]
    return min(simpler, key=lambda e: e.standing, default=best)


def _carried(
    found: Inquiry, nominal: AbstractBlock, progress: Progress, clock: Clock
) -> Inquiry | None:
    """The inquiry where one effect, refitted without loop shapes, is as likely as all that stands
    beside them, or as several effects: far from the fit a secant may miss what the effect itself
    does not.  None where no effect is."""
    base, first, judge = found.base, found.first, found.judge.without_shapes()
    fits: list[Explanation] = []
    for name in judge.leading(_MOST_TRIED):
        if clock.is_over or judge.fall((name,)) < _HALF * judge.excess:
            break
        progress(f"refitting with {name}")
        fits.append(explained_by([name], judge, nominal, base.preparation, 0.0))
    if not fits:
        return None
    fall = base.solved.cost - min(e.fitted.solved.cost for e in fits)
    margin = max(APART, _ALIKE_EXACT * fall)
    best = _simplest(fits, margin)
    rival = first.posterior.best.log_posterior - APART / 2
    if first.log_posterior_of(best.fitted.solved.cost, best.price) < rival:
        return None
    near = [e for e in fits if e.cost - best.cost < margin]
    alike = tuple(e.names[0] for e in near if e is not best)
    there = 1 - found.seen.posterior.nothing
    name = Name(best.names[0], alike, there, min(1.0, fall / judge.excess))
    return replace(found, names=(name,), explanation=best, rivals=(tuple(near),), is_carried=True)


def _other_name(explanation: Explanation, rest: Sequence[str]) -> str:
    """The effect of an explanation that is not among the others."""
    return next(name for name in explanation.names if name not in rest)


def _gain(found: Inquiry, best: Explanation, rest: Sequence[str]) -> float:
    """What an effect takes from χ² beside the others."""
    fall = found.judge.fall(tuple(best.names)) - found.judge.fall(tuple(rest))
    return max(0.0, fall)
