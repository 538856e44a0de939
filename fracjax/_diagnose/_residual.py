"""The residual of a fit, and the changes that the fit can absorb."""

from __future__ import annotations

import numpy as np

from .._solve import Solved, orthonormal_basis
from ._score import Residual


def errors_of(solved: Solved) -> tuple[np.ndarray, np.ndarray]:
    """The errors of a fit (ΣL,) at the samples of the padded recordings, in the response's unit and
    whitened."""
    takes, problems, errors = solved.preparation.takes, solved.preparation.problems(), []
    for take, problem, simulation in zip(takes, problems, solved.simulations, strict=True):
        error = np.zeros(problem.response.shape[0])
        error[: len(take.recording)] = take.recording.response - simulation
        errors.append(error)
    whitened = [problem.whiten(error) for problem, error in zip(problems, errors, strict=True)]
    return np.concatenate(errors), np.concatenate(whitened)


def residual_of(solved: Solved) -> Residual:
    """Whitened residual and basis of a solved block."""
    return beside_fit(errors_of(solved)[1], solved)


def beside_fit(whitened: np.ndarray, solved: Solved) -> Residual:
    """Whitened errors (ΣL,) minus what a small change of the fit's parameters absorbs."""
    basis = orthonormal_basis(solved.sensitivity().whitened)
    return Residual(whitened - basis @ (basis.T @ whitened), basis)
