r"""The search from all starts at once, on compressed problems.

Levenberg–Marquardt over the positions of the shapes, gains eliminated, with Kaufman's derivative
and steps that end at the bounds:

    (JᵀJ + λ diag JᵀJ) step = -Jᵀr,     J = (1 - QQᵀ) ∂/∂θ (Φ c + y_0)

All starts go together through NumPy's arrays.  Derivatives are central differences: on a problem of
fifty rows, analytic in its shapes to 1e-11, they cost less than a program would to compile, which
was 1 s for the model and its derivative and 5 s for optimistix's solver on it.
Sources: Marquardt, J. SIAM 11 (1963) 431; Kaufman, BIT 15 (1975) 49.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import Problem, layout_of, placed, position_of
from ._compressed import CompressedProblem, columns_at, compress
from ._elimination import eliminated

_LEAST_STARTS = 4
_STEPS = 60
_RELATIVE, _CLOSE = 1e-8, 1e-7
_DIFFERENCE = 1e-4
_FIRST_DAMPING = 1e-2


class Searched(NamedTuple):
    """The best block, χ² (S,) where each start ended, and how often the objective was computed."""

    best: AbstractBlock
    costs: np.ndarray
    evaluations: int

    @property
    def cost(self) -> float:
        return float(self.costs.min())


def search(starts: list[AbstractBlock], problems: tuple[Problem, ...]) -> Searched | None:
    """The best shapes from all starts together.

    None where the problems cannot be compressed, or not to far below the noise, and with so
    few starts that descending from each costs less than compressing does.
    """
    block = starts[0]
    if len(starts) < _LEAST_STARTS or not layout_of(block).shapes:
        return None
    compressed = compress(block, problems)
    if compressed is None:
        return None
    positions = np.clip(np.stack([position_of(start) for start in starts]), 0.0, 1.0)
    positions, costs, evaluations = _descended(block, compressed.problems, positions)
    best = int(np.argmin(costs))
    # The noise may not be known yet: what is left then is the measure.
    noise = np.sqrt(costs[best] / sum(float(p.count) for p in problems))
    if not compressed.serves(noise):
        return None
    return Searched(placed(block, positions[best]), costs, evaluations)


class _Look(NamedTuple):
    """χ² (S,), JᵀJ (S, n, n) and Jᵀr (S, n) at S positions."""

    cost: np.ndarray
    square: np.ndarray
    slope: np.ndarray


def _descended(
    block: AbstractBlock, problems: tuple[CompressedProblem, ...], positions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int]:
    """Where the starts end (S, n), χ² (S,) there, and the number of looks."""
    positions, evaluations = positions.copy(), len(positions)
    now = _look(block, problems, positions)
    damping = np.full(len(positions), _FIRST_DAMPING)
    active = np.flatnonzero(np.isfinite(now.cost))
    for _ in range(_STEPS):
        if not active.size:
            break
        here = positions[active]
        there = np.clip(here + _step(here, _part(now, active), damping[active]), 0.0, 1.0)
        found = _look(block, problems, there)
        evaluations += active.size
        gained = now.cost[active] - found.cost
        better = gained > 0
        arrived = (better & (gained < _RELATIVE * found.cost)) | (
            np.abs(there - here).max(axis=1) < _CLOSE
        )
        positions[active[better]] = there[better]
        for old, new in zip(now, found, strict=True):
            old[active[better]] = new[better]
        damping[active] *= np.where(better, 0.2, 4.0)
        active = active[~arrived]
    return positions, now.cost, evaluations


def _part(look: _Look, which: np.ndarray) -> _Look:
    return _Look(*(numbers[which] for numbers in look))


def _step(position: np.ndarray, look: _Look, damping: np.ndarray) -> np.ndarray:
    """Steps (S, n) of the shapes that are not held at a bound."""
    held = ((position <= 0) & (look.slope > 0)) | ((position >= 1) & (look.slope < 0))
    free = ~held
    square = look.square * (free[:, :, None] & free[:, None, :])
    size = position.shape[1]
    sizes = np.einsum("sii->si", square)
    sizes = np.where(held, 1.0, sizes * (1 + damping[:, None]) + 1e-300)
    square[:, np.arange(size), np.arange(size)] = sizes
    return -np.linalg.solve(square, (look.slope * free)[:, :, None])[:, :, 0]


def _look(
    block: AbstractBlock, problems: tuple[CompressedProblem, ...], positions: np.ndarray
) -> _Look:
    """χ² at positions (S, n), its gradient's half and Gauss–Newton's second derivative's."""
    starts, size = positions.shape
    away = _DIFFERENCE * np.concatenate([np.zeros((1, size)), np.eye(size), -np.eye(size)])
    # Differences keep within the bounds, beyond which nothing was compressed.
    middle = np.clip(positions, _DIFFERENCE, 1 - _DIFFERENCE)
    around = middle[None] + away[:, None]
    around[0] = positions
    flat = around.reshape(-1, size)
    columns, response = [], []
    for problem in problems:
        # The own terms take up the first coordinates, whatever the others are.
        held = problem.own.shape[1]
        columns.append(columns_at(block, problem, flat)[:, :, held:])
        response.append(problem.response[held:])
    values = np.concatenate(columns, axis=2).reshape(2 * size + 1, starts, columns[0].shape[1], -1)
    values = np.nan_to_num(values, posinf=0.0, neginf=0.0)
    here = values[0]
    moved = (values[1 : size + 1] - values[size + 1 :]) / (2 * _DIFFERENCE)
    target = np.concatenate(response) - here[:, 0]
    gains, residual, basis = eliminated(np.swapaxes(here[:, 1:], 1, 2), target)
    change = np.einsum("nsgm,sg->smn", moved, np.concatenate([np.ones((starts, 1)), gains], axis=1))
    derivative = basis @ (np.swapaxes(basis, 1, 2) @ change) - change
    slope = np.einsum("smn,sm->sn", derivative, residual)
    square = np.swapaxes(derivative, 1, 2) @ derivative
    return _Look(np.sum(residual**2, axis=1), square, slope)
