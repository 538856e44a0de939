"""Levenberg–Marquardt on many compressed problems at once, in lock-step.

    (JᵀJ + λ diag JᵀJ) step = -Jᵀr,     J = (1 - QQᵀ) ∂/∂θ (Φ c + y_0)

over the positions of the shapes, gains eliminated, with Kaufman's derivative and steps that end at
the bounds.  A problem is a row of a stack, and every start of every row is a point.  All points are
computed together in NumPy arrays, and those that have arrived are left out.  Derivatives are
central differences: on a problem of fifty rows, analytic in its shapes to 1e-11, they take less
time than a program takes to compile, which was 1 s for the model and its derivative and 5 s for
optimistix's solver.  A chain is computed only for the parameters that it depends on.

Sources: Marquardt, J. SIAM 11 (1963) 431; Kaufman, BIT 15 (1975) 49.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np

from .._blocks import AbstractBlock
from .._operators import Grid
from .._parameters import set_values
from .._prepare import Layout, layout_of
from ._chains import Chain, chains_of
from ._compressed import CompressedProblem, Part
from ._elimination import eliminate
from ._interpolation import shapes_at

_STEPS = 60
"""Most steps of a start.  Chosen by judgement."""
_RELATIVE, _CLOSE = 1e-8, 1e-7
"""Relative decrease of χ², and step of the positions, below which a start has converged."""
_DIFFERENCE = 1e-4
"""Step of the central differences, whose error of order 1e-8 is near that of rounding."""
_FIRST_DAMPING = 1e-2
"""The first λ.  Chosen by judgement."""


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


class Stack(NamedTuple):
    """R recordings' problems in coordinates (m,), without those that the own terms absorb.

    Attributes:
        parts: per chain, the coefficients (J,) that all rows share, and matrices (R, J, m).
        response: (R, m).
        grid: step [s] and history of the simulation.
    """

    parts: tuple[Part, ...]
    response: np.ndarray
    grid: Grid

    @classmethod
    def of_one(cls, problem: CompressedProblem) -> Stack:
        """The stack of one problem."""
        own = problem.own.shape[1]
        parts = [
            Part(p.before, p.after, np.asarray(p.matrix)[None, :, own:]) for p in problem.parts
        ]
        return cls(tuple(parts), np.asarray(problem.response)[None, own:], problem.grid)


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


def dependences(block: AbstractBlock, stack: Stack) -> tuple[Dependence, ...]:
    """What each chain of a block depends on."""
    layout = layout_of(block)
    shapes, gains = ([name for name, _ in names] for names in layout)
    marks = {name: np.zeros(1) for name in (*shapes, *gains)}
    chains = chains_of(set_values(block, marks))
    assert chains is not None  # only sums of chains are compressed
    middle = np.full((1, len(shapes)), 0.5)
    result = []
    for at, (chain, part) in enumerate(zip(chains, stack.parts, strict=True)):
        leaves = {id(leaf) for leaf in jax.tree_util.tree_leaves(chain)}
        of_shapes, of_gains = (
            tuple(k for k, name in enumerate(names) if id(marks[name]) in leaves)
            for names in (shapes, gains)
        )
        silent = _chain_at(block, layout, at, middle, Dependence((), (), True))
        constant = bool(np.any(part.coefficients(silent, stack.grid)))
        result.append(Dependence(of_shapes, of_gains, constant))
    return tuple(result)


def descend_together(
    block: AbstractBlock, stacks: Sequence[Stack], rows: np.ndarray, positions: np.ndarray
) -> Arrival:
    """The descents of K points from positions (K, n), each on its row (K,) of the stacks.

    Several stacks hold recordings that are fitted jointly, row by row.
    """
    depends = dependences(block, stacks[0])
    positions, evaluations = positions.copy(), np.ones(len(positions), int)
    current = evaluate(block, depends, stacks, rows, positions)
    damping = np.full(len(positions), _FIRST_DAMPING)
    converged = np.zeros(len(positions), bool)
    active = np.flatnonzero(np.isfinite(current.cost))
    for _ in range(_STEPS):
        if not active.size:
            break
        here = positions[active]
        there = np.clip(here + _step(here, _select(current, active), damping[active]), 0.0, 1.0)
        trial = evaluate(block, depends, stacks, rows[active], there)
        evaluations[active] += 1
        decrease = current.cost[active] - trial.cost
        better = decrease > 0
        arrived = (better & (decrease < _RELATIVE * trial.cost)) | (
            np.abs(there - here).max(axis=1) < _CLOSE
        )
        positions[active[better]] = there[better]
        for old, new in zip(current, trial, strict=True):
            old[active[better]] = new[better]
        damping[active] *= np.where(better, 0.2, 4.0)
        converged[active[arrived]] = True
        active = active[~arrived]
    return Arrival(positions, current.cost, converged, evaluations)


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
    stacks: Sequence[Stack],
    rows: np.ndarray,
    positions: np.ndarray,
) -> Evaluation:
    """χ² at points (K, n), half its gradient, and half its second derivative by Gauss–Newton."""
    pieces = [columns_around(block, depends, stack, rows, positions) for stack in stacks]
    here, moved = (np.concatenate(parts, axis=-1) for parts in zip(*pieces, strict=True))
    target = np.concatenate([stack.response[rows] for stack in stacks], axis=1) - here[:, 0]
    gains, residual, basis = eliminate(np.swapaxes(here[:, 1:], 1, 2), target)
    change = np.einsum("nkgm,kg->kmn", moved, np.pad(gains, ((0, 0), (1, 0)), constant_values=1.0))
    derivative = basis @ (np.swapaxes(basis, 1, 2) @ change) - change
    slope = np.einsum("kmn,km->kn", derivative, residual)
    square = np.swapaxes(derivative, 1, 2) @ derivative
    return Evaluation(np.sum(residual**2, axis=1), square, slope)


def columns_around(
    block: AbstractBlock,
    depends: Sequence[Dependence],
    stack: Stack,
    rows: np.ndarray,
    positions: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Compressed responses (K, 1 + g, m) at points (K, n), and their derivatives (n, K, 1 + g, m).

    The first of 1 + g is the response with gains of zero, the others are the derivatives by each
    gain.
    """
    layout = layout_of(block)
    here = np.zeros((len(rows), 1 + len(layout.gains), stack.response.shape[1]))
    moved = np.zeros((len(layout.shapes), *here.shape))
    for at, (depend, part) in enumerate(zip(depends, stack.parts, strict=True)):
        if not depend.units:  # a fixed gain of zero
            continue
        coefficients = coefficients_around(block, at, depend, part, stack.grid, positions)
        count, units = coefficients.shape[1:3]
        flat = coefficients.reshape(len(rows), count * units, -1)
        matrix = part.matrix if len(part.matrix) == 1 else part.matrix[rows]
        values = np.nan_to_num(flat @ matrix, posinf=0.0, neginf=0.0)
        values = values.reshape(len(rows), count, units, -1)
        here[:, depend.columns] += values[:, 0]
        for k, shape in enumerate(depend.shapes):
            change = values[:, 1 + 2 * k] - values[:, 2 + 2 * k]
            moved[shape][:, depend.columns] += change / (2 * _DIFFERENCE)
    return here, moved


def coefficients_around(
    block: AbstractBlock,
    at: int,
    depend: Dependence,
    part: Part,
    grid: Grid,
    positions: np.ndarray,
) -> np.ndarray:
    """A chain's coefficients (K, 1 + 2s, u, J) at points (K, n), and moved along its s shapes.

    The u are the chain's units, the response to zero gains subtracted from those to each gain.
    """
    layout, count = layout_of(block), len(positions)
    # Differences stay within the bounds, where alone the compressed problem is valid.
    middle = np.clip(positions, _DIFFERENCE, 1 - _DIFFERENCE)
    around = np.repeat(middle[:, None], 1 + 2 * len(depend.shapes), axis=1)
    around[:, 0] = positions
    for k, shape in enumerate(depend.shapes):
        around[:, 1 + 2 * k, shape] += _DIFFERENCE
        around[:, 2 + 2 * k, shape] -= _DIFFERENCE
    flat = around.reshape(-1, positions.shape[1])
    values = part.coefficients(_chain_at(block, layout, at, flat, depend), grid)
    values = np.broadcast_to(values, (depend.units, len(flat), part.matrix.shape[-2]))
    values = np.moveaxis(values.reshape(depend.units, count, around.shape[1], -1), 0, 2)
    if depend.constant and depend.gains:
        values = np.concatenate([values[:, :, :1], values[:, :, 1:] - values[:, :, :1]], axis=2)
    return values


def _chain_at(
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
