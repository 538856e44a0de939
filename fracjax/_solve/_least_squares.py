"""Least squares over the shapes, block by block.

    min_θ ‖ W (y - y_0(θ) - Φ(θ) c(θ)) ‖²,     c(θ) = argmin_c ‖ W (y - y_0(θ) - Φ(θ) c) ‖

with Kaufman's derivative -(1 - QQᵀ) W (∂Φ/∂θ) c.  Each block compiles its response and derivatives
once (`AbstractBlock.linearise`).  They are combined outside compiled code, under SciPy's trust
region with bounds, so that a new combination of blocks needs no compilation.  In its place the
Levenberg–Marquardt of stacks (`_lockstep`) ended at the same optima after up to 1.4 times as many
evaluations, on six fits of loops, plays, creep and several recordings.

Sources: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413; Kaufman, BIT 15 (1975) 49; Branch,
    Coleman & Li, SIAM J. Sci. Comput. 21 (1999) 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import (
    Conditions,
    FreeParameters,
    Problem,
    free_parameters_of,
    own_columns,
    prior_rows,
)
from ._elimination import eliminate

_RELATIVE = 1e-8
"""Relative change of χ² or of the position below which a descent has converged."""
_OVERFLOWING = 1e100
"""Larger derivatives are near overflow when squared."""


class Linearised(Protocol):
    """The data of a least-squares problem: a recording, or a measured frequency response.

    Attributes:
        response: (L,) in the response's unit.
        own: (L, q) terms that only this recording has.
        weights: (L,) that whiten them.
        size: the norm of the whitened response about its mean.
    """

    @property
    def response(self) -> Any: ...

    @property
    def own(self) -> Any: ...

    @property
    def weights(self) -> Any: ...

    @property
    def size(self) -> float:
        """The norm of the whitened response about its mean."""
        ...

    def linearised(
        self, block: AbstractBlock, names: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The response (L,) and its derivatives (L, Σ size) by the named parameters."""
        ...

    def whiten(self, signals: Any) -> Any:
        """Signals (L, …) in units of the noise."""
        ...


def simulate(block: AbstractBlock, problem: Problem) -> np.ndarray:
    """The block's response (L,) at a recording's samples."""
    return problem.respond(block)


def jacobian(block: AbstractBlock, problems: tuple[Problem, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The derivative (ΣL, shapes + gains + own) of the simulation in physical values.

    It is given as it is, and whitened with samples that do not count set to zero.
    """
    parameters = free_parameters_of(block, len(problems), Conditions())
    return sensitivity([block] * len(problems), problems, parameters)


def sensitivity(
    blocks: Sequence[AbstractBlock],
    problems: Sequence[Linearised],
    parameters: FreeParameters,
) -> tuple[np.ndarray, np.ndarray]:
    """The derivative (ΣL, parameters + own) of the simulations, one block per recording.

    It is given as it is, and whitened.
    """
    own, raw, white = own_columns(problems), [], []
    for r, (block, problem) in enumerate(zip(blocks, problems, strict=True)):
        # Shapes and gains each for themselves, as a descent asks for them: it has compiled both.
        maps = parameters.shape_maps[r], parameters.gain_maps[r]
        mapped = [
            problem.linearised(block, [name for name, _ in part])[1] @ each
            for part, each in zip(parameters.layout, maps, strict=True)
            if part
        ]
        raw.append(np.concatenate([*mapped, own[r]], axis=1))
        white.append(problem.whiten(raw[-1]))
    return np.concatenate(raw), np.concatenate(white)


class Point(NamedTuple):
    """The state of a fit at a position of its shapes.

    Attributes:
        blocks: each recording's block with the best gains.
        own: (Σq,) coefficients of the own terms.
        responses: each recording's response (L,) of its block.
        residual: (ΣL + priors,), whitened.
        basis: (ΣL + priors, gains + own), an orthonormal basis of the span of gains and own terms.
    """

    blocks: tuple[AbstractBlock, ...]
    own: np.ndarray
    responses: tuple[np.ndarray, ...]
    residual: np.ndarray
    basis: np.ndarray

    @property
    def cost(self) -> float:
        """χ², infinite where the simulation diverged."""
        return float(np.nan_to_num(self.residual @ self.residual, nan=np.inf, posinf=np.inf))


class Objective:
    """χ² of a block over the positions of its shapes, everything linear at its optimum.

    Priors are rows of the residual after those of the data.  `evaluations` counts the positions at
    which it was computed.
    """

    def __init__(
        self,
        block: AbstractBlock,
        problems: Sequence[Linearised],
        conditions: Conditions | None = None,
    ):
        self.block, self.problems = block, problems
        conditions = conditions or Conditions()
        self.parameters = free_parameters_of(block, len(problems), conditions)
        self.priors = prior_rows(self.parameters, conditions)
        self.gains = self.parameters.gains_of(block)
        own = own_columns(problems)
        self.white_own = [p.whiten(columns) for p, columns in zip(problems, own, strict=True)]
        self.evaluations = 0
        self._position, self._point, self._derivative = np.full(0, np.nan), None, None

    def at(self, position: np.ndarray) -> Point:
        """The state at a position (n,)."""
        if self._point is None or not np.array_equal(position, self._position):
            self._position, self._point = position.copy(), self._solve(position)
            self._derivative = None
        return self._point

    def _solve(self, position: np.ndarray) -> Point:
        """The state at a position, the linear parameters at their optimum."""
        self.evaluations += 1
        shapes = self.parameters.values_at(position)
        blocks = self.parameters.blocks(self.block, shapes, self.gains)
        names = [name for name, _ in self.parameters.layout.gains]
        columns, targets, parts = [], [], []
        for block, problem, white_own, gain_map in zip(
            blocks, self.problems, self.white_own, self.parameters.gain_maps, strict=True
        ):
            response, derivatives = problem.linearised(block, names)
            derivatives = derivatives @ gain_map
            columns.append(np.concatenate([problem.whiten(derivatives), white_own], axis=1))
            without = response - derivatives @ self.gains
            targets.append(problem.whiten(problem.response - without))
            parts.append((without, derivatives))
        prior, nothing = self.priors, np.zeros((len(self.priors.means), self.white_own[0].shape[1]))
        columns.append(np.concatenate([(prior.gains.T / prior.sds).T, nothing], axis=1))
        targets.append((prior.means - prior.shapes @ shapes) / prior.sds)
        solution, residual, basis = eliminate(np.concatenate(columns), np.concatenate(targets))
        count = self.gains.size
        blocks = self.parameters.blocks(self.block, shapes, solution[:count])
        responses = tuple(without + by_gain @ solution[:count] for without, by_gain in parts)
        return Point(blocks, solution[count:], responses, residual, basis)

    def residual(self, position: np.ndarray) -> np.ndarray:
        """The whitened residual (ΣL + priors,)."""
        return self.at(position).residual

    def derivative(self, position: np.ndarray) -> np.ndarray:
        """Kaufman's derivative (ΣL + priors, n) of the residual."""
        point = self.at(position)
        if self._derivative is None:
            self._derivative = self._differentiate(point, position)
        return self._derivative

    def _differentiate(self, point: Point, position: np.ndarray) -> np.ndarray:
        """Kaufman's derivative (ΣL + priors, n) at a state."""
        names = [name for name, _ in self.parameters.layout.shapes]
        columns = [
            problem.whiten(problem.linearised(block, names)[1] @ shape_map)
            for block, problem, shape_map in zip(
                point.blocks, self.problems, self.parameters.shape_maps, strict=True
            )
        ]
        rows = (self.priors.shapes.T / self.priors.sds).T
        shapes = self.parameters.values_at(position)
        moved = np.concatenate([*columns, rows]) * self.parameters.slopes(shapes)
        # A derivative near overflow, far outside a block's range, is no guide for the search.
        moved = np.where(np.abs(moved) < _OVERFLOWING, moved, 0.0)
        return point.basis @ (point.basis.T @ moved) - moved

    def reduced_residual(self, position: np.ndarray) -> np.ndarray:
        """The residual (n + 1,) in rotated coordinates: its norm, and n zeros."""
        return np.append(np.sqrt(self.at(position).cost), np.zeros(position.size))

    def reduced_derivative(self, position: np.ndarray) -> np.ndarray:
        """The derivative (n + 1, n) in the same coordinates, enough for a least-squares step."""
        together = np.column_stack([self.residual(position), self.derivative(position)])
        triangle = np.asarray(np.linalg.qr(together, mode="r"))
        return np.copysign(1.0, triangle[0, 0]) * triangle[:, 1:]

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The positions' lower and upper bounds (n,)."""
        return self.parameters.bounds()


class Descent(NamedTuple):
    """The state of the descent from one start.

    Attributes:
        objective: the function that is minimised.
        position: (n,) of the shapes.
        cost: χ² there.
        converged: whether it has converged.
    """

    objective: Objective
    position: np.ndarray
    cost: float
    converged: bool

    @property
    def evaluations(self) -> int:
        """The number of evaluations of the objective so far."""
        return self.objective.evaluations


def begin(start: AbstractBlock, problems: Sequence[Linearised], conditions: Conditions) -> Descent:
    """The descent from a start, before its first evaluation."""
    objective = Objective(start, problems, conditions)
    return Descent(objective, objective.parameters.position_of(start), np.inf, False)


def descend(at: Descent, evaluations: int) -> Descent:
    """The descent after up to `evaluations` more evaluations."""
    objective = at.objective
    first = objective.at(at.position)
    if at.position.size == 0 or not np.isfinite(first.cost):
        return at._replace(cost=first.cost, converged=bool(np.isfinite(first.cost)))
    # One evaluation shows whether a start that is the optimum of an earlier fit has converged.
    _, remainder, _ = eliminate(
        objective.reduced_derivative(at.position), objective.reduced_residual(at.position)
    )
    if first.cost - remainder @ remainder <= _RELATIVE * first.cost:
        return at._replace(cost=first.cost, converged=True)
    from scipy.optimize import least_squares  # stacks do without, and it takes long to import

    result = least_squares(
        objective.reduced_residual,
        at.position,
        objective.reduced_derivative,  # type: ignore[arg-type]
        bounds=objective.bounds(),
        x_scale="jac",
        ftol=_RELATIVE,
        xtol=_RELATIVE,
        gtol=None,  # type: ignore[arg-type]
        max_nfev=evaluations,
    )
    return at._replace(
        position=result.x,
        cost=2 * float(result.cost),
        converged=result.status > 0,
    )
