"""Levenberg–Marquardt on many problems at once, in lock-step.

    (JᵀJ + λ diag JᵀJ) step = -Jᵀr,     J = (1 - QQᵀ) ∂/∂θ (Φ c + y_0)

over the positions of the shapes, gains eliminated, with Kaufman's derivative and steps that end at
the bounds.  A problem is a row, compressed (`Stack`) or in samples (`_direct`), and every start of
every row is a point.  Points are computed together in NumPy arrays, and those that have arrived are
left out.  Derivatives are differences: on a problem of fifty rows, analytic in its shapes to 1e-11,
they take less time than a program takes to compile, which was 1 s for the model and its derivative
and 5 s for optimistix's solver.  A chain is computed only for the parameters that it depends on.

Sources: Marquardt, J. SIAM 11 (1963) 431; Kaufman, BIT 15 (1975) 49.
"""

from __future__ import annotations

import abc
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import numpy as np

from .._blocks import AbstractBlock
from .._operators import Grid
from .._parameters import set_values
from .._prepare import Layout, layout_of
from ._chains import Chain, chains_of, transfer
from ._compressed import CompressedProblem, Part
from ._elimination import eliminate
from ._interpolation import shapes_at

_STEPS = 60
"""Most steps of a start.  Chosen by judgement."""
NEGLIGIBLE = 1e-7
"""Relative decrease of χ² that a last step is expected to bring, which then ends the descent: it is
a thirtieth of a standard error at 10⁴ samples, and far less is left after it."""
_LAST_DAMPING = 1e-10
"""λ of a last step, which shortens no direction that the data determine."""
_RELATIVE, _CLOSE = 1e-8, 1e-7
"""Relative decrease of χ², and step of the positions, below which a start has converged."""
_DIFFERENCE = 1e-4
"""Step of the central differences, whose error of order 1e-8 is near that of rounding."""
_FIRST_DAMPING = 1e-2
"""The first λ.  Chosen by judgement."""
_WITHIN = np.array([0.5 + 0.1j])
"""A point ζ within the circles on which transfer functions are computed."""


class Dependence(NamedTuple):
    """What one chain of a block depends on.

    Attributes:
        shapes: the indices of its shapes among the block's.
        gains: the indices of its gains among the block's.
        constant: whether it responds where all its gains are zero.

    The response is linear in the gains: `units` are zero gains, where it responds to them, and each
    gain in turn 1.
    """

    shapes: tuple[int, ...]
    gains: tuple[int, ...]
    constant: bool

    @property
    def units(self) -> int:
        """The number of responses from which that at any gains follows."""
        return self.constant + len(self.gains)

    @property
    def columns(self) -> list[int]:
        """The places of the units among the responses with gains of zero and by each gain."""
        return [*([0] if self.constant else []), *(1 + gain for gain in self.gains)]


class ChainColumns(NamedTuple):
    """What one chain adds to the responses at K points.

    Attributes:
        depend: what the chain depends on.
        here: (K, u, m) the responses of its units.
        moved: per shape, their derivatives (K, u, m) by its position.
    """

    depend: Dependence
    here: np.ndarray
    moved: tuple[np.ndarray, ...]


class Rows(abc.ABC):
    """R recordings' problems in coordinates (m,) with the inner products of the samples.

    Attributes:
        grid: step [s] and history of the simulation.
        response: (R, m), reduced.
        at_once: the number of points that are computed together.
    """

    grid: Grid
    response: np.ndarray
    at_once: int

    @abc.abstractmethod
    def reduced(self, rows: np.ndarray, signals: np.ndarray) -> np.ndarray:
        """Signals (K, c, m) of rows (K,), whitened, without what the own terms absorb."""

    @abc.abstractmethod
    def chain_around(
        self,
        block: AbstractBlock,
        at: int,
        depend: Dependence,
        rows: np.ndarray,
        positions: np.ndarray,
    ) -> ChainColumns:
        """What chain `at` adds to the responses at points (K, n), up to constants, not whitened."""

    def columns_around(
        self,
        block: AbstractBlock,
        depends: Sequence[Dependence],
        rows: np.ndarray,
        positions: np.ndarray,
    ) -> list[ChainColumns]:
        """What each chain adds to the responses at points (K, n), each on its row (K,)."""
        return [
            self.chain_around(block, at, depend, rows, positions)
            for at, depend in enumerate(depends)
            if depend.units  # others have a fixed gain of zero
        ]


@dataclass(frozen=True, eq=False)
class Stack(Rows):
    """R recordings' problems in coordinates (m,), without those that the own terms absorb.

    Attributes:
        parts: per chain, the coefficients (J,) that all rows share, and matrices (R, J, m).
        response: (R, m).
        grid: step [s] and history of the simulation.
        at_once: all points, whose coordinates are few.
    """

    parts: tuple[Part, ...]
    response: np.ndarray
    grid: Grid
    at_once: int = 2**30

    @classmethod
    def of_one(cls, problem: CompressedProblem) -> Stack:
        """The stack of one problem."""
        own = problem.own.shape[1]
        parts = [
            Part(p.before, p.after, np.asarray(p.matrix)[None, :, own:]) for p in problem.parts
        ]
        return cls(tuple(parts), np.asarray(problem.response)[None, own:], problem.grid)

    def chain_around(
        self,
        block: AbstractBlock,
        at: int,
        depend: Dependence,
        rows: np.ndarray,
        positions: np.ndarray,
    ) -> ChainColumns:
        """What chain `at` adds to the responses at points (K, n), each on its row (K,)."""
        part, coefficients = self.parts[at], self._coefficients_around(block, at, depend, positions)
        count, units = coefficients.shape[1:3]
        flat = coefficients.reshape(len(rows), count * units, -1)
        matrix = part.matrix if len(part.matrix) == 1 else part.matrix[rows]
        values = np.nan_to_num(flat @ matrix, posinf=0.0, neginf=0.0)
        values = values.reshape(len(rows), count, units, -1)
        moved = (values[:, 1::2] - values[:, 2::2]) / (2 * _DIFFERENCE)
        return ChainColumns(depend, values[:, 0], tuple(np.moveaxis(moved, 1, 0)))

    def reduced(self, rows: np.ndarray, signals: np.ndarray) -> np.ndarray:
        """The signals (K, c, m) themselves."""
        return signals

    def _coefficients_around(
        self, block: AbstractBlock, at: int, depend: Dependence, positions: np.ndarray
    ) -> np.ndarray:
        """A chain's coefficients (K, 1 + 2s, u, J) at points (K, n), and moved along its s shapes.

        The u are the chain's units, the response to zero gains subtracted from those to each gain.
        """
        layout, part = layout_of(block), self.parts[at]
        # Differences stay within the bounds, where alone the compressed problem is valid.
        middle = np.clip(positions, _DIFFERENCE, 1 - _DIFFERENCE)
        around = np.repeat(middle[:, None], 1 + 2 * len(depend.shapes), axis=1)
        around[:, 0] = positions
        for k, shape in enumerate(depend.shapes):
            around[:, 1 + 2 * k, shape] += _DIFFERENCE
            around[:, 2 + 2 * k, shape] -= _DIFFERENCE
        flat = around.reshape(-1, positions.shape[1])
        values = part.coefficients(chain_at(block, layout, at, flat, depend), self.grid)
        values = np.broadcast_to(values, (depend.units, len(flat), part.matrix.shape[-2]))
        values = values.reshape(depend.units, len(positions), around.shape[1], -1)
        return np.moveaxis(by_gain(values, depend), 0, 2)


class Evaluation(NamedTuple):
    """The objective at K points.

    Attributes:
        cost: (K,) χ².
        square: (K, n, n) JᵀJ.
        slope: (K, n) Jᵀr.
    """

    cost: np.ndarray
    square: np.ndarray
    slope: np.ndarray


class Arrival(NamedTuple):
    """Where K points have ended.

    Attributes:
        positions: (K, n) of the shapes.
        costs: (K,) χ².
        converged: (K,) whether the point has arrived within the steps allowed.
        evaluations: (K,) how often the objective was computed.
    """

    positions: np.ndarray
    costs: np.ndarray
    converged: np.ndarray
    evaluations: np.ndarray


def dependences(block: AbstractBlock, grid: Grid) -> tuple[Dependence, ...]:
    """What each chain of a block depends on."""
    layout = layout_of(block)
    shapes, gains = ([name for name, _ in names] for names in layout)
    marks = {name: np.zeros(1) for name in (*shapes, *gains)}
    chains = chains_of(set_values(block, marks))
    assert chains is not None  # only sums of chains are compressed
    middle = np.full((1, len(shapes)), 0.5)
    result = []
    for at, chain in enumerate(chains):
        leaves = {id(leaf) for leaf in jax.tree_util.tree_leaves(chain)}
        of_shapes, of_gains = (
            tuple(k for k, name in enumerate(names) if id(marks[name]) in leaves)
            for names in (shapes, gains)
        )
        silent = chain_at(block, layout, at, middle, Dependence((), (), True))
        constant = all(
            np.any(transfer(each, _WITHIN, grid))
            for each in (silent.before, silent.after)
            if each is not None
        )
        result.append(Dependence(of_shapes, of_gains, constant))
    return tuple(result)


def descend_together(
    block: AbstractBlock,
    stacks: Sequence[Rows],
    rows: np.ndarray,
    positions: np.ndarray,
    steps: int = _STEPS,
    negligible: float = NEGLIGIBLE,
) -> Arrival:
    """The descents of K points from positions (K, n), each on its row (K,) of the stacks.

    Several stacks hold recordings that are fitted jointly, row by row.  A descent ends with a step
    that is expected to decrease χ² by less than the share `negligible`.
    """
    depends = dependences(block, stacks[0].grid)
    positions, evaluations = positions.copy(), np.ones(len(positions), int)
    current = evaluate(block, depends, stacks, rows, positions)
    damping = np.full(len(positions), _FIRST_DAMPING)
    converged = np.zeros(len(positions), bool)
    active = np.flatnonzero(np.isfinite(current.cost))
    for _ in range(steps):
        here = _select(current, active)
        last = _step(positions[active], here, np.minimum(damping[active], _LAST_DAMPING))
        ends = _expected_decrease(here, last) < negligible * here.cost
        ending = active[ends]
        positions[ending] = np.clip(positions[ending] + last[ends], 0.0, 1.0)
        converged[ending] = True
        active = active[~ends]
        if not active.size:
            break
        step = _step(positions[active], _select(current, active), damping[active])
        there = np.clip(positions[active] + step, 0.0, 1.0)
        trial = evaluate(block, depends, stacks, rows[active], there)
        evaluations[active] += 1
        decrease = current.cost[active] - trial.cost
        better = decrease > 0
        arrived = (better & (decrease < _RELATIVE * trial.cost)) | (
            np.abs(there - positions[active]).max(axis=1) < _CLOSE
        )
        positions[active[better]] = there[better]
        for old, new in zip(current, trial, strict=True):
            old[active[better]] = new[better]
        damping[active] *= np.where(better, 0.2, 4.0)
        converged[active[arrived]] = True
        active = active[~arrived]
    return Arrival(positions, current.cost, converged, evaluations)


def _expected_decrease(evaluation: Evaluation, step: np.ndarray) -> np.ndarray:
    """The decrease (K,) of χ² that its second derivative promises for steps (K, n)."""
    curved = (evaluation.square @ step[:, :, None])[:, :, 0]
    return -np.sum((2 * evaluation.slope + curved) * step, axis=1)


def _select(evaluation: Evaluation, which: np.ndarray) -> Evaluation:
    """The evaluation at some of the points."""
    return Evaluation(*(values[which] for values in evaluation))


def _step(position: np.ndarray, evaluation: Evaluation, damping: np.ndarray) -> np.ndarray:
    """Steps (K, n) of the shapes, 0 for those at a bound."""
    at_bound = ((position <= 0) & (evaluation.slope > 0)) | (
        (position >= 1) & (evaluation.slope < 0)
    )
    free = ~at_bound
    square = evaluation.square * (free[:, :, None] & free[:, None, :])
    size = position.shape[1]
    diagonal = np.einsum("sii->si", square)
    diagonal = np.where(at_bound, 1.0, diagonal * (1 + damping[:, None]) + 1e-300)
    square[:, np.arange(size), np.arange(size)] = diagonal
    return -np.linalg.solve(square, (evaluation.slope * free)[:, :, None])[:, :, 0]


def evaluate(
    block: AbstractBlock,
    depends: Sequence[Dependence],
    stacks: Sequence[Rows],
    rows: np.ndarray,
    positions: np.ndarray,
) -> Evaluation:
    """χ² at points (K, n), half its gradient, and half its second derivative by Gauss–Newton."""
    at_once = min(stack.at_once for stack in stacks)
    parts = []
    for at in range(0, len(rows), at_once):
        some, there = rows[at : at + at_once], positions[at : at + at_once]
        pieces = [combine(block, depends, stack, some, there) for stack in stacks]
        columns = np.concatenate([piece[0] for piece in pieces], axis=-1)
        target = np.concatenate([piece[1] for piece in pieces], axis=-1)
        gains, residual, basis = eliminate(np.swapaxes(columns, 1, 2), target)
        change = np.concatenate(
            [
                stack.reduced(some, change_by_shapes(piece[2], gains, there.shape[1]))
                for stack, piece in zip(stacks, pieces, strict=True)
            ],
            axis=-1,
        )
        derivative = (change @ basis) @ np.swapaxes(basis, 1, 2) - change
        slope = (derivative @ residual[..., None])[..., 0]
        square = derivative @ np.swapaxes(derivative, 1, 2)
        parts.append(Evaluation(np.sum(residual**2, axis=1), square, slope))
    return Evaluation(*map(np.concatenate, zip(*parts, strict=True)))


def combine(
    block: AbstractBlock,
    depends: Sequence[Dependence],
    stack: Rows,
    rows: np.ndarray,
    positions: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, list[ChainColumns]]:
    """At points (K, n): the reduced columns of the gains (K, g, m), the reduced response minus that
    with gains of zero (K, m), and the chains' columns.
    """
    chains = stack.columns_around(block, depends, rows, positions)
    columns = stack.reduced(rows, total_of(chains, len(layout_of(block).gains)))
    return columns[:, 1:], stack.response[rows] - columns[:, 0], chains


def total_of(chains: Sequence[ChainColumns], gains: int) -> np.ndarray:
    """The responses (K, 1 + g, m) with gains of zero and by each gain, from those of the chains."""
    first = chains[0].here
    total = np.zeros((len(first), 1 + gains, first.shape[-1]))
    for chain in chains:
        total[:, chain.depend.columns] += chain.here
    return total


def with_one(gains: np.ndarray) -> np.ndarray:
    """The weights (K, 1 + g) of the response with gains of zero and of those by gains (K, g)."""
    return np.pad(gains, ((0, 0), (1, 0)), constant_values=1.0)


def change_by_shapes(chains: Sequence[ChainColumns], gains: np.ndarray, shapes: int) -> np.ndarray:
    """The derivatives (K, n, m) of the responses by the shapes' positions at gains (K, g)."""
    weights, first = with_one(gains), chains[0].here
    change = np.zeros((len(first), shapes, first.shape[-1]))
    for depend, _, moved in chains:
        factors = weights[:, None, depend.columns]
        for shape, by_shape in zip(depend.shapes, moved, strict=True):
            change[:, shape] += (factors @ by_shape)[:, 0]
    return change


def by_gain(values: np.ndarray, depend: Dependence) -> np.ndarray:
    """Values (u, …) of a chain's units, that with gains of zero subtracted from the others."""
    if depend.constant and depend.gains:
        values = np.concatenate([values[:1], values[1:] - values[:1]])
    return values


def chain_at(
    block: AbstractBlock, layout: Layout, at: int, positions: np.ndarray, depend: Dependence
) -> Chain:
    """A chain at positions (K, n), its gains (u, 1, 1) at the units in turn.

    What depends on the shapes alone, such as powers, is so computed once for all units.
    """
    columns = np.array(depend.columns)
    values = {
        name: (columns == 1 + gain).astype(float)[:, None, None]
        for gain, (name, _) in enumerate(layout.gains)
    }
    chains = chains_of(set_values(block, shapes_at(block, layout, positions) | values))
    assert chains is not None  # only sums of chains are compressed
    return chains[at]
