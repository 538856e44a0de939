r"""Least squares over the shapes, law by law.

    min_θ ‖ W (y - y_0(θ) - Φ(θ) c(θ)) ‖²,     c(θ) = argmin_c ‖ W (y - y_0(θ) - Φ(θ) c) ‖

as in `_variable_projection`, with Kaufman's derivative -(1 - QQᵀ) W (∂Φ/∂θ) c.  Each law compiles
its response and derivatives once (`AbstractBlock.linearise`); what joins them runs outside, under
SciPy's trust region with bounds, so that a model put together a moment ago costs no compilation.
Sources: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413; Kaufman, BIT 15 (1975) 49; Branch,
Coleman & Li, SIAM J. Sci. Comput. 21 (1999) 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

from .._blocks import AbstractBlock
from .._parameters import named_parameters
from ._layout import layout_of, own_columns, placed, position_of, with_gains
from ._problem import Problem

_RIDGE = 1e-9
_RELATIVE = 1e-8


def simulate(block: AbstractBlock, problem: Problem) -> np.ndarray:
    """The block's response (L,) at a recording's samples."""
    drive = jnp.asarray(problem.drive)
    return np.asarray(block.respond(drive, problem.grid))[:: problem.oversampling]


def simulate_all(
    blocks: Sequence[AbstractBlock], problems: tuple[Problem, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Simulations (K, ΣL) of blocks, as they are and whitened."""
    raw = [[simulate(block, problem) for problem in problems] for block in blocks]
    whitened = [
        [p.whiten(s) for p, s in zip(problems, simulations, strict=True)] for simulations in raw
    ]
    return (
        np.stack([np.concatenate(simulations) for simulations in raw]),
        np.stack([np.concatenate(simulations) for simulations in whitened]),
    )


def linearised(
    block: AbstractBlock, problem: Problem, names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Response (L,) and its derivatives (L, Σ size) with respect to the named parameters."""
    drive = jnp.asarray(problem.drive)
    response, columns, _ = block.linearise(drive, problem.grid, names, ())
    pieces = [np.asarray(columns[name])[:: problem.oversampling] for name in names]
    response = np.asarray(response)[:: problem.oversampling]
    return response, np.concatenate([np.zeros((response.size, 0)), *pieces], axis=1)


def jacobian(block: AbstractBlock, problems: tuple[Problem, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Derivative (ΣL, shapes + gains + own) of the simulation in physical values: as it is, and
    whitened with left-out samples zero."""
    layout = layout_of(block)
    names = [name for name, _ in layout.shapes + layout.gains]
    raw = [
        np.concatenate([linearised(block, problem, names)[1], own], axis=1)
        for problem, own in zip(problems, own_columns(problems), strict=True)
    ]
    whitened = [p.whiten(columns) for p, columns in zip(problems, raw, strict=True)]
    return np.concatenate(raw), np.concatenate(whitened)


class Point(NamedTuple):
    """A block with its best gains, the own coefficients (Σq,), the whitened residual (ΣL,), and an
    orthonormal basis (ΣL, gains + own) of what gains and own terms span."""

    block: AbstractBlock
    own: np.ndarray
    residual: np.ndarray
    basis: np.ndarray

    @property
    def cost(self) -> float:
        """χ², infinite where the simulation broke down."""
        return float(np.nan_to_num(self.residual @ self.residual, nan=np.inf, posinf=np.inf))


class Objective:
    """χ² of a block over the positions of its shapes, everything linear at its best.

    It counts its `evaluations` and keeps the `best` point it has met.
    """

    def __init__(self, block: AbstractBlock, problems: tuple[Problem, ...]):
        self.block, self.problems = block, problems
        self.layout = layout_of(block)
        self.own = [np.asarray(columns) for columns in own_columns(problems)]
        self.white_own = [p.whiten(own) for p, own in zip(problems, self.own, strict=True)]
        self.evaluations = 0
        self._position, self._point = np.full(0, np.nan), None

    def at(self, position: np.ndarray) -> Point:
        """The point at a position (n,)."""
        if self._point is None or not np.array_equal(position, self._position):
            self._position, self._point = position.copy(), self._solve(position)
        return self._point

    def _solve(self, position: np.ndarray) -> Point:
        self.evaluations += 1
        block = placed(self.block, position)
        names = [name for name, _ in self.layout.gains]
        parameters = named_parameters(block)
        gains = np.concatenate([np.zeros(0), *(np.ravel(parameters[n].value) for n in names)])
        columns, targets = [], []
        for problem, white_own in zip(self.problems, self.white_own, strict=True):
            response, found = linearised(block, problem, names)
            columns.append(np.concatenate([problem.whiten(found), white_own], axis=1))
            targets.append(problem.whiten(problem.response - response + found @ gains))
        solution, residual, basis = least(np.concatenate(columns), np.concatenate(targets))
        return Point(
            with_gains(block, solution[: gains.size]), solution[gains.size :], residual, basis
        )

    def residual(self, position: np.ndarray) -> np.ndarray:
        """The whitened residual (ΣL,)."""
        return self.at(position).residual

    def derivative(self, position: np.ndarray) -> np.ndarray:
        """Kaufman's derivative (ΣL, n) of the residual."""
        point = self.at(position)
        names = [name for name, _ in self.layout.shapes]
        columns = [
            problem.whiten(linearised(point.block, problem, names)[1]) for problem in self.problems
        ]
        moved = np.concatenate(columns) * self._slopes(point.block)
        return point.basis @ (point.basis.T @ moved) - moved

    def _slopes(self, block: AbstractBlock) -> np.ndarray:
        """How fast each shape's value changes with its position."""
        parameters = named_parameters(block)
        return np.concatenate([np.ravel(parameters[n].slope()) for n, _ in self.layout.shapes])

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The positions' bounds (n,)."""
        parameters = named_parameters(self.block)
        bounded = np.concatenate(
            [np.full(size, parameters[name].bounded) for name, size in self.layout.shapes]
        )
        return np.where(bounded, 0.0, -np.inf), np.where(bounded, 1.0, np.inf)


def least(columns: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The least-squares solution, its residual, and an orthonormal basis of the columns."""
    # Columns of unit length, and a ridge far below the noise, where two of them coincide.
    lengths = np.linalg.norm(columns, axis=0) + 1e-300
    scaled = np.concatenate([columns / lengths, _RIDGE * np.eye(columns.shape[1])])
    q, r = np.linalg.qr(scaled)
    basis = q[: target.size]
    solution = solve_triangular(r, basis.T @ target, check_finite=False) / lengths
    return solution, target - columns @ solution, basis


class Descent(NamedTuple):
    """Where one start has come: position (n,), χ², evaluations so far, and whether it is there."""

    block: AbstractBlock
    position: np.ndarray
    cost: float
    evaluations: int
    converged: bool


def begin(start: AbstractBlock) -> Descent:
    """A start, not yet looked at."""
    return Descent(start, position_of(start), np.inf, 0, False)


def descend(at: Descent, problems: tuple[Problem, ...], looks: int) -> Descent:
    """Up to `looks` evaluations further."""
    objective = Objective(at.block, problems)
    first = objective.at(at.position)
    if at.position.size == 0 or not np.isfinite(first.cost):
        return at._replace(
            cost=first.cost, evaluations=at.evaluations + 1, converged=np.isfinite(first.cost)
        )
    found = least_squares(
        objective.residual,
        at.position,
        objective.derivative,  # type: ignore[arg-type]
        bounds=objective.bounds(),
        x_scale="jac",
        ftol=_RELATIVE,
        xtol=_RELATIVE,
        gtol=None,  # type: ignore[arg-type]
        max_nfev=looks,
    )
    return at._replace(
        position=found.x,
        cost=2 * float(found.cost),
        evaluations=at.evaluations + objective.evaluations,
        converged=found.status > 0,
    )
