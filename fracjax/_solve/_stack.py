"""Recordings of one length and step, each fitted by itself, solved together.

All rows of a stack share the chosen shapes (`_interpolation`), so that each differs from the others
by its signals alone: by one QR per row, or per drive where several rows have the same, its problem
is a few numbers (`_compressed`), and all starts of all rows are searched in lock-step
(`_lockstep`).  The responses at the optimum are those of the full model (`_responses`).  A row
that does not converge, or whose compressed problem is less accurate than its noise requires, is not
solved here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import jax
import numpy as np
from scipy.linalg import get_lapack_funcs
from scipy.signal import lfilter

from .._blocks import AbstractBlock
from .._parameters import named_parameters, set_values
from .._prepare import Preparation, Problem, layout_of, with_gains, with_shapes_at
from ._chains import chains_of
from ._compressed import Part, parts_of
from ._elimination import eliminate
from ._interpolation import shapes_at, unit_gains
from ._lockstep import Stack, columns_around, dependences, descend_together
from ._responses import held, respond_all
from ._result import Solved
from ._span import Chosen, all_bounded, span_of_drives

_SPANNED = 1e-9
"""The shapes of a stack end where all others are in the span to this share of their size: far
enough below any sensor's noise, in fewer shapes than to rounding."""
_SHARE_OF_NOISE = 1e-3
"""Largest error of a row's compressed problem [noise standard deviations, over all samples
together]: no parameter is wrong by more than this share of its standard error."""
_SAME_DRIVE = 4
"""From so many rows with the same drive they are a stack of their own.  Chosen by judgement."""
_LARGEST = 2**23
"""Most numbers in the signals of a stack, which limits memory.  Chosen by judgement."""
_SIGNALS = 40
"""Signals that a row is expected to have when stacks are divided.  Chosen by judgement."""


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


def can_stack(block: AbstractBlock, preparation: Preparation) -> bool:
    """Whether a fit of a block to these recordings can be a row of a stack."""
    alone = len(preparation.takes) == 1 and not preparation.conditions
    return alone and can_compress(block)


def solve_rows(rows: Sequence[Row]) -> list[Solved | None]:
    """The optimum of each row; None where it has to be searched for on the full model."""
    results: list[Solved | None] = [None] * len(rows)
    for members in _stacks(rows):
        some = [rows[at] for at in members]
        for at, solved in zip(members, _solve(some), strict=True):
            results[at] = solved
    return results


def _stacks(rows: Sequence[Row]) -> Iterator[list[int]]:
    """The indices of rows that share grid, block and number of starts, those of one drive apart."""
    alike: dict[tuple, dict[bytes, list[int]]] = {}
    keys: dict[int, tuple] = {}
    for at, row in enumerate(rows):
        kind = keys.setdefault(id(row.block), _kind(row.block))
        problem, grid = row.problem, row.problem.grid
        size = (np.size(problem.drive), len(row.preparation.takes[0].recording))
        key = (*kind, *size, grid.history, float(grid.step), problem.own.shape, len(row.positions))
        drives = alike.setdefault(key, {})
        drives.setdefault(np.asarray(problem.drive).tobytes(), []).append(at)
    for drives in alike.values():
        shared = [members for members in drives.values() if len(members) >= _SAME_DRIVE]
        yield from shared
        own = [at for members in drives.values() if len(members) < _SAME_DRIVE for at in members]
        largest = max(_LARGEST // (_SIGNALS * rows[own[0]].problem.drive.size), 1) if own else 1
        yield from (own[at : at + largest] for at in range(0, len(own), largest))


def _kind(block: AbstractBlock) -> tuple:
    """Equal for blocks of one structure, with the same bounds and fixed parameters."""
    layout = layout_of(block)
    size = sum(size for _, size in layout.gains)
    middle = with_gains(with_shapes_at(block, np.full(len(layout.shapes), 0.5)), np.zeros(size))
    leaves, structure = jax.tree_util.tree_flatten(middle)
    return structure, b"".join(np.asarray(leaf).tobytes() for leaf in leaves)


class _Signals(NamedTuple):
    """The signals of a stack.

    Attributes:
        parts: per chain, with matrices (1, J, n) from its coefficients to factors of the signals.
        values: (D, n, N), one for each row, or one for all.
    """

    parts: tuple[Part, ...]
    values: np.ndarray

    def of(self, row: int) -> np.ndarray:
        """The signals (n, N) of a row."""
        return self.values[row if len(self.values) > 1 else 0]


def _signals(block: AbstractBlock, problems: Sequence[Problem], samples: int) -> _Signals | None:
    """The signals of a stack; None where too many would be needed."""
    chains = chains_of(block)
    assert chains is not None  # can_stack has checked it
    drives = [np.asarray(problem.drive) for problem in problems]
    if all(np.array_equal(drive, drives[0]) for drive in drives[1:]):
        drives = drives[:1]
    span = span_of_drives(chains, np.stack(drives, axis=1), problems[0], _SPANNED)
    if span is None:
        return None
    chosen, values = span
    return _Signals(_to_signals(chosen, values.shape[1]), values[:, :, :samples])


def _to_signals(chosen: Chosen, count: int) -> tuple[Part, ...]:
    """The chains' coefficients as factors of n = `count` signals."""
    return tuple(
        Part(part.before, part.after, np.asarray(part.matrix)[None])
        for part in parts_of(chosen, np.eye(count))
    )


def _triangles(problems: Sequence[Problem], signals: _Signals, samples: int) -> np.ndarray:
    """The triangles (R, K, K) of whitened own terms, signals and response of each row.

    Rows that share drive and whitening share one QR, followed by a projection each.
    """
    geqrf, orgqr = get_lapack_funcs(("geqrf", "orgqr"), dtype=np.float64)
    groups: dict[tuple, list[int]] = {}
    for row, problem in enumerate(problems):
        filters = (np.asarray(problem.weights).tobytes(), np.asarray(problem.whitening).tobytes())
        groups.setdefault(filters if len(signals.values) == 1 else (row,), []).append(row)
    first = problems[0]
    count = first.own.shape[1] + signals.values.shape[1] + 1
    triangles = np.zeros((len(problems), count, count))
    for rows in groups.values():
        problem = problems[rows[0]]
        white = whitener(problem, samples)
        responses = [np.asarray(problems[row].response)[:samples] for row in rows]
        terms = [np.asarray(problem.own)[:samples].T, signals.of(rows[0]), np.stack(responses)]
        columns = white(np.concatenate(terms))
        if len(rows) == 1:
            triangles[rows[0]] = np.triu(geqrf(columns.T, overwrite_a=1)[0][:count])
            continue
        basis, scales, *_ = geqrf(columns[: count - 1].T)
        triangle = np.triu(basis[: count - 1])
        basis = orgqr(basis, scales, overwrite_a=1)[0]
        along = basis.T @ columns[count - 1 :].T
        outside = np.linalg.norm(columns[count - 1 :].T - basis @ along, axis=0)
        triangles[rows, : count - 1, : count - 1] = triangle
        triangles[rows, : count - 1, -1], triangles[rows, -1, -1] = along.T, outside
    return triangles


def whitener(problem: Problem, samples: int) -> Callable[[np.ndarray], np.ndarray]:
    """The whitening of signals (k, N) in rows, as `Problem.whiten` does it to columns (L, k)."""
    taps = np.asarray(problem.whitening)
    taps, weights = taps[: 1 + np.flatnonzero(taps)[-1]], np.asarray(problem.weights)[:samples]

    def white(signals: np.ndarray) -> np.ndarray:
        if taps.size == 1:
            return signals * (taps[0] * weights)
        return np.asarray(lfilter(taps, 1.0, signals, axis=-1)) * weights

    return white


def _solve(rows: Sequence[Row]) -> list[Solved | None]:
    """The optimum of each row of one stack; None where it needs the full model."""
    block, problems = rows[0].block, [row.problem for row in rows]
    samples, own = len(rows[0].preparation.takes[0].recording), problems[0].own.shape[1]
    signals = _signals(block, problems, samples)
    if signals is None:
        return [None] * len(rows)
    triangles = _triangles(problems, signals, samples)
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
    return _confirm(rows, signals, optima)


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


def _confirm(rows: Sequence[Row], signals: _Signals, optima: _Optima) -> list[Solved | None]:
    """The rows at their optima by the full model; None where the compressed problem is another."""
    block, problems = rows[0].block, [row.problem for row in rows]
    samples = len(rows[0].preparation.takes[0].recording)
    blocks = [_block_at(row.block, p, g)
              for row, p, g in zip(rows, optima.positions, optima.gains, strict=True)]  # fmt: skip
    responses = respond_all(blocks, problems)
    constants = _held_by_gain(block, optima.positions, problems)
    results: list[Solved | None] = []
    for at, (row, problem) in enumerate(zip(rows, problems, strict=True)):
        signal, white = signals.of(at), whitener(problem, samples)
        own_terms, response = np.asarray(problem.own)[:samples].T, responses[at][:samples]
        target, error, *white_own = white(
            np.stack([problem.response[:samples] - response,
                      response - optima.mixed[at] @ signal, *own_terms])
        )  # fmt: skip
        own, residual, basis = eliminate(np.stack(white_own, axis=1), target)
        error = float(np.linalg.norm(error - basis @ (basis.T @ error)))
        cost, counted = float(residual @ residual), int(np.count_nonzero(problem.weights))
        # The noise may be unknown as yet, so that the error is compared with the residual.
        accurate = error <= _SHARE_OF_NOISE * np.sqrt(cost / counted)
        if not (accurate and optima.converged[at]):
            results.append(None)
            continue
        derivative = optima.derivative[at] @ signal
        derivative[-constants.shape[1] :] += constants[at][:, None]
        sensitivity = np.zeros((len(problem.response), len(derivative) + len(white_own)))
        sensitivity[:samples] = np.concatenate([white(derivative), white_own]).T
        results.append(
            Solved(
                preparation=row.preparation,
                block=blocks[at],
                own=(own,),
                simulations=(response + own @ own_terms,),
                cost=cost,
                converged=True,
                start_costs=tuple(np.maximum(optima.costs[at], cost).tolist()),
                samples=counted,
                evaluations=int(optima.evaluations[at]),
                blocks=(blocks[at],),
                whitened=(np.pad(residual, (0, len(problem.response) - samples)),),
                free=sensitivity.shape[1],
                derivative=sensitivity,
            )
        )
    return results


def _block_at(block: AbstractBlock, position: np.ndarray, gains: np.ndarray) -> AbstractBlock:
    """A block with its shapes at a position (n,) and its gains (g,)."""
    return with_gains(with_shapes_at(block, position), gains)


def _slopes(block: AbstractBlock, positions: np.ndarray) -> np.ndarray:
    """The derivative (R, n, 1) of each shape's value with respect to its position (R, n)."""
    layout = layout_of(block)
    parameters = named_parameters(set_values(block, shapes_at(block, layout, positions)))
    return np.stack([parameters[name].slope() for name, _ in layout.shapes], axis=1)


def _held_by_gain(
    block: AbstractBlock, positions: np.ndarray, problems: Sequence[Problem]
) -> np.ndarray:
    """What the constant part of each row's drive adds to the derivative by each gain (R, g)."""
    layout, grid = layout_of(block), problems[0].grid
    drives = np.stack([np.asarray(problem.drive) for problem in problems], axis=1)
    there = set_values(block, shapes_at(block, layout, positions))
    units = [held(set_values(there, gains), drives, grid) for gains in unit_gains(layout)]
    return np.concatenate([unit - units[0] for unit in units[1:]], axis=1)
