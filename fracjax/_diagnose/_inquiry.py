"""From a fitted model to the named effects: columns, posterior, names, refits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._blocks import EFFECTS, AbstractBlock
from .._computing import Clock
from .._prepare import Preparation
from .._solve import Progress, tolerated_error
from ._fitted import Fitted
from ._jumps import Jumps, jumps_of
from ._names import Judge, Name
from ._refits import Explanation, beside, elsewhere, enlarged, explained_by
from ._thresholds import ALIKE, APART, MISFIT, NUMERICS, SHARE, SURE
from ._view import View, columns_of, view_of, with_misfit_as_noise

_MOST_RIVALS, _MOST_NAMES, _MOST_TRIED = 4, 3, 6
"""Look-alikes that are refitted for each name, names, and effects that are refitted alone; chosen
by judgement."""
_ALIKE_EXACT = 0.01
"""`ALIKE` where the loop has the model's shape; chosen by judgement."""
_MINOR = 0.1
"""The numerical error that is accepted, over the residual's norm beyond the noise; chosen by
judgement."""
_PART = 0.25
"""The share of the excess that an effect must explain to be refitted without loop shapes; chosen by
judgement."""
_HOPELESS = 3.0
"""χ² of a refit without loop shapes after its first steps, over that of the likeliest hypothesis,
above which it goes no further; chosen by judgement."""
_SMALL = 1.0
"""The size of loop shapes that counts as none, in innovations of the noise; chosen by judgement."""


@dataclass(frozen=True, eq=False)
class Inquiry:
    """The posteriors about the base fit, the named effects, and their refits.

    `first` has the noise as it was measured, `seen` the misfit as a part of it.  `rivals` are for
    each name its refit and those of its look-alikes.  `is_carried`: one effect, refitted, explains
    all that loop shapes would.  `jumps` explain the residual better than any effect; None if not.
    """

    base: Fitted
    first: View
    seen: View
    judge: Judge
    names: tuple[Name, ...]
    explanation: Explanation | None
    rivals: tuple[tuple[Explanation, ...], ...]
    is_carried: bool = False
    jumps: Jumps | None = None

    def unnamed(self) -> Inquiry:
        """The same without names."""
        return replace(self, names=(), explanation=None, rivals=(), is_carried=False)

    @property
    def is_shape(self) -> bool:
        """Whether the loop has another shape than the model's, with probability `SURE`."""
        inexact = self.judge.is_inexact and not self.is_carried
        return inexact and self.seen.posterior.shape > SURE

    @property
    def explained_by_shape(self) -> np.ndarray:
        """The part of the error (ΣL,) that loop shapes and a change of the model's parameters
        explain, in the response's unit."""
        return self.first.fitted.error - self.first.remainder_of(self.judge.alone)


def inquire(
    base: Fitted,
    nominal: AbstractBlock,
    progress: Progress,
    clock: Clock,
    *,
    may_name: bool,
) -> Inquiry:
    """Search for the effects that a base leaves out, and refit them if the recording `may_name`
    any."""
    progress("computing the columns of every effect")
    noises = [take.noise for take in base.preparation.takes if take.noise is not None]
    guessed = any(noise.method == "residual" for noise in noises)
    innovation = np.median([noise.innovation for noise in noises])
    small = _SMALL * float(innovation) / base.preparation.setting.response_span
    columns = columns_of(base)
    progress("comparing effects, pairs and loop shapes")
    first = seen = view_of(base, columns, small)
    best = first.posterior.best
    misfits = first.misfit(best) > MISFIT
    if misfits:
        coloured = replace(base, preparation=with_misfit_as_noise(first, best))
        seen = view_of(coloured, columns, small)
        if guessed:
            first = seen
    judge = Judge(first, seen, small, misfits=misfits)
    # Nothing is named if the numerical error exceeds the noise.
    may_name = may_name and base.numerics <= tolerated_error(NUMERICS, base.solved, _MINOR)
    names = judge.names() if may_name else ()
    inquiry = Inquiry(base, first, seen, judge, names, None, ())
    if not may_name:
        return inquiry
    try:
        alone = not judge.is_inexact and len(names) < 2
        carried = None if alone else _carried(inquiry, nominal, progress, clock)
        if carried is not None:
            inquiry = carried
        elif names:
            inquiry = _refitted(inquiry, nominal, progress, clock)
        return _beside_jumps(inquiry)
    except KeyboardInterrupt:
        clock.stopped = True
        return inquiry.unnamed()


def _beside_jumps(inquiry: Inquiry) -> Inquiry:
    """The inquiry without names if jumps explain the residual better than they do."""
    judge, explanation = inquiry.judge, inquiry.explanation
    if judge.is_inexact and not inquiry.names:
        # Beside a loop of another shape, jumps follow a misfit as anything does.
        return inquiry
    jumps = jumps_of(inquiry.first, judge.alone.tau if judge.is_inexact else 0.0)
    named = tuple(name.effect for name in inquiry.names)
    explained = judge.fall(named)
    if inquiry.is_carried and explanation is not None:
        explained = inquiry.base.solved.cost - explanation.fitted.solved.cost
    better = jumps.worth > max(APART, explained - sum(map(judge.price, named)))
    # They are only told if they explain all: any mismatch has a few steps in it.
    if better and jumps.misfit < MISFIT:
        return replace(inquiry.unnamed(), jumps=jumps)
    return inquiry


def _refitted(
    inquiry: Inquiry, nominal: AbstractBlock, progress: Progress, clock: Clock
) -> Inquiry:
    """The names after refits of them and of their look-alikes."""
    judge, tau = inquiry.judge, inquiry.seen.posterior.best.tau
    preparation: Preparation = inquiry.seen.fitted.preparation
    tau = tau if judge.is_inexact else 0.0

    def explained(names: Sequence[str]) -> Explanation:
        progress(f"refitting with {' and '.join(names)}")
        return explained_by(names, judge, nominal, preparation, tau)

    kept = [_simplest(name.effect) for name in inquiry.names][:_MOST_NAMES]
    best = explained(kept)
    if clock.is_over:
        return replace(inquiry, explanation=best)
    names, rivals = [], []
    for k, name in enumerate(inquiry.names[:_MOST_NAMES]):
        rest = [other for other in best.names if other != best.names[k]]
        gain = _gain(inquiry, best, rest)
        near, others = [], []
        if not judge.is_inexact and len(kept) == 1:
            others += judge.leading(_MOST_TRIED)
        for other in dict.fromkeys(map(_simplest, [*others, *name.alike[:_MOST_RIVALS]])):
            if clock.is_over:
                break
            if other not in best.names:
                near.append(explained([*best.names[:k], other, *best.names[k + 1 :]]))
        *special, best = _with_larger(best, judge, preparation, k)
        near += special
        margin = max(APART, (ALIKE if judge.is_inexact else _ALIKE_EXACT) * gain)
        leading = min([best, *near], key=lambda e: e.cost)
        near = [e if e is leading else beside(e, leading, preparation) for e in near]
        together = _ranked([best, *near], margin, judge)
        if len(kept) == 1:
            best = together[0]
        listed = [_other_name(e, rest) for e in together]
        first = _other_name(best, rest)
        names.append(replace(name, effect=first, alike=tuple(n for n in listed if n != first)))
        rivals.append(tuple(together))
    if best.cost > judge.promised(()):
        return inquiry.unnamed()
    return replace(inquiry, names=tuple(names), explanation=best, rivals=tuple(rivals))


def _ranked(explanations: Sequence[Explanation], margin: float, judge: Judge) -> list[Explanation]:
    """The explanations that the best does not exclude.  First those that refits cannot distinguish
    from it, by the evidence of their columns, which counts all shapes of an effect."""
    least = min(e.standing for e in explanations)

    def order(explanation: Explanation) -> tuple[bool, float]:
        behind = explanation.standing - least
        evidence = judge.fall(explanation.names) - explanation.price
        return behind >= APART, behind if behind >= APART else -evidence

    return sorted((e for e in explanations if e.standing - least < margin), key=order)


def _carried(
    inquiry: Inquiry, nominal: AbstractBlock, progress: Progress, clock: Clock
) -> Inquiry | None:
    """The inquiry with one effect that, refitted without loop shapes, is as likely as any other
    hypothesis, with loop shapes or several effects; None if there is none.

    Far from the fit an effect may explain the residual although its secant does not.
    """
    base, first, judge = inquiry.base, inquiry.first, inquiry.judge.without_shapes()
    hopeless = _HOPELESS * first.misfit(first.posterior.best) * first.gram.count
    fits: list[Explanation] = []
    likely = [n for n in judge.leading(_MOST_TRIED) if judge.fall((n,)) >= _PART * judge.excess]
    for name in dict.fromkeys(map(_simplest, likely)):
        if clock.is_over:
            break
        progress(f"refitting with {name}")
        fits.append(explained_by([name], judge, nominal, base.preparation, 0.0, hopeless))
    if not fits:
        return None
    leading = min(fits, key=lambda e: e.cost)
    if not leading.explains_all:
        special = {leading.names[0], *(EFFECTS[name].special_case for name in likely)}
        tried, fits = fits, []
        for e in tried:
            is_special = e.names[0] in special
            fits += _with_larger(e, judge, base.preparation) if is_special else [e]
    if min(e.fitted.solved.cost for e in fits) > hopeless:
        return None
    fall = base.solved.cost - min(e.fitted.solved.cost for e in fits)
    margin = max(APART, _ALIKE_EXACT * fall)
    near = _ranked(fits, margin, judge)
    best = near[0]
    rival = first.posterior.best.log_posterior - APART / 2
    if first.log_posterior_of(best.fitted.solved.cost, best.price) < rival:
        return None
    if best.fitted.solved.cost > MISFIT * first.gram.count:
        best = elsewhere(best, nominal, base.preparation)
    alike = tuple(e.names[0] for e in near if e is not near[0])
    present = 1 - inquiry.seen.posterior.nothing
    name = Name(best.names[0], alike, present, min(1.0, fall / judge.excess))
    return replace(
        inquiry, names=(name,), explanation=best, rivals=((best, *near[1:]),), is_carried=True
    )


def _simplest(name: str) -> str:
    """The special case of an effect, from whose optimum it is refitted; itself if it has none."""
    return EFFECTS[name].special_case or name


def _with_larger(
    explanation: Explanation, judge: Judge, preparation: Preparation, k: int = 0
) -> list[Explanation]:
    """An explanation, and those with an effect of which its effect k is a special case, if it
    leaves more than noise and they explain a sufficient share of that."""
    kept = [explanation]
    for effect in EFFECTS.values():
        if effect.special_case == explanation.names[k] and not kept[0].explains_all:
            kept[0], larger = enlarged(kept[0], effect.name, judge, preparation)
            special = kept[0].fitted.solved
            explained = special.cost - larger.fitted.solved.cost
            if explained >= SHARE * (special.cost - special.samples):
                kept.append(larger)
    return kept


def _other_name(explanation: Explanation, rest: Sequence[str]) -> str:
    """The effect of an explanation that is not among the others."""
    return next(name for name in explanation.names if name not in rest)


def _gain(inquiry: Inquiry, best: Explanation, rest: Sequence[str]) -> float:
    """The reduction of χ² by an effect beside the others."""
    fall = inquiry.judge.fall(tuple(best.names)) - inquiry.judge.fall(tuple(rest))
    return max(0.0, fall)
