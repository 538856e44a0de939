"""From a machine and recordings to the physics that its model leaves out inside its dynamics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import softmax

from .._blocks import INSIDE, AbstractMachine, Within
from .._computing import computing, time_is_over
from .._parameters import set_values
from .._prepare import Preparation
from .._solve import Descent, Progress, Solved, begin, descend, silent, solve_from
from ._columns import columns_of
from ._evidence import Weighed, independent_samples, weigh
from ._result import DOMINANT, Candidate, Inside, Round

_SHORTLIST = 4
"""Effects that are fitted in each round; chosen by judgement."""
_WORTH = 0.1
"""The share of the residual below which an effect is not fitted, over that of the best."""
_MOST_ROUNDS, _TENTATIVE = 4, 2
"""Effects that are sought one after the other at most, and of them beyond those that are named."""
_STARTS = (1.0, 0.3)
"""Starts of an effect's size, over the one that the columns say: a large effect is overstated to
first order."""
_EVALUATIONS = 15
"""Evaluations of each of them, before the best is fitted to its end; chosen by judgement."""

HeldOut = Callable[[Solved], float]
"""The rms error of a fit on data that it has not used [response]."""


def inquire_inside(
    block: AbstractMachine | Within,
    preparation: Preparation,
    held_out: HeldOut | None = None,
    progress: Progress = silent,
) -> Inside:
    """Name the effects inside a machine that its model leaves out.

    The machine is fitted; every effect that one of its ports admits is a column about the fit, in
    several shapes; the most probable are fitted with all parameters free, from which follows which
    it is.  It is named if it explains more than all that it leaves, and the next is sought about
    the new fit.

    Args:
        block: the machine, with the effects that it is believed to have.
        preparation: the recordings with noise and history.
        held_out: the error of a fit on data that it has not used.
        progress: is called with a text at every step.

    Returns:
        The effects, what else was considered, and the fits.
    """
    within = block if isinstance(block, Within) else Within(block)
    # A start far from the recordings may overflow: its χ² is infinite, and it is not taken.
    with computing(), np.errstate(over="ignore", invalid="ignore"):
        progress("fitting the machine")
        base = solve_from([within], _unweighted(preparation))
        named, outcomes = _search(base, progress)
        extended = outcomes[named - 1].solved if named else base
        errors = [held_out(s) if held_out else None for s in (base, extended)]
        return Inside(base, extended, tuple(o.round for o in outcomes), named, *errors)


def _unweighted(preparation: Preparation) -> Preparation:
    """The recordings with white noises of their levels.

    What the model leaves out is far above the noise, and the colour of a rest or of a converter is
    not its own: whitened by that, a fit would follow frequencies at which nothing happens.
    """
    noises = [take.noise for take in preparation.takes]
    if any(noise is None for noise in noises):
        return replace(preparation, takes=tuple(replace(t, noise=None) for t in preparation.takes))
    return preparation.with_noises([noise.uncoloured() for noise in noises if noise])


class _Outcome(NamedTuple):
    """A round, and the fit with its most probable effect, or without where there is none."""

    round: Round
    solved: Solved


def _search(base: Solved, progress: Progress) -> tuple[int, list[_Outcome]]:
    """The rounds, and how many of them name their effect.

    A round that explains less than half is kept for the next one: of two effects of equal size
    neither explains most alone.  All rounds so far name their effects once each effect, taken away,
    would more than double what is left.
    """
    named, outcomes = 0, []
    solved, counts = base, [len(base.block.effects)]  # type: ignore[attr-defined]
    while len(outcomes) < min(named + _TENTATIVE, _MOST_ROUNDS) and not time_is_over():
        before, one = solved, _round(solved, progress)
        outcomes.append(one)
        solved = one.solved
        if not one.round.candidates:
            break
        counts.append(len(solved.block.effects))  # type: ignore[attr-defined]
        others = range(named, len(outcomes) - 1)
        if _dominates(solved.cost, before.cost) and all(
            _dominates(solved.cost, _cost_without(solved, range(*counts[k : k + 2])))
            for k in others
        ):
            named = len(outcomes)
    return named, outcomes


def _dominates(after: float, before: float) -> bool:
    """Whether what an effect explains is more than all that it leaves."""
    return after < (1 - DOMINANT) * before


def _cost_without(solved: Solved, which: range) -> float:
    """χ² of the best fit without some of the effects, by their places."""
    block: Within = solved.block  # type: ignore[assignment]
    for at in reversed(which):
        block = block.without(at)
    descent = begin(block, solved.preparation.problems(), solved.preparation.conditions)
    return descend(descent, _EVALUATIONS).cost


def _round(solved: Solved, progress: Progress) -> _Outcome:
    """One more effect sought about a fit."""
    one_sided = frozenset(name for name, effect in INSIDE.items() if effect.one_sided)
    progress("comparing effects")
    weighed = tuple(weigh(columns_of(solved), one_sided))
    inside = [w for w in weighed if w.best.inside]
    best = max((w.share for w in inside), default=0.0)
    tried = [w for w in inside if w.log_evidence > 0 and w.share > _WORTH * best][:_SHORTLIST]
    outside = max((w.share for w in weighed if not w.best.inside), default=0.0)
    if not tried or (outside > DOMINANT and outside > best):
        return _Outcome(Round(weighed, ()), solved)
    fits = []
    for each in tried:
        progress(f"fitting {each.name}")
        fits.append(_descent(solved, each))
    # After the fits, by the residuals: BIC over the independent samples of the best one.
    least = min(fits, key=lambda fit: fit.cost)
    residual = least.objective.residual(least.position)
    samples = independent_samples(residual, residual != 0)
    scores = [-0.5 * (samples * np.log(f.cost) + f.position.size * np.log(samples)) for f in fits]
    probabilities, order = softmax(scores), np.argsort(scores)[::-1]
    first = order[0]
    progress(f"fitting {tried[first].name} to its end")
    extended = solve_from([_block_at(fits[first])], solved.preparation)
    candidates = tuple(
        Candidate(
            tried[k].name,
            _block_at(fits[k]) if k != first else extended.block,  # type: ignore[arg-type]
            (fits[k].cost if k != first else extended.cost) / solved.cost,
            float(probabilities[k]),
        )
        for k in order
    )
    return _Outcome(Round(weighed, candidates), extended)


def _descent(solved: Solved, weighed: Weighed) -> Descent:
    """The better descent, from several sizes, of the model with one more effect, all free."""
    problems = solved.preparation.problems()

    def descent(factor: float) -> Descent:
        more: Within = solved.block  # type: ignore[assignment]
        for (site, effect), column in zip(weighed.best.inside, weighed.coefficients, strict=True):
            value = getattr(effect, effect.size).value * float(column) * factor
            more = more.at(site, set_values(effect, {effect.size: value}))
        return descend(begin(more, problems, solved.preparation.conditions), _EVALUATIONS)

    # NumPy's handling of overflow is a thread's own, so that there are no threads here.
    return min(map(descent, _STARTS), key=lambda each: each.cost)


def _block_at(descent: Descent) -> Within:
    """The block where a descent is."""
    return descent.objective.at(descent.position).blocks[0]  # type: ignore[return-value]
