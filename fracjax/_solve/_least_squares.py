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
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.optimize import least_squares

from .._blocks import AbstractBlock
from .._prepare import Conditions, Numbers, Problem, numbers_of, own_columns, prior_rows
from ._elimination import eliminated

_RELATIVE = 1e-8
_OVERFLOWING = 1e100


class Linearised(Protocol):
    """What a least-squares problem tells of a block: a recording, or a measured frequency response.

    response (L,), own terms (L, q), and the weights (L,) that whiten them.
    """

    @property
    def response(self) -> Any: ...

    @property
    def own(self) -> Any: ...

    @property
    def weights(self) -> Any: ...

    @property
    def size(self) -> float:
        """Length of the whitened response about its mean."""
        ...

    def linearised(
        self, block: AbstractBlock, names: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Response (L,) and its derivatives (L, Σ size) with respect to the named parameters."""
        ...

    def whiten(self, signals: Any) -> Any:
        """Signals (L, …) in units of the noise."""
        ...


def simulate(block: AbstractBlock, problem: Problem) -> np.ndarray:
    """The block's response (L,) at a recording's samples."""
    return block.respond(np.asarray(problem.drive), problem.grid)[:: problem.oversampling]


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


def jacobian(block: AbstractBlock, problems: tuple[Problem, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Derivative (ΣL, shapes + gains + own) of the simulation in physical values: as it is, and
    whitened with left-out samples zero."""
    numbers = numbers_of(block, len(problems), Conditions())
    return sensitivity([block] * len(problems), problems, numbers)


def sensitivity(
    blocks: Sequence[AbstractBlock],
    problems: Sequence[Linearised],
    numbers: Numbers,
) -> tuple[np.ndarray, np.ndarray]:
    """Derivative (ΣL, numbers + own) of the simulation in the values of a fit's numbers, one block
    per recording: as it is, and whitened."""
    own, raw, white = own_columns(problems), [], []
    shapes, gains = ([name for name, _ in part] for part in numbers.layout)
    count = sum(size for _, size in numbers.layout.shapes)
    for r, (block, problem) in enumerate(zip(blocks, problems, strict=True)):
        found = problem.linearised(block, shapes + gains)[1]
        mapped = found[:, :count] @ numbers.shape_maps[r], found[:, count:] @ numbers.gain_maps[r]
        raw.append(np.concatenate([*mapped, own[r]], axis=1))
        white.append(problem.whiten(raw[-1]))
    return np.concatenate(raw), np.concatenate(white)


class Point(NamedTuple):
    """Every recording's block with the best gains, the own coefficients (Σq,), the whitened
    residual (ΣL + priors,), and an orthonormal basis (ΣL + priors, gains + own) of what gains and
    own terms span."""

    blocks: tuple[AbstractBlock, ...]
    own: np.ndarray
    residual: np.ndarray
    basis: np.ndarray

    @property
    def cost(self) -> float:
        """χ², infinite where the simulation broke down."""
        return float(np.nan_to_num(self.residual @ self.residual, nan=np.inf, posinf=np.inf))


class Objective:
    """χ² of a block over the positions of its shapes, everything linear at its best.

    Priors are rows of the residual after the data's.  It counts its `evaluations`.
    """

    def __init__(
        self,
        block: AbstractBlock,
        problems: Sequence[Linearised],
        conditions: Conditions | None = None,
    ):
        self.block, self.problems = block, problems
        asked = conditions or Conditions()
        self.numbers = numbers_of(block, len(problems), asked)
        self.priors = prior_rows(self.numbers, asked)
        self.gains = self.numbers.gains_of(block)
        own = own_columns(problems)
        self.white_own = [p.whiten(columns) for p, columns in zip(problems, own, strict=True)]
        self.evaluations = 0
        self._position, self._point, self._derivative = np.full(0, np.nan), None, None

    def at(self, position: np.ndarray) -> Point:
        """The point at a position (n,)."""
        if self._point is None or not np.array_equal(position, self._position):
            self._position, self._point = position.copy(), self._solve(position)
            self._derivative = None
        return self._point

    def _solve(self, position: np.ndarray) -> Point:
        self.evaluations += 1
        shapes = self.numbers.values_at(position)
        blocks = self.numbers.blocks(self.block, shapes, self.gains)
        names = [name for name, _ in self.numbers.layout.gains]
        columns, targets = [], []
        for block, problem, white_own, gain_map in zip(
            blocks, self.problems, self.white_own, self.numbers.gain_maps, strict=True
        ):
            response, found = problem.linearised(block, names)
            found = found @ gain_map
            columns.append(np.concatenate([problem.whiten(found), white_own], axis=1))
            targets.append(problem.whiten(problem.response - response + found @ self.gains))
        prior, nothing = self.priors, np.zeros((len(self.priors.means), self.white_own[0].shape[1]))
        columns.append(np.concatenate([(prior.gains.T / prior.sds).T, nothing], axis=1))
        targets.append((prior.means - prior.shapes @ shapes) / prior.sds)
        solution, residual, basis = eliminated(np.concatenate(columns), np.concatenate(targets))
        count = self.gains.size
        blocks = self.numbers.blocks(self.block, shapes, solution[:count])
        return Point(blocks, solution[count:], residual, basis)

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
        names = [name for name, _ in self.numbers.layout.shapes]
        columns = [
            problem.whiten(problem.linearised(block, names)[1] @ shape_map)
            for block, problem, shape_map in zip(
                point.blocks, self.problems, self.numbers.shape_maps, strict=True
            )
        ]
        rows = (self.priors.shapes.T / self.priors.sds).T
        shapes = self.numbers.values_at(position)
        moved = np.concatenate([*columns, rows]) * self.numbers.slopes(shapes)
        # A derivative near overflow, far outside a law's range, tells the search nothing.
        moved = np.where(np.abs(moved) < _OVERFLOWING, moved, 0.0)
        return point.basis @ (point.basis.T @ moved) - moved

    def length(self, position: np.ndarray) -> np.ndarray:
        """The residual turned into its own direction: its length, and n zeros."""
        return np.append(np.sqrt(self.at(position).cost), np.zeros(position.size))

    def turned(self, position: np.ndarray) -> np.ndarray:
        """The derivative (n + 1, n) turned with it, all that a least-squares step depends on."""
        together = np.column_stack([self.residual(position), self.derivative(position)])
        triangle = np.asarray(np.linalg.qr(together, mode="r"))
        return np.copysign(1.0, triangle[0, 0]) * triangle[:, 1:]

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The positions' bounds (n,)."""
        return self.numbers.bounds()


class Descent(NamedTuple):
    """Where one start has come: position (n,), χ², and whether it is there."""

    objective: Objective
    position: np.ndarray
    cost: float
    converged: bool

    @property
    def evaluations(self) -> int:
        return self.objective.evaluations


def begin(start: AbstractBlock, problems: Sequence[Linearised], conditions: Conditions) -> Descent:
    """A start, not yet looked at."""
    objective = Objective(start, problems, conditions)
    return Descent(objective, objective.numbers.position_of(start), np.inf, False)


def descend(at: Descent, looks: int) -> Descent:
    """Up to `looks` evaluations further."""
    objective = at.objective
    first = objective.at(at.position)
    if at.position.size == 0 or not np.isfinite(first.cost):
        return at._replace(cost=first.cost, converged=bool(np.isfinite(first.cost)))
    # A fit that begins where another ended, or on another scale, is told so by one look.
    _, left, _ = eliminated(objective.turned(at.position), objective.length(at.position))
    if first.cost - left @ left <= _RELATIVE * first.cost:
        return at._replace(cost=first.cost, converged=True)
    found = least_squares(
        objective.length,
        at.position,
        objective.turned,  # type: ignore[arg-type]
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
        converged=found.status > 0,
    )
