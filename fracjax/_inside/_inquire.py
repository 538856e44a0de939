"""From a machine and recordings to the physics that its model leaves out inside its dynamics."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import softmax

from .._blocks import INSIDE, AbstractMachine, Within
from .._computing import computing, map_in_threads, time_is_over
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
_MOST_ROUNDS = 3
"""Effects that are sought one after the other at most."""
_STARTS = (1.0, 0.3)
"""Starts of an effect's size, over the one that the columns say: a large effect is overstated to
first order."""

_EVALUATIONS = 15
"""Evaluations of each of them, before the best is fitted to its end; chosen by judgement."""

HeldOut = Callable[[Solved], float]


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
        held_out: the rms error of a fit on data that it has not used [response].
        progress: is called with a text at every step.

    Returns:
        The effects, what else was considered, and the fits.
    """
    within = block if isinstance(block, Within) else Within(block)
    with computing():
        progress("fitting the machine")
        base = solve_from([within], preparation)
        rounds: list[Round] = []
        extended = base
        while len(rounds) < _MOST_ROUNDS and not time_is_over():
            one, extended = _round(extended, progress)
            rounds.append(one)
            if not one.named:
                break
        errors = [held_out(s) if held_out else None for s in (base, extended)]
        return Inside(base, extended, tuple(rounds), *errors)


def _round(solved: Solved, progress: Progress) -> tuple[Round, Solved]:
    """One more effect sought about a fit, and the fit with it, or the same where none is named."""
    one_sided = frozenset(name for name, effect in INSIDE.items() if effect.one_sided)
    weighed = weigh(columns_of(solved), one_sided)
    inside = [w for w in weighed if w.best.block is not None]
    best = max((w.share for w in inside), default=0.0)
    tried = [w for w in inside if w.share > _WORTH * best][:_SHORTLIST]
    outside = max((w.share for w in weighed if w.best.block is None), default=0.0)
    if not tried or (outside > DOMINANT and outside > best):
        return Round(tuple(weighed), (), False), solved
    fits = []
    for each in tried:
        progress(f"fitting {each.name}")
        fits.append(_descent(solved, each))
    # After the fits, by the residuals: BIC over the independent samples of the best one.
    least = min(fits, key=lambda fit: fit.cost)
    residual = least.objective.residual(least.position)
    samples = independent_samples(residual, residual != 0)
    free = [fit.position.size for fit in fits]
    scores = [
        -0.5 * samples * np.log(fit.cost) - 0.5 * count * np.log(samples)
        for fit, count in zip(fits, free, strict=True)
    ]
    order = np.argsort(scores)[::-1]
    probabilities = softmax(scores)
    best_fit = fits[order[0]]
    progress(f"fitting {tried[order[0]].name} to its end")
    extended = solve_from([_block_at(best_fit)], solved.preparation)
    candidates = tuple(
        Candidate(
            name=tried[k].name,
            block=extended.block if k == order[0] else _block_at(fits[k]),  # type: ignore[arg-type]
            left=(extended.cost if k == order[0] else fits[k].cost) / solved.cost,
            probability=float(probabilities[k]),
        )
        for k in order
    )
    named = candidates[0].left < 1 - DOMINANT
    return Round(tuple(weighed), candidates, named), extended if named else solved


def _descent(solved: Solved, weighed: Weighed) -> Descent:
    """The better descent, from several sizes, of the model with one more effect, all free."""
    effect, column = weighed.best.block, float(weighed.coefficients[0])
    assert effect is not None
    size, problems = effect.size, solved.preparation.problems()

    def descent(factor: float) -> Descent:
        value = getattr(effect, size).value * column * factor
        block = solved.block.at(weighed.best.site, set_values(effect, {size: value}))  # type: ignore[attr-defined]
        return descend(begin(block, problems, solved.preparation.conditions), _EVALUATIONS)

    return min(map_in_threads(descent, _STARTS), key=lambda each: each.cost)


def _block_at(descent: Descent) -> Within:
    """The block where a descent is."""
    return descent.objective.at(descent.position).blocks[0]  # type: ignore[return-value]
