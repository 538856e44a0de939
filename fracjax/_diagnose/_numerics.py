"""Whether the simulation is exact enough to be held against the recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._blocks import AbstractBlock
from .._fit import (
    Preparation,
    Progress,
    Solved,
    jacobian,
    orthonormal,
    simulate_all,
    solve_from,
)
from ._score import Residual

FINEST, _MOST_SAMPLES = 16, 2**18
TARGET, LIMIT = 0.5, 1.0


def numerical_error(block: AbstractBlock, preparation: Preparation, basis: np.ndarray) -> float:
    """√λ_num: what halving the step changes beyond what the fit can absorb, in noise units.

    The order of the quadrature is four, so that the change is the coarser grid's error to 7 %.
    """
    fine = replace(preparation, oversampling=2 * preparation.oversampling)
    coarse = simulate_all([block], preparation.problems())[1][0]
    halved = simulate_all([block], fine.problems())[1][0]
    change = halved - coarse
    return float(np.linalg.norm(change - basis @ (basis.T @ change)))


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
    basis = orthonormal(jacobian(solved.block, problems)[1])
    residual = np.concatenate(whitened)
    return Residual(residual - basis @ (basis.T @ residual), basis)


def fine_enough(
    solved: Solved, preparation: Preparation, progress: Progress
) -> tuple[Solved, Preparation, float]:
    """Refine the grid until the numerical error is far under the noise, or the grid is finest."""
    while True:
        progress(f"checking the numerics with {preparation.oversampling} steps per sample")
        basis = residual_of(solved, preparation).basis
        error = numerical_error(solved.block, preparation, basis)
        longest = max(len(take.recording) for take in preparation.takes)
        doubled = 2 * preparation.oversampling
        finest = doubled > FINEST or doubled * longest > _MOST_SAMPLES
        if error <= TARGET or finest:
            return solved, preparation, error
        preparation = preparation.with_oversampling(doubled)
        solved = solve_from([solved.block], preparation)
