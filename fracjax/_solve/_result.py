"""What solving ends with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.stats import kurtosis

from .._blocks import AbstractBlock
from .._prepare import Number, Preparation, numbers_of
from ._least_squares import sensitivity

Progress = Callable[[str], None]


def silent(message: str) -> None:
    """Report no progress."""


class Sensitivity(NamedTuple):
    """Derivative (ΣL, numbers + own) of a simulation in a fit's numbers, and whitened."""

    numbers: tuple[Number, ...]
    raw: np.ndarray
    whitened: np.ndarray


@dataclass(frozen=True)
class Solved:
    """A block at its optimum on the recordings that it was fitted to, χ² and convergence.

    `own`: each recording's own coefficients (q,), its offset first; `simulations` (N,) hold them.
    `evaluations` counts how often the objective was computed, over all starts.  `blocks` are every
    recording's own (`block` the first's), `whitened` residuals (L,), `free` how many numbers were
    fitted.
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

    @property
    def kurtosis(self) -> float:
        """Of the whitened residual: 3 where it is normal."""
        residual = np.concatenate(self.whitened)
        return float(kurtosis(residual[residual != 0], fisher=False))

    @property
    def left(self) -> float:
        """χ² per sample where something is left beyond the noise, else 1."""
        return max(1.0, self.cost / self.samples)

    @property
    def bic(self) -> float:
        """χ² + k ln n, the noise known."""
        return self.cost + self.free * float(np.log(self.samples))

    def on(self, preparation: Preparation) -> Solved:
        """The same optimum beside other recordings, or the same under other weights."""
        return replace(self, preparation=preparation)

    def sensitivity(self) -> Sensitivity:
        """What a small change of each fitted parameter makes of the simulations."""
        problems = self.preparation.problems()
        numbers = numbers_of(self.block, len(problems), self.preparation.conditions)
        raw, whitened = sensitivity(self.blocks, problems, numbers)
        return Sensitivity(numbers.shapes + numbers.gains, raw, whitened)
