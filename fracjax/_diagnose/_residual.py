"""What a fit leaves over, and what it can absorb."""

from __future__ import annotations

import numpy as np

from .._fit import Preparation, Solved, orthonormal, sensitivity_of
from ._score import Residual


def errors_of(solved: Solved, preparation: Preparation) -> tuple[np.ndarray, np.ndarray]:
    """What a fit leaves (ΣL,) at the padded recordings' samples, as it is and whitened."""
    problems, errors = preparation.problems(), []
    for take, problem, simulation in zip(
        preparation.takes, problems, solved.simulations, strict=True
    ):
        error = np.zeros(problem.response.shape[0])
        error[: len(take.recording)] = take.recording.response - simulation
        errors.append(error)
    whitened = [problem.whiten(error) for problem, error in zip(problems, errors, strict=True)]
    return np.concatenate(errors), np.concatenate(whitened)


def residual_of(solved: Solved, preparation: Preparation) -> Residual:
    """Whitened residual and basis of a solved block."""
    return beside_fit(errors_of(solved, preparation)[1], solved, preparation)


def beside_fit(whitened: np.ndarray, solved: Solved, preparation: Preparation) -> Residual:
    """Whitened errors (ΣL,) without what a small change of a solved block's numbers absorbs."""
    basis = orthonormal(sensitivity_of(solved, preparation).whitened)
    return Residual(whitened - basis @ (basis.T @ whitened), basis)
