"""The result of solving."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import FreeParameter, Preparation, free_parameters_of, kurtosis_of
from ._least_squares import sensitivity

Progress = Callable[[str], None]


def silent(message: str) -> None:
    """Report no progress."""


class Sensitivity(NamedTuple):
    """The derivative of the simulations with respect to a fit's free parameters.

    Attributes:
        parameters: the free parameters, shapes and then gains.
        raw: (ΣL, parameters + own).
        whitened: (ΣL, parameters + own), in units of the noise.
    """

    parameters: tuple[FreeParameter, ...]
    raw: np.ndarray
    whitened: np.ndarray


@dataclass(frozen=True)
class Solved:
    """A block at its optimum on the recordings that it was fitted to.

    Attributes:
        preparation: the recordings with noise, weights and conditions.
        block: the first recording's block.
        own: per recording (q,) coefficients of its own terms, its offset first.
        simulations: per recording (N,) the response, own terms included.
        cost: χ².
        converged: whether the fit has converged.
        start_costs: χ² at the end of each start.
        samples: the number of samples that count.
        evaluations: how often the objective was computed, over all starts.
        blocks: each recording's block.
        whitened: per recording (L,) the whitened residual.
        free: the number of free parameters, own terms included.
        derivative: computes (p, L), the derivative of the simulation by each free parameter, where
            it was solved in a stack; None elsewhere.
        triangle: (parameters + own)², with the inner products of the whitened derivative, where it
            was solved in a stack; None elsewhere.
    """

    preparation: Preparation
    block: AbstractBlock
    own: tuple[np.ndarray, ...]
    simulations: tuple[np.ndarray, ...]
    cost: float
    converged: bool
    start_costs: tuple[float, ...]
    samples: int
    evaluations: int
    blocks: tuple[AbstractBlock, ...]
    whitened: tuple[np.ndarray, ...]
    free: int
    derivative: Callable[[], np.ndarray] | None = None
    triangle: np.ndarray | None = None

    @property
    def kurtosis(self) -> float:
        """The kurtosis of the whitened residual, 3 where it is normal."""
        residual = np.concatenate(self.whitened)
        return kurtosis_of(residual[residual != 0])

    @property
    def excess_ratio(self) -> float:
        """χ² per sample, at least 1: the ratio of the residual's variance to the noise's."""
        return max(1.0, self.cost / self.samples)

    @property
    def bic(self) -> float:
        """χ² + k ln n, the noise being known."""
        return self.cost + self.free * float(np.log(self.samples))

    def on(self, preparation: Preparation) -> Solved:
        """The same optimum with other recordings, or with the same under other weights."""
        return replace(self, preparation=preparation, derivative=None, triangle=None)

    def scaled(self, preparation: Preparation, scale: float) -> Solved:
        """The same optimum where another noise multiplies all whitened residuals by a factor."""
        return replace(
            self,
            preparation=preparation,
            cost=scale**2 * self.cost,
            whitened=tuple(scale * residual for residual in self.whitened),
            start_costs=tuple(scale**2 * cost for cost in self.start_costs),
            triangle=None if self.triangle is None else scale * self.triangle,
        )

    @property
    def stacked(self) -> bool:
        """Whether it was solved in a stack."""
        return self.derivative is not None

    def whitened_derivative(self) -> np.ndarray:
        """The whitened derivative (ΣL, parameters + own)."""
        return self._whitened_derivative

    @cached_property
    def _whitened_derivative(self) -> np.ndarray:
        """The derivative of `whitened_derivative`, which several stages need."""
        if self.derivative is None:
            return self.sensitivity().whitened
        (problem,) = self.preparation.problems()
        return problem.whiten(np.concatenate([self.derivative(), problem.own.T]).T)

    def sensitivity(self) -> Sensitivity:
        """The derivative of the simulations with respect to each free parameter."""
        problems = self.preparation.problems()
        parameters = free_parameters_of(self.block, len(problems), self.preparation.conditions)
        raw, whitened = sensitivity(self.blocks, problems, parameters)
        return Sensitivity(parameters.shapes + parameters.gains, raw, whitened)
