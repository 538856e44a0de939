"""Solving: from several starts to the optimum of a block on prepared recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import jax
import numpy as np

from .._blocks import AbstractBlock
from .._computing import map_in_threads, time_is_over
from .._parameters import named_parameters, set_values
from .._prepare import Preparation, Problem, layout_of, position_of
from ._least_squares import Descent, Objective, begin, descend
from ._modes import measured_starts
from ._programs import limit_compiled_programs
from ._result import Solved
from ._search import LEAST_STARTS, search
from ._stack import Row, can_stack, is_alone, solve_rows

_ROUNDS = 20
"""Most rounds of further descents.  Chosen by judgement."""
_FIRST_EVALUATIONS, _EVALUATIONS = 5, 12
"""Evaluations of each start at first, and of a descent in each round.  Chosen by judgement."""
_AGREEMENT = 1e-3
"""Largest relative excess of the full model's χ² over the compressed problem's."""


def starts_of(block: AbstractBlock, count: int, seed: int) -> list[AbstractBlock]:
    """The block as it is, and draws of its shapes from their plausible ranges."""
    generator = np.random.default_rng(seed)
    parameters = named_parameters(block)
    names = [n for n, _ in layout_of(block).shapes]
    draws = [
        set_values(block, {n: parameters[n].draw(generator) for n in names})
        for _ in range(count - 1)
    ]
    return [block, *draws]


def solve_from(
    starts: list[AbstractBlock], preparation: Preparation, aim: float = np.inf
) -> Solved:
    """The best optimum of descents from several starts.

    Each start gets a few evaluations, and the better half some more.  Then the two best descents
    continue to convergence, together with those that would overtake the best at their present rate.

    A descent also counts as converged when twelve evaluations reduce χ² by less than a tenth, or by
    less than 1e-4 of the residual beyond the noise.  If the noise is not known yet, the reference
    is the variance of the residual.  Where only χ² up to an `aim` is of use, a descent ends as soon
    as it would not get there with as large a decrease in each round that remains.
    """
    limit_compiled_programs()
    problems, conditions = preparation.problems(), preparation.conditions
    samples = _counted_samples(problems)

    def first_descent(start: AbstractBlock) -> tuple[float, Descent]:
        first = begin(start, problems, conditions)
        before = first.objective.at(first.position).cost
        return before, descend(first, _FIRST_EVALUATIONS)

    # The first alone, so that what all have in common is compiled once.
    begun = [first_descent(starts[0]), *map_in_threads(first_descent, starts[1:])]
    start = min(before for before, _ in begun)
    descents = sorted((descent for _, descent in begun), key=lambda d: d.cost)
    descents = [
        d._replace(converged=d.converged or _joins_better(descents[:k], d, samples, preparation))
        for k, d in enumerate(descents)
    ]
    decreases = np.zeros(len(starts))

    def reaches(cost: float, decrease: float, rounds: int) -> bool:
        return cost - rounds * decrease <= aim

    def continue_descents(which: list[int]) -> None:
        continued = map_in_threads(lambda k: descend(descents[k], _EVALUATIONS), which)
        for k, descent in zip(which, continued, strict=True):
            decreases[k], descents[k] = descents[k].cost - descent.cost, descent

    half = [] if time_is_over() else descents[: -(-len(starts) // 2)]
    of_use = [k for k, d in enumerate(half) if reaches(d.cost, start - d.cost, _ROUNDS)]
    continue_descents([k for k in of_use if not half[k].converged])
    for rounds in range(_ROUNDS, 0, -1):
        costs = np.array([d.cost for d in descents])
        best = descents[int(np.argmin(costs))]
        leading = [] if best.converged else np.argsort(costs)[:2]
        overtaking = np.flatnonzero((decreases > 0) & (costs - decreases < best.cost))
        unfinished = [k for k in {*leading, *overtaking} if not descents[k].converged]
        unfinished = [k for k in unfinished if reaches(costs[k], decreases[k], rounds)]
        if not unfinished or time_is_over():
            break
        continue_descents(unfinished)
        least = int(np.argmin([d.cost for d in descents]))
        if best.cost - descents[least].cost < _negligible_decrease(best.cost, samples, preparation):
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


def _joins_better(
    better: list[Descent], descent: Descent, samples: int, preparation: Preparation
) -> bool:
    """Whether a descent has reached a better one's position, so that both would continue alike."""

    def residual(d: Descent) -> np.ndarray:
        return d.objective.at(d.position).residual

    least = _tenth_of_noise(descent.cost, samples, preparation)
    close = (d for d in better if descent.cost - d.cost < np.sqrt(samples))
    return any(np.sum((residual(d) - residual(descent)) ** 2) < least for d in close)


def _tenth_of_noise(cost: float, samples: int, preparation: Preparation) -> float:
    """A tenth of the noise's variance, in the unit of χ².

    Where the noise is unknown it is a tenth of the residual's variance.
    """
    unknown = any(take.noise is None for take in preparation.takes)
    return 0.1 * cost / samples if unknown else 0.1


def _negligible_decrease(cost: float, samples: int, preparation: Preparation) -> float:
    """The decrease in χ² below which a descent has converged."""
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
    """The result at the best position (n,) of the shapes; `costs` (S,) are χ² of all starts."""
    problems = preparation.problems()
    point = objective.at(position)
    counts = [p.own.shape[1] for p in problems]
    own = np.split(point.own, np.cumsum(counts)[:-1])
    blocks = jax.tree_util.tree_map(np.asarray, point.blocks)
    simulations = [
        (response + problem.own @ terms)[: len(take.recording)]
        for take, problem, response, terms in zip(
            preparation.takes, problems, point.responses, own, strict=True
        )
    ]
    # The last rows are those of the priors, which are not part of χ².
    *whitened, _ = np.split(point.residual, np.cumsum([len(p.response) for p in problems]))
    return Solved(
        preparation=preparation,
        block=blocks[0],
        own=tuple(own),
        simulations=tuple(simulations),
        cost=float(np.nan_to_num(sum(r @ r for r in whitened), nan=np.inf, posinf=np.inf)),
        converged=bool(converged),
        start_costs=costs,
        samples=_counted_samples(problems),
        evaluations=evaluations,
        blocks=blocks,
        whitened=tuple(whitened),
        free=len(objective.parameters.labels) + sum(counts),
    )


def _counted_samples(problems: tuple[Problem, ...]) -> int:
    """The number of samples that count."""
    return int(sum(np.count_nonzero(p.weights) for p in problems))


def starts_on(
    block: AbstractBlock, preparation: Preparation, count: int, seed: int
) -> list[AbstractBlock]:
    """`starts_of`, the last ones at the modes that the recordings show, where there are any."""
    measured = measured_starts(block, preparation)[: count - 1]
    return [*starts_of(block, count - len(measured), seed), *measured]


def fit_blocks(
    blocks: Sequence[AbstractBlock], preparations: Sequence[Preparation], starts: int, seed: int
) -> list[Solved]:
    """The optimum of each block on its preparation, from several starts.

    Recordings alike are solved together; those for which that is not possible, or takes more time,
    are solved one by one.
    """
    pairs = list(zip(blocks, preparations, strict=True))
    # Recordings of one model share the block, and so its starts.
    positions = {
        key: start_positions(block, starts, seed)
        for key, block in {id(block): block for block in blocks}.items()
        if starts >= LEAST_STARTS and can_stack(block)
    }
    alike = [id(block) in positions and is_alone(preparation) for block, preparation in pairs]
    rows = [
        Row(preparation, block, _with_measured(positions[id(block)], block, preparation))
        for (block, preparation), stackable in zip(pairs, alike, strict=True)
        if stackable
    ]
    solved = iter(solve_rows(rows))
    return [
        (next(solved) if stackable else None) or fit_block(block, preparation, starts, seed)
        for (block, preparation), stackable in zip(pairs, alike, strict=True)
    ]


def solve_again(solved: Sequence[Solved], preparations: Sequence[Preparation]) -> list[Solved]:
    """The optimum of each block on another preparation, starting from where it is."""
    rows = [
        Row(preparation, one.block, position_of(one.block)[None])
        for one, preparation in zip(solved, preparations, strict=True)
        if one.stacked
    ]
    again = iter(solve_rows(rows))
    return [
        (next(again) if one.stacked else None) or solve_from([one.block], preparation)
        for one, preparation in zip(solved, preparations, strict=True)
    ]


def start_positions(block: AbstractBlock, count: int, seed: int) -> np.ndarray:
    """The positions (S, n) of `starts_of`, within the bounds."""
    generator, parameters = np.random.default_rng(seed), named_parameters(block)
    shapes = [parameters[name] for name, _ in layout_of(block).shapes]
    draws = [
        np.concatenate([np.ravel(shape.to_share(shape.draw(generator))) for shape in shapes])
        for _ in range(count - 1)
    ]
    return np.clip([position_of(block), *draws], 0.0, 1.0)


def _with_measured(
    positions: np.ndarray, block: AbstractBlock, preparation: Preparation
) -> np.ndarray:
    """Positions (S, n) of starts, the last ones as in `starts_on`."""
    measured = measured_starts(block, preparation)[: len(positions) - 1]
    kept = positions[: len(positions) - len(measured)]
    return np.clip([*kept, *(position_of(start) for start in measured)], 0.0, 1.0)


def fit_block(block: AbstractBlock, preparation: Preparation, starts: int, seed: int) -> Solved:
    """The optimum of a block from several starts.

    Where that takes less time, the search runs on the compressed problem, and the full model
    confirms its optimum.  Otherwise, or where the two disagree, the full model is fitted from every
    start.
    """
    blocks = starts_on(block, preparation, starts, seed)
    searched = None if preparation.conditions else search(blocks, preparation.problems())
    if searched is not None:
        solved = solve_from([searched.best], preparation)
        if solved.converged and solved.cost <= searched.cost * (1 + _AGREEMENT):
            costs = np.where(searched.costs > searched.cost, searched.costs, solved.cost)
            return replace(
                solved,
                start_costs=tuple(np.maximum(costs, solved.cost).tolist()),
                evaluations=solved.evaluations + searched.evaluations,
            )
    return solve_from(blocks, preparation)
