"""What a fit leaves over, and what it can absorb."""

from __future__ import annotations

import numpy as np

from .._fit import Preparation, Solved, orthonormal, sensitivity_of
from ._score import Residual


def residual_of(solved: Solved, preparation: Preparation) -> Residual:
    """Whitened residual and basis of a solved block."""
    problems = preparation.problems()
    whitened = []
    for take, problem, simulation in zip(
        preparation.takes, problems, solved.simulations, strict=True
    ):
        error = np.zeros(problem.response.shape[0])
        error[: len(take.recording)] = take.recording.response - simulation
        whitened.append(problem.whiten(error))
    basis = orthonormal(sensitivity_of(solved, preparation).whitened)
    residual = np.concatenate(whitened)
    return Residual(residual - basis @ (basis.T @ residual), basis)
