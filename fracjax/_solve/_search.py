"""The search from all starts at once, on compressed problems.

Levenberg–Marquardt over the positions of the shapes, gains eliminated, with Kaufman's derivative
and steps that end at the bounds:

    (JᵀJ + λ diag JᵀJ) step = -Jᵀr,     J = (1 - QQᵀ) ∂/∂θ (Φ c + y_0)

All starts are computed together in NumPy arrays.  Derivatives are central differences: on a problem
of fifty rows, analytic in its shapes to 1e-11, they take less time than a program takes to compile,
which was 1 s for the model and its derivative and 5 s for optimistix's solver.

Sources: Marquardt, J. SIAM 11 (1963) 431; Kaufman, BIT 15 (1975) 49.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import Problem, layout_of, position_of, with_shapes_at
from ._compressed import CompressedProblem, columns_at, compress
from ._elimination import eliminate

_LEAST_STARTS = 4
"""With fewer starts, descents on the full model take less time than compression."""
_STEPS = 60
"""Most steps of a start.  Chosen by judgement."""
_RELATIVE, _CLOSE = 1e-8, 1e-7
"""Relative decrease of χ², and step of the positions, below which a start has converged."""
_DIFFERENCE = 1e-4
"""Step of the central differences, whose error of order 1e-8 is near that of rounding."""
_FIRST_DAMPING = 1e-2
"""The first λ.  Chosen by judgement."""


class SearchResult(NamedTuple):
    """The result of a search.

    Attributes:
        best: the block with the least χ².
        costs: (S,) χ² where each start ended.
        evaluations: how often the objective was computed.
    """

    best: AbstractBlock
    costs: np.ndarray
    evaluations: int

    @property
    def cost(self) -> float:
        """The least χ²."""
        return float(self.costs.min())


def search(starts: list[AbstractBlock], problems: tuple[Problem, ...]) -> SearchResult | None:
    """The best shapes from all starts together.

    None where the problems cannot be compressed accurately enough, or where there are so few starts
    that a descent from each takes less time than compression.
    """
    block = starts[0]
    if len(starts) < _LEAST_STARTS or not layout_of(block).shapes:
        return None
    compressed = compress(block, problems)
    if compressed is None:
        return None
    positions = np.clip(np.stack([position_of(start) for start in starts]), 0.0, 1.0)
    positions, costs, evaluations = _descend(block, compressed.problems, positions)
    best = int(np.argmin(costs))
    # The noise may be unknown as yet, so that the error is compared with the residual.
    noise = np.sqrt(costs[best] / sum(float(p.count) for p in problems))
    if not compressed.is_accurate_for(noise):
        return None
    return SearchResult(with_shapes_at(block, positions[best]), costs, evaluations)


class _Evaluation(NamedTuple):
    """The objective at S positions.

    Attributes:
        cost: (S,) χ².
        square: (S, n, n) JᵀJ.
        slope: (S, n) Jᵀr.
    """

    cost: np.ndarray
    square: np.ndarray
    slope: np.ndarray


def _descend(
    block: AbstractBlock, problems: tuple[CompressedProblem, ...], positions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int]:
    """Where the starts end (S, n), χ² (S,) there, and the number of evaluations."""
    positions, evaluations = positions.copy(), len(positions)
    current = _evaluate(block, problems, positions)
    damping = np.full(len(positions), _FIRST_DAMPING)
    active = np.flatnonzero(np.isfinite(current.cost))
    for _ in range(_STEPS):
        if not active.size:
            break
        here = positions[active]
        there = np.clip(here + _step(here, _select(current, active), damping[active]), 0.0, 1.0)
        trial = _evaluate(block, problems, there)
        evaluations += active.size
        decrease = current.cost[active] - trial.cost
        better = decrease > 0
        arrived = (better & (decrease < _RELATIVE * trial.cost)) | (
            np.abs(there - here).max(axis=1) < _CLOSE
        )
        positions[active[better]] = there[better]
        for old, new in zip(current, trial, strict=True):
            old[active[better]] = new[better]
        damping[active] *= np.where(better, 0.2, 4.0)
        active = active[~arrived]
    return positions, current.cost, evaluations


def _select(evaluation: _Evaluation, which: np.ndarray) -> _Evaluation:
    """The evaluation at some of the positions."""
    return _Evaluation(*(values[which] for values in evaluation))


def _step(position: np.ndarray, evaluation: _Evaluation, damping: np.ndarray) -> np.ndarray:
    """Steps (S, n) of the shapes, 0 for those at a bound."""
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


def _evaluate(
    block: AbstractBlock, problems: tuple[CompressedProblem, ...], positions: np.ndarray
) -> _Evaluation:
    """χ² at positions (S, n), half its gradient, and half its second derivative by Gauss–Newton."""
    starts, size = positions.shape
    offsets = _DIFFERENCE * np.concatenate([np.zeros((1, size)), np.eye(size), -np.eye(size)])
    # Differences stay within the bounds, where alone the compressed problem is valid.
    middle = np.clip(positions, _DIFFERENCE, 1 - _DIFFERENCE)
    around = middle[None] + offsets[:, None]
    around[0] = positions
    flat = around.reshape(-1, size)
    columns, response = [], []
    for problem in problems:
        # The own terms absorb the first coordinates.
        own_count = problem.own.shape[1]
        columns.append(columns_at(block, problem, flat)[:, :, own_count:])
        response.append(problem.response[own_count:])
    values = np.concatenate(columns, axis=2).reshape(2 * size + 1, starts, columns[0].shape[1], -1)
    values = np.nan_to_num(values, posinf=0.0, neginf=0.0)
    here = values[0]
    moved = (values[1 : size + 1] - values[size + 1 :]) / (2 * _DIFFERENCE)
    target = np.concatenate(response) - here[:, 0]
    gains, residual, basis = eliminate(np.swapaxes(here[:, 1:], 1, 2), target)
    change = np.einsum("nsgm,sg->smn", moved, np.concatenate([np.ones((starts, 1)), gains], axis=1))
    derivative = basis @ (np.swapaxes(basis, 1, 2) @ change) - change
    slope = np.einsum("smn,sm->sn", derivative, residual)
    square = np.swapaxes(derivative, 1, 2) @ derivative
    return _Evaluation(np.sum(residual**2, axis=1), square, slope)
