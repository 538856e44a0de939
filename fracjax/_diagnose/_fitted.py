"""A block fitted to recordings on a coarse grid, corrected for that grid's error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from .._blocks import AbstractBlock
from .._computing import time_is_over
from .._parameters import Parameter, named_parameters
from .._prepare import Preparation, Problem, Residual, layout_of
from .._solve import Solved, orthonormal_basis, simulate, solve_from, tolerated_error

_FINEST, _MOST_SAMPLES = 32, 2**18
"""The finest oversampling, and the longest recording on that grid; chosen by judgement."""
_RENEWALS, _ENOUGH, _TOLERATED = 2, 0.25, 1.0
"""How often the fit is renewed on one grid, the change of the correction, in noise units, below
which it is not, and that below which the grid is kept; chosen by judgement."""
_FREE = 1e3
"""Prior sd of free coefficients, in standard errors."""
_OF_MISFIT = 0.01
"""The change that is accepted, over the residual's norm beyond the noise, if that is more; chosen
by judgement."""


@dataclass(frozen=True)
class Corrected(Preparation):
    """A preparation on a coarse grid with corrected responses.

    `defects` (L,), one per recording: the simulation on a fine grid minus that on the coarse one,
    subtracted from the response.
    """

    defects: tuple[np.ndarray, ...] = ()

    @property
    def uncorrected(self) -> Preparation:
        """The preparation for a block of another law, whose grid errs otherwise."""
        return Preparation(**_own_fields(self))

    def problems(self, oversampling: int | None = None) -> tuple[Problem, ...]:
        if oversampling not in (None, self.oversampling):
            return super().problems(oversampling)
        return self._corrected

    @cached_property
    def _corrected(self) -> tuple[Problem, ...]:
        corrected = []
        for k, problem in enumerate(super().problems()):
            parts = {name: getattr(problem, name) for name in Problem.__dataclass_fields__}
            parts["response"] = problem.response - self.defects[k]
            corrected.append(Problem(**parts))
        return tuple(corrected)


@dataclass(frozen=True, eq=False)
class Fitted:
    """A block at its optimum, the preparation that it was fitted under, and the oversampling of the
    finest grid."""

    solved: Solved
    preparation: Corrected
    finest: int

    @property
    def problems(self) -> tuple[Problem, ...]:
        """One problem per recording, on the coarse grid."""
        return self.preparation.problems()

    @cached_property
    def error(self) -> np.ndarray:
        """Measured minus simulated (ΣL,), at the padded recordings' samples, in the response's
        unit."""
        errors = []
        pairs = zip(self.preparation.takes, self.simulations, self.problems, strict=True)
        for take, simulation, problem in pairs:
            error = np.zeros(len(problem.response))
            error[: len(take.recording)] = take.recording.response - simulation
            errors.append(error)
        return np.concatenate(errors)

    @cached_property
    def simulations(self) -> tuple[np.ndarray, ...]:
        """The simulations (N,) of the fine grid."""
        pairs = zip(self.solved.simulations, self.preparation.defects, strict=True)
        return tuple(simulation + defect[: simulation.size] for simulation, defect in pairs)

    @property
    def residuals(self) -> list[Residual]:
        """What it leaves of each recording, from which a noise may be read."""
        pairs = zip(self.preparation.takes, self.simulations, strict=True)
        return [Residual(t.recording.response - s, t.used, t.recording) for t, s in pairs]

    @cached_property
    def counted(self) -> np.ndarray:
        """Which of the padded recordings' samples (ΣL,) the fit counts."""
        return np.concatenate([np.asarray(problem.weights) for problem in self.problems]) > 0

    @property
    def displaced(self) -> dict[str, Parameter]:
        """The fitted shapes that ended outside their usual range, by name."""
        block = self.solved.block
        parameters = named_parameters(block)
        shapes = {name: parameters[name] for name, _ in layout_of(block).shapes}
        return {name: p for name, p in shapes.items() if not p.is_plausible}

    @cached_property
    def tangent(self) -> np.ndarray:
        """Derivatives (ΣL, P) of the simulations with respect to the free parameters."""
        return self.solved.on(self.preparation).sensitivity().raw

    @cached_property
    def free_directions(self) -> np.ndarray:
        """The tangent (ΣL, P), scaled so that coefficients of unit prior sd are in effect free."""
        lengths = np.linalg.norm(self.whitened(self.tangent), axis=0) + 1e-300
        return _FREE * self.tangent / lengths

    def whitened(self, signals: np.ndarray) -> np.ndarray:
        """Signals (ΣL, …) through each recording's whitening filter."""
        ends = np.cumsum([len(problem.response) for problem in self.problems])
        parts = np.split(signals, ends[:-1])
        pairs = zip(self.problems, parts, strict=True)
        return np.concatenate([Problem.whiten(problem, part) for problem, part in pairs])

    @cached_property
    def numerics(self) -> float:
        """√λ_num: the finest grid's error minus what the fit can absorb, in noise units."""
        coarser = max(self.finest // 2, self.preparation.oversampling)
        fine, half = (
            np.concatenate(_simulated(self.solved, self.preparation, grid))
            for grid in (self.finest, coarser)
        )
        error, basis = self.whitened(fine - half), orthonormal_basis(self.whitened(self.tangent))
        return float(np.linalg.norm(error - basis @ (basis.T @ error)))


def fitted(
    starts: Sequence[AbstractBlock],
    preparation: Preparation,
    aim: float = np.inf,
) -> Fitted:
    """Fit from the starts on the coarse grid; the change of the simulation by a fine grid is
    subtracted from the responses and the fit renewed, until the change is constant within the
    noise, or within a small share of the misfit.  If renewals do not achieve that, the grid is
    refined.  A fit that does not come down to a χ² of `aim` is left where that shows.

    Source: Stetter, Numer. Math. 29 (1978) 425 (defect correction).
    """
    longest = max(len(take.recording) for take in preparation.takes)
    finest = preparation.oversampling
    while 2 * finest <= _FINEST and 2 * finest * longest <= _MOST_SAMPLES:
        finest *= 2
    nothing = tuple(np.zeros(len(p.response)) for p in preparation.problems())
    coarse = Corrected(**_own_fields(preparation), defects=nothing)
    if isinstance(preparation, Corrected):
        coarse = replace(coarse, defects=preparation.defects)
    solved = solve_from(list(starts), coarse, aim)
    coarse, change = _renewed(solved, coarse, finest)

    def settles(limit: float) -> bool:
        # A correction takes no more from the residual than its own length.
        if time_is_over() or np.sqrt(solved.cost) - change > np.sqrt(aim):
            return True
        return change <= tolerated_error(limit, solved, _OF_MISFIT)

    while not settles(_ENOUGH):
        for _ in range(_RENEWALS):
            solved = solve_from([solved.block], coarse)
            coarse, change = _renewed(solved, coarse, finest)
            if settles(_ENOUGH):
                break
        if settles(_TOLERATED) or 2 * coarse.oversampling > finest:
            break
        # The grid is too coarse for its own Jacobian, such as with a mode that rings.
        coarse = replace(coarse, oversampling=2 * coarse.oversampling, defects=nothing)
        solved = solve_from([solved.block, *starts], coarse)
        coarse, change = _renewed(solved, coarse, finest)
    return Fitted(solved, coarse, finest)


def _own_fields(preparation: Preparation) -> dict[str, Any]:
    """What a preparation holds before its correction, by name."""
    return {name: getattr(preparation, name) for name in Preparation.__dataclass_fields__}


def _renewed(solved: Solved, coarse: Corrected, finest: int) -> tuple[Corrected, float]:
    """The preparation with the defects of simulations on the coarse grid, and their change, in
    noise units."""
    exact, problems = _simulated(solved, coarse, finest), coarse.problems()
    defects = [
        fine - simulate(block, problem)
        for fine, block, problem in zip(exact, solved.blocks, problems, strict=True)
    ]
    changes = [
        p.whiten(new - old) for p, new, old in zip(problems, defects, coarse.defects, strict=True)
    ]
    change = float(np.linalg.norm(np.concatenate(changes)))
    return replace(coarse, defects=tuple(defects)), change


def _simulated(solved: Solved, preparation: Preparation, oversampling: int) -> list[np.ndarray]:
    """Simulations (L,) of the solved blocks on a finer grid."""
    problems = Preparation.problems(preparation, oversampling)
    return [simulate(block, p) for block, p in zip(solved.blocks, problems, strict=True)]
