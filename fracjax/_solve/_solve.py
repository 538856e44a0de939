"""Solving: from several starts to the optimum of a block on prepared recordings."""

from __future__ import annotations

from dataclasses import replace

import jax
import numpy as np

from .._blocks import AbstractBlock
from .._computing import map_in_threads
from .._parameters import named_parameters, set_values
from .._prepare import Preparation, Problem, layout_of
from ._least_squares import Descent, Objective, begin, descend, simulate
from ._programs import make_room
from ._result import Solved
from ._search import search

_ROUNDS = 20
_FIRST_LOOKS, _LOOKS = 5, 12
_AGREED = 1e-3


def starts_of(block: AbstractBlock, count: int, seed: int) -> list[AbstractBlock]:
    """The block as it stands, and draws of its shapes from their plausible ranges."""
    generator = np.random.default_rng(seed)
    parameters = named_parameters(block)
    names = [n for n, _ in layout_of(block).shapes]
    draws = [
        set_values(block, {n: parameters[n].draw(generator) for n in names})
        for _ in range(count - 1)
    ]
    return [block, *draws]


def solve_from(
    starts: list[AbstractBlock], preparation: Preparation, hopeless: float = np.inf
) -> Solved:
    """A few looks from every start, some more from the better half, then on to convergence with the
    two best and with those that would overtake them at their pace; the best of them finished.

    A fit counts as converged too when twelve looks gain less than a tenth in χ², or less than 1e-4
    of what is left beyond the noise; of a noise that is not known yet, what is left is the measure.
    Above `hopeless` in χ² the first looks are all that is spent.
    """
    make_room()
    problems, asked = preparation.problems(), preparation.conditions
    samples = _counted(problems)

    def begun(start: AbstractBlock) -> Descent:
        return descend(begin(start, problems, asked), _FIRST_LOOKS)

    # One alone first, so that what all have in common is compiled once.
    descents = [begun(starts[0]), *map_in_threads(begun, starts[1:])]
    descents.sort(key=lambda d: d.cost)
    descents = [
        d._replace(converged=d.converged or _has_come_to(descents[:k], d, samples, preparation))
        for k, d in enumerate(descents)
    ]
    gains = np.zeros(len(starts))

    def further(which: list[int]) -> None:
        found = map_in_threads(lambda k: descend(descents[k], _LOOKS), which)
        for k, descent in zip(which, found, strict=True):
            gains[k], descents[k] = descents[k].cost - descent.cost, descent

    half = descents[: -(-len(starts) // 2)]
    further([k for k, d in enumerate(half) if not d.converged and d.cost <= hopeless])
    for _ in range(_ROUNDS):
        costs = np.array([d.cost for d in descents])
        best = descents[int(np.argmin(costs))]
        leading = [] if best.converged else np.argsort(costs)[:2]
        overtaking = np.flatnonzero((gains > 0) & (costs - gains < best.cost))
        todo = [k for k in {*leading, *overtaking} if not descents[k].converged]
        if not todo or not best.cost <= hopeless:
            break
        further(todo)
        least = int(np.argmin([d.cost for d in descents]))
        if best.cost - descents[least].cost < _negligible(best.cost, samples, preparation):
            descents[least] = descents[least]._replace(converged=True)
    best = min(descents, key=lambda d: d.cost)
    return solved_at(
        best.objective,
        best.position,
        preparation,
        converged=best.converged and np.isfinite(best.cost),
        costs=tuple(d.cost for d in descents),
        evaluations=sum(d.evaluations for d in descents),
    )


def _has_come_to(
    better: list[Descent], descent: Descent, samples: int, preparation: Preparation
) -> bool:
    """Whether a descent has come to where a better one is: from there on their ways are one."""

    def residual(d: Descent) -> np.ndarray:
        return d.objective.at(d.position).residual

    least = _tenth_of_noise(descent.cost, samples, preparation)
    close = (d for d in better if descent.cost - d.cost < np.sqrt(samples))
    return any(np.sum((residual(d) - residual(descent)) ** 2) < least for d in close)


def _tenth_of_noise(cost: float, samples: int, preparation: Preparation) -> float:
    """A tenth of the noise's variance, in which χ² is counted; where no noise is known, of what is
    left."""
    unknown = any(take.noise is None for take in preparation.takes)
    return 0.1 * cost / samples if unknown else 0.1


def _negligible(cost: float, samples: int, preparation: Preparation) -> float:
    """A gain in χ² that is none."""
    tenth = _tenth_of_noise(cost, samples, preparation)
    if any(take.noise is None for take in preparation.takes):
        return tenth
    return max(tenth, 1e-4 * (cost - samples))


def solved_at(
    objective: Objective,
    position: np.ndarray,
    preparation: Preparation,
    *,
    converged: bool,
    costs: tuple[float, ...],
    evaluations: int,
) -> Solved:
    """The block at the best position that was found, finished; `costs` (S,) of all starts."""
    problems = preparation.problems()
    point = objective.at(position)
    counts = [p.own.shape[1] for p in problems]
    own = np.split(point.own, np.cumsum(counts)[:-1])
    blocks = jax.tree_util.tree_map(np.asarray, point.blocks)
    simulations = [
        (simulate(fitted, problem) + problem.own @ terms)[: len(take.recording)]
        for take, problem, fitted, terms in zip(
            preparation.takes, problems, blocks, own, strict=True
        )
    ]
    # After the data's rows come those of the priors, which are no part of χ².
    *whitened, _ = np.split(point.residual, np.cumsum([len(p.response) for p in problems]))
    return Solved(
        preparation=preparation,
        block=blocks[0],
        own=tuple(own),
        simulations=tuple(simulations),
        cost=float(np.nan_to_num(sum(r @ r for r in whitened), nan=np.inf, posinf=np.inf)),
        converged=bool(converged),
        start_costs=costs,
        samples=_counted(problems),
        evaluations=evaluations,
        blocks=blocks,
        whitened=tuple(whitened),
        free=len(objective.numbers.labels) + sum(counts),
    )


def _counted(problems: tuple[Problem, ...]) -> int:
    """How many samples count."""
    return int(sum(np.count_nonzero(p.weights) for p in problems))


def fit_block(block: AbstractBlock, preparation: Preparation, starts: int, seed: int) -> Solved:
    """Multi-start fit: on the compressed problem where that is cheaper, the full model having the
    last word; else, or where the two disagree, from every start on the full model."""
    blocks = starts_of(block, starts, seed)
    searched = None if preparation.conditions else search(blocks, preparation.problems())
    if searched is not None:
        solved = solve_from([searched.best], preparation)
        if solved.converged and solved.cost <= searched.cost * (1 + _AGREED):
            costs = np.where(searched.costs > searched.cost, searched.costs, solved.cost)
            return replace(
                solved,
                start_costs=tuple(np.maximum(costs, solved.cost).tolist()),
                evaluations=solved.evaluations + searched.evaluations,
            )
    return solve_from(blocks, preparation)
