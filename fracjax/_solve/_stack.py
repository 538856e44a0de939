"""Recordings of one padded length and step, each fitted by itself, solved together.

All starts of all rows are searched in lock-step (`_lockstep`).  Where a few signals span all
responses of a block, its problems are combinations of them (`_by_signals`).  Where many would be
needed, the search is on problems that say roughly the same, by rough signals or on thinned
recordings, and from its end each row descends on the full model (`_direct`).  A row that does not
converge is not solved here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from .._blocks import AbstractBlock
from .._parameters import named_parameters
from .._prepare import Preparation, Problem, layout_of, top_frequency
from ._by_signals import optima_by_signals
from ._chains import chains_of, oscillates
from ._direct import Direct, thinned
from ._lockstep import descend_together
from ._responses import held, respond_all, stacked
from ._result import Solved
from ._row import BestArrivals, Row, descend_rows, solved_rows
from ._signals import LARGEST, kind_of, signals_of, stack_of, triangles_of
from ._span import all_bounded

_SAME_DRIVE = 4
"""From so many rows with the same drive they are a stack of their own.  Chosen by judgement."""
_BETWEEN = 16
"""Signals that drive a chain's second block, as expected when stacks are divided.  Chosen by
judgement."""
_PER_PERIOD = 8
"""Samples per period of the drive's top frequency in a thinned recording.  Chosen by judgement."""
_LEAST_THINNED = 256
"""Fewest samples of a thinned recording.  Chosen by judgement."""
_STEPS_A_ROUND, _SEARCHED = 4, 1e-3
"""On thinned recordings: steps after which half of the starts go on, and the relative decrease of
χ² that a last step is expected to bring.  Chosen by judgement."""


def can_stack(block: AbstractBlock) -> bool:
    """Whether a block is one that stacks are solved for: chains with bounded shapes."""
    chains = chains_of(block)
    single = all(np.size(p.value) == 1 for p in named_parameters(block).values())
    return bool(single and layout_of(block).shapes and chains and all_bounded(chains))


def is_alone(preparation: Preparation) -> bool:
    """Whether a fit is to one recording without conditions, as the rows of a stack are."""
    return len(preparation.takes) == 1 and not preparation.conditions


def solve_rows(rows: Sequence[Row]) -> list[Solved | None]:
    """The optimum of each row; None where it has to be searched for on the full model."""
    results: list[Solved | None] = [None] * len(rows)
    for members, _ in _groups([row.block for row in rows], [row.problem for row in rows]):
        for at, solved in zip(members, _solve([rows[at] for at in members]), strict=True):
            results[at] = solved
    return results


def _groups(
    blocks: Sequence[AbstractBlock], problems: Sequence[Problem]
) -> Iterator[tuple[list[int], bool]]:
    """The indices of rows that share grid and block, and whether all of them have one drive."""
    alike: dict[tuple, dict[bytes, list[int]]] = {}
    kinds: dict[int, tuple] = {}
    for at, (block, problem) in enumerate(zip(blocks, problems, strict=True)):
        if id(block) not in kinds:
            kinds[id(block)] = kind_of(block)
        drive, grid = np.asarray(problem.drive), problem.grid
        key = *kinds[id(block)], drive.size, problem.own.shape, grid.history, float(grid.step)
        drives = alike.setdefault(key, {})
        drives.setdefault(drive.tobytes(), []).append(at)
    for drives in alike.values():
        shared = [members for members in drives.values() if len(members) >= _SAME_DRIVE]
        yield from ((members, True) for members in shared)
        own = [at for members in drives.values() if len(members) < _SAME_DRIVE for at in members]
        followed = own and _is_followed(blocks[own[0]])
        each = problems[own[0]].drive.size * (_BETWEEN if followed else 1) if own else 1
        largest = max(LARGEST // each, 1)
        yield from ((own[at : at + largest], False) for at in range(0, len(own), largest))


def respond_rows(blocks: Sequence[AbstractBlock], problems: Sequence[Problem]) -> list[np.ndarray]:
    """Each block's response (L,) to the drive of its problem, to the error of a short circle.

    Of many with one drive they are by the signals that span them all, to `_signals._SPANNED`.
    """
    responses: list[np.ndarray] = [np.zeros(0)] * len(blocks)
    for members, shared in _groups(blocks, problems):
        some_blocks, some = [blocks[at] for at in members], [problems[at] for at in members]
        signals = signals_of(some_blocks[0], some) if shared else None
        if signals is None:
            some_responses = respond_all(some_blocks, some, short=True)
        else:
            block, drives = stacked(some_blocks), np.stack([p.drive for p in some]).T
            chains = zip(signals.parts, chains_of(block) or (), strict=True)
            factors = np.sum([part(chain, some[0].grid)[0] for part, chain in chains], axis=0)
            factors = np.broadcast_to(factors, (len(members), signals.total))
            some_responses = signals.respond(factors) + held(block, drives, some[0].grid)
        for at, response in zip(members, some_responses, strict=True):
            responses[at] = response
    return responses


def _solve(rows: Sequence[Row]) -> list[Solved | None]:
    """The optimum of each row of one stack; None where it was not found."""
    block, problems = rows[0].block, [row.problem for row in rows]
    if not (_is_followed(block) or _has_mode(block)):
        signals = signals_of(block, problems)
        if signals is not None:
            return solved_rows(rows, optima_by_signals(rows, signals))
    starts, direct = np.stack([row.positions for row in rows]), Direct.of(problems)
    if starts.shape[1] == 1:
        return solved_rows(rows, direct.optima(block, descend_rows(block, direct, starts)))
    searched = _search(rows, starts)
    arrivals = descend_rows(block, direct, searched.positions[:, None])
    evaluations = searched.evaluations + arrivals.evaluations
    arrivals = arrivals._replace(costs=searched.costs, evaluations=evaluations)
    return solved_rows(rows, direct.optima(block, arrivals))


def _is_followed(block: AbstractBlock) -> bool:
    """Whether a chain has a second block, whose signals are as many as two blocks' together."""
    return any(chain.after is not None for chain in chains_of(block) or ())


def _has_mode(block: AbstractBlock) -> bool:
    """Whether a block oscillates, which makes its signals as many as the frequencies that a
    recording tells apart.
    """
    linear = [each for chain in chains_of(block) or () for each in (chain.before, chain.after)]
    return any(each is not None and oscillates(each) for each in linear)


def _search(rows: Sequence[Row], starts: np.ndarray) -> BestArrivals:
    """Where the descents of rows from starts (R, S, n) end on smaller problems."""
    block, problems = rows[0].block, [row.problem for row in rows]
    signals = None if _has_mode(block) else signals_of(block, problems, roughly=True)
    if signals is not None:
        triangles, own = triangles_of(problems, signals), problems[0].own.shape[1]
        return descend_rows(block, stack_of(signals, triangles, own, problems[0].grid), starts)
    every = min(_thinning(row) for row in rows)
    arrivals = _halving_search(block, Direct.of([thinned(p, every) for p in problems]), starts)
    return arrivals._replace(costs=every * arrivals.costs)


def _halving_search(block: AbstractBlock, problems: Direct, starts: np.ndarray) -> BestArrivals:
    """The descents of rows from starts (R, S, n), of which the better half goes on after a few
    steps, until one is left.

    Source: Jamieson & Talwalkar, AISTATS 51 (2016) 240.
    """
    rows, count, _ = starts.shape
    costs, evaluations = np.full((rows, count), np.inf), np.zeros(rows, int)
    remaining = np.tile(np.arange(count), (rows, 1))
    while remaining.shape[1] > 1:
        size = remaining.shape[1]
        owners = np.repeat(np.arange(rows), size)
        flat = starts.reshape(rows * size, -1)
        arrival = descend_together(block, [problems], owners, flat, _STEPS_A_ROUND, _SEARCHED)
        ended = np.nan_to_num(arrival.costs.reshape(rows, size), nan=np.inf)
        np.put_along_axis(costs, remaining, ended, axis=1)
        evaluations += arrival.evaluations.reshape(rows, size).sum(axis=1)
        best = np.argsort(ended, axis=1)[:, : size // 2]
        remaining = np.take_along_axis(remaining, best, axis=1)
        positions = arrival.positions.reshape(rows, size, -1)
        starts = np.take_along_axis(positions, best[:, :, None], axis=1)
    arrivals = descend_rows(block, problems, starts, negligible=_SEARCHED)
    np.put_along_axis(costs, remaining, arrivals.costs, axis=1)
    return arrivals._replace(costs=costs, evaluations=evaluations + arrivals.evaluations)


def _thinning(row: Row) -> int:
    """Of how many samples one suffices for a search."""
    (take,), problem = row.preparation.takes, row.problem
    if problem.oversampling > 1 or problem.grid.history == "periodic":
        return 1
    per_period = 1 / (top_frequency(take.recording) * take.recording.dt)
    return max(int(min(per_period / _PER_PERIOD, len(problem.drive) / _LEAST_THINNED)), 1)
