"""Recordings of one padded length and step, each fitted by itself, solved together.

All rows of a stack share the chosen shapes (`_interpolation`), so that each differs from the others
by its signals alone: by one QR per row, or per drive where several rows have the same, its problem
is a few numbers (`_compressed`), and all starts of all rows are searched in lock-step
(`_lockstep`).  Some of the responses at the optimum are compared with the full model
(`_responses`).  A row that does not converge, or whose compressed problem is less accurate than its
noise requires, is not solved here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs

from .._blocks import AbstractBlock
from .._parameters import named_parameters, set_values
from .._prepare import Preparation, Problem, layout_of
from ._chains import chains_of
from ._compressed import Part
from ._elimination import eliminate
from ._interpolation import shapes_at, unit_gains
from ._lockstep import Stack, columns_around, dependences, descend_together
from ._responses import held, respond_all, stacked
from ._result import Solved
from ._signals import LARGEST, Signals, kind_of, signals_of
from ._span import all_bounded

_SHARE_OF_NOISE = 1e-3
"""Largest error of a row's compressed problem [noise standard deviations, over all samples
together]: no parameter is wrong by more than this share of its standard error."""
_CHECKED = 4
"""Rows of a stack whose responses are compared with the full model.  Chosen by judgement."""
_SAME_DRIVE = 4
"""From so many rows with the same drive they are a stack of their own.  Chosen by judgement."""
_BETWEEN = 16
"""Signals that drive a chain's second block, as expected when stacks are divided.  Chosen by
judgement."""
_PANEL = 8
"""Columns that a QR takes at once, which of thirty takes two thirds of LAPACK's usual time."""


class Row(NamedTuple):
    """A recording to be solved in a stack.

    Attributes:
        preparation: of this recording alone.
        block: the block with its bounds and fixed parameters.
        positions: (S, n) the starts' positions.
    """

    preparation: Preparation
    block: AbstractBlock
    positions: np.ndarray

    @property
    def problem(self) -> Problem:
        """The recording's problem."""
        return self.preparation.problems()[0]


def can_compress(block: AbstractBlock) -> bool:
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
        some = [rows[at] for at in members]
        for at, solved in zip(members, _solve(some), strict=True):
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
        followed = own and any(chain.after for chain in chains_of(blocks[own[0]]) or ())
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


def _triangles(problems: Sequence[Problem], signals: Signals) -> np.ndarray:
    """The triangles (R, K, K) of whitened own terms, signals and response of each row.

    Rows that share drive and whitening share one QR, followed by a projection each.
    """
    (geqrt,) = get_lapack_funcs(("geqrt",), dtype=np.float64)
    groups: dict[tuple, list[int]] = {}
    for row, problem in enumerate(problems):
        filters = (np.asarray(problem.weights).tobytes(), np.asarray(problem.whitening).tobytes())
        groups.setdefault(filters if signals.shared else (row,), []).append(row)
    first = problems[0]
    count = first.own.shape[1] + signals.total + 1
    triangles = np.zeros((len(problems), count, count))
    for rows in groups.values():
        problem = problems[rows[0]]
        own = problem.own.shape[1]
        terms = np.empty((own + signals.total + len(rows), len(problem.response)))
        terms[:own] = np.asarray(problem.own).T
        signals.fill(rows[0], terms[own : own + signals.total])
        for response, row in zip(terms[own + signals.total :], rows, strict=True):
            response[:] = problems[row].response
        columns = problem.whiten(terms.T)
        if len(rows) == 1:
            panel = min(_PANEL, *columns.shape)
            upper = np.triu(geqrt(panel, columns, overwrite_a=1)[0][:count])
            triangles[rows[0], : len(upper)] = upper  # fewer rows where samples are fewer
            continue
        basis, triangle = np.linalg.qr(columns[:, : count - 1])
        along = basis.T @ columns[:, count - 1 :]
        outside = np.linalg.norm(columns[:, count - 1 :] - basis @ along, axis=0)
        size = len(triangle)
        triangles[rows, :size, : count - 1] = triangle
        triangles[rows, :size, -1], triangles[rows, -1, -1] = along.T, outside
    return triangles


def _solve(rows: Sequence[Row]) -> list[Solved | None]:
    """The optimum of each row of one stack; None where it needs the full model."""
    block, problems = rows[0].block, [row.problem for row in rows]
    own, signals = problems[0].own.shape[1], signals_of(block, problems)
    if signals is None:
        return [None] * len(rows)
    triangles = _triangles(problems, signals)
    columns = triangles[:, own:, own:-1].swapaxes(1, 2)  # (R, n, m)
    stack = Stack(
        tuple(Part(p.before, p.after, p.matrix @ columns) for p in signals.parts),
        triangles[:, own:, -1],
        problems[0].grid,
    )
    starts, every = rows[0].positions.shape[0], np.arange(len(rows))
    arrival = descend_together(
        block, [stack], np.repeat(every, starts), np.concatenate([row.positions for row in rows])
    )
    costs, evaluations = arrival.costs.reshape(-1, starts), arrival.evaluations.reshape(-1, starts)
    best = every * starts + np.nan_to_num(costs, nan=np.inf).argmin(axis=1)
    positions, converged = arrival.positions[best], arrival.converged[best]
    # From here on by factors of the signals (n,) instead of coordinates (m,).
    factors = Stack(signals.parts, np.zeros((1, columns.shape[1])), stack.grid)
    depends = dependences(block, stack)
    here, moved = columns_around(block, depends, factors, every, positions)
    gains = eliminate(
        np.swapaxes(here[:, 1:] @ columns, 1, 2), stack.response - (here[:, :1] @ columns)[:, 0]
    )[0]
    with_one = np.pad(gains, ((0, 0), (1, 0)), constant_values=1.0)
    by_shapes = np.einsum("srgn,rg->rsn", moved, with_one) / _slopes(block, positions)
    optima = _Optima(
        positions=positions,
        gains=gains,
        converged=converged,
        mixed=np.einsum("rgn,rg->rn", here, with_one),
        derivative=np.concatenate([by_shapes, here[:, 1:]], axis=1),
        costs=costs,
        evaluations=evaluations.sum(axis=1),
    )
    return _confirm(rows, signals, triangles, optima)


class _Optima(NamedTuple):
    """The optima of a stack's rows.

    Attributes:
        positions: (R, n) of the shapes.
        gains: (R, g) in their units.
        converged: (R,) whether the search has converged.
        mixed: (R, n) the responses as factors of the signals.
        derivative: (R, p, n) their derivatives by each parameter, as factors of the signals.
        costs: (R, S) χ² where each start ended.
        evaluations: (R,) how often the objective was computed.
    """

    positions: np.ndarray
    gains: np.ndarray
    converged: np.ndarray
    mixed: np.ndarray
    derivative: np.ndarray
    costs: np.ndarray
    evaluations: np.ndarray


def _confirm(
    rows: Sequence[Row], signals: Signals, triangles: np.ndarray, optima: _Optima
) -> list[Solved | None]:
    """The rows at their optima; None where the compressed problem is another than the full one."""
    problems = [row.problem for row in rows]
    blocks = _blocks_at(rows[0].block, optima)
    constants = _held_by_gain(rows[0].block, optima.positions, problems)
    constant = constants[:, 0] + np.sum(constants[:, 1:] * optima.gains, axis=1)
    shapes = optima.positions.shape[1]
    by_parameter = np.pad(constants[:, 1:], [(0, 0), (shapes, 0)])
    responses = signals.respond(optima.mixed) + constant[:, None]
    # In coordinates, where the first own term is the constant.
    own = problems[0].own.shape[1]
    terms, of_signals = triangles[:, :, :own], triangles[:, :, own:-1]
    inside = np.einsum("rkn,rn->rk", of_signals, optima.mixed) + terms[:, :, 0] * constant[:, None]
    own_terms = eliminate(terms, triangles[:, :, -1] - inside)[0]
    derivatives = of_signals @ np.swapaxes(optima.derivative, 1, 2)
    derivatives += terms[:, :, :1] * by_parameter[:, None]
    every = np.concatenate([derivatives, terms], axis=2)
    derivative_triangles = np.asarray(np.linalg.qr(every, mode="r"))
    sizes = np.linalg.norm(inside[:, own:], axis=1)
    simulations = [
        response + problem.own @ terms
        for response, problem, terms in zip(responses, problems, own_terms, strict=True)
    ]
    residuals = [
        problem.whiten(problem.response - simulation)
        for problem, simulation in zip(problems, simulations, strict=True)
    ]
    costs = np.array([float(residual @ residual) for residual in residuals])
    counted = np.array([int(np.count_nonzero(problem.weights)) for problem in problems])
    # The noise may be unknown as yet, so that the error is compared with the residual.
    tolerated = _SHARE_OF_NOISE * np.sqrt(costs / counted) / (sizes + 1e-300)
    accurate = _are_accurate(blocks, problems, responses, tolerated)
    results: list[Solved | None] = []
    for at, row in enumerate(rows):
        if not (accurate[at] and optima.converged[at]):
            results.append(None)
            continue
        results.append(
            Solved(
                preparation=row.preparation,
                block=blocks[at],
                own=(own_terms[at],),
                simulations=(simulations[at][: len(row.preparation.takes[0].recording)],),
                cost=float(costs[at]),
                converged=True,
                start_costs=tuple(np.maximum(optima.costs[at], costs[at]).tolist()),
                samples=int(counted[at]),
                evaluations=int(optima.evaluations[at]),
                blocks=(blocks[at],),
                whitened=(residuals[at],),
                free=derivative_triangles.shape[2],
                derivative=partial(
                    _derivative, signals, at, optima.derivative[at], by_parameter[at]
                ),
                triangle=derivative_triangles[at],
            )
        )
    return results


def _derivative(
    signals: Signals, row: int, factors: np.ndarray, constants: np.ndarray
) -> np.ndarray:
    """The derivative (p, L) of a row's response, by factors (p, n) of its signals and constants."""
    return signals.mix(slice(row, row + 1), factors[None])[0] + constants[:, None]


def _blocks_at(block: AbstractBlock, optima: _Optima) -> list[AbstractBlock]:
    """The block at each row's optimum."""
    layout = layout_of(block)
    gains = {n: g[:, None] for (n, _), g in zip(layout.gains, optima.gains.T, strict=True)}
    values = shapes_at(block, layout, optima.positions) | gains
    shapes = {name: np.shape(p.value) for name, p in named_parameters(block).items()}
    return [
        set_values(block, {name: v[row].reshape(shapes[name]) for name, v in values.items()})
        for row in range(len(optima.gains))
    ]


def _are_accurate(
    blocks: Sequence[AbstractBlock],
    problems: Sequence[Problem],
    responses: np.ndarray,
    tolerated: np.ndarray,
) -> np.ndarray:
    """Whether the responses (R, L) of rows are those of the full model to the error that each
    tolerates (R,), as a share.

    Some of them are compared; where one differs by more than a row tolerates, all are.
    """
    every = np.arange(len(blocks))
    some = every[:: -(-len(blocks) // _CHECKED)]
    largest = _errors(some, blocks, problems, responses).max()
    if np.all(largest <= tolerated):
        return np.ones(len(blocks), bool)
    return _errors(every, blocks, problems, responses) <= tolerated


def _errors(
    which: np.ndarray,
    blocks: Sequence[AbstractBlock],
    problems: Sequence[Problem],
    responses: np.ndarray,
) -> np.ndarray:
    """The relative errors of some responses (L,), by the full model."""
    errors = []
    exact = respond_all([blocks[at] for at in which], [problems[at] for at in which])
    for at, of_full_model in zip(which, exact, strict=True):
        pair = np.stack([of_full_model - responses[at], responses[at]])
        white = problems[at].whiten(np.concatenate([pair, problems[at].own.T]).T)
        basis = eliminate(white[:, 2:], white[:, 0])[2]
        error, size = np.linalg.norm(white[:, :2] - basis @ (basis.T @ white[:, :2]), axis=0)
        errors.append(float(error) / (float(size) + 1e-300))
    return np.array(errors)


def _slopes(block: AbstractBlock, positions: np.ndarray) -> np.ndarray:
    """The derivative (R, n, 1) of each shape's value with respect to its position (R, n)."""
    layout = layout_of(block)
    parameters = named_parameters(set_values(block, shapes_at(block, layout, positions)))
    return np.stack([parameters[name].slope() for name, _ in layout.shapes], axis=1)


def _held_by_gain(
    block: AbstractBlock, positions: np.ndarray, problems: Sequence[Problem]
) -> np.ndarray:
    """What the constant part of each row's drive adds to the responses (R, 1 + g): with gains of
    zero, and by each gain.
    """
    layout, grid = layout_of(block), problems[0].grid
    drives = np.stack([np.asarray(problem.drive) for problem in problems], axis=1)
    there = set_values(block, shapes_at(block, layout, positions))
    units = [held(set_values(there, gains), drives, grid) for gains in unit_gains(layout)]
    return np.concatenate([units[0], *(unit - units[0] for unit in units[1:])], axis=1)
