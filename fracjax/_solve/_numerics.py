"""Whether the simulation is accurate enough to be compared with the recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import Preparation, Problem
from ._elimination import orthonormal_basis
from ._least_squares import simulate
from ._result import Progress, Solved
from ._solve import solve_from

FINEST = 32
"""Most steps per sample."""
_MOST_SAMPLES = 2**18
"""Most steps of a simulation, which limits time and memory."""
TARGET = 0.5
"""Numerical error [noise units] at which refinement ends: it adds at most 0.25 to χ²."""
LIMIT = 1.0
"""Numerical error [noise units] above which a fit is not compared with others.  Chosen by
judgement."""
_NEARLY_BEST = 1.5
"""Largest ratio of an error to that of the best grid, where no grid reaches the target.  Chosen by
judgement."""


def numerical_error(solved: Solved) -> float:
    """√λ_num: the change when the step is halved, minus what the fit can absorb, in noise units.

    The quadrature is of order four, so that this change is the coarser grid's error to 7 %.
    """
    return _halved_until(np.inf, solved)[1]


def tolerated_error(limit: float, solved: Solved, share: float) -> float:
    """The largest numerical error that is accepted, in noise units.

    It is `limit`, or, if that is more, a share of the residual's norm beyond the noise.
    """
    return max(limit, share * float(np.sqrt(max(0.0, solved.cost - solved.samples))))


def refine_until_accurate(
    solved: Solved, progress: Progress, share: float = 0.0
) -> tuple[Solved, float]:
    """The fit on a grid that is fine enough, and its numerical error in noise units.

    The grid is refined until the error is far below the noise, or below a share of the residual
    beyond the noise, or the grid is the finest.
    """
    while True:
        steps = solved.preparation.oversampling
        progress(f"checking the numerical error with {steps} steps per sample")
        finer, error = _halved_until(tolerated_error(TARGET, solved, share), solved)
        if finer is solved.preparation:
            return solved, error
        solved = solve_from([solved.block], finer)


def discretisation_warnings(error: float, tolerated: float = TARGET) -> tuple[str, ...]:
    """Warnings about a numerical error that remains on the finest grid that was tried."""
    if error <= tolerated:
        return ()
    return (
        f"The discretisation error is {error:.2g} noise units (target {TARGET:g}) on the finest "
        "grid: a higher sampling rate of the drive would help.",
    )


def _halved_until(target: float, solved: Solved) -> tuple[Preparation, float]:
    """The coarsest grid, from the present one on, that reaches the target, and its numerical error.

    The error is that of the solved blocks, without a new fit.  If no grid reaches the target, it is
    the coarsest that is nearly as accurate as any: a fractional derivative hardly converges at a
    kink that meets a sample, and many small steps would not help.
    """
    preparation = solved.preparation
    problems = preparation.problems()
    basis = orthonormal_basis(solved.sensitivity().whitened)
    longest = max(len(take.recording) for take in preparation.takes)
    coarse = _whitened(solved.blocks, problems)
    grids: list[tuple[Preparation, float]] = []
    while True:
        doubled = 2 * preparation.oversampling
        finer = preparation.with_oversampling(doubled)
        halved = _whitened(solved.blocks, finer.problems())
        change = halved - coarse
        unabsorbed = np.linalg.norm(change - basis @ (basis.T @ change))
        error = float(np.nan_to_num(unabsorbed, nan=np.inf))
        grids.append((preparation, error))
        if error <= target:
            return preparation, error
        if doubled > FINEST or doubled * longest > _MOST_SAMPLES:
            least = min(error for _, error in grids)
            enough = least * _NEARLY_BEST if least > LIMIT else min(LIMIT, least * _NEARLY_BEST)
            return next(grid for grid in grids if grid[1] <= enough)
        preparation, coarse = finer, halved


def _whitened(blocks: Sequence[AbstractBlock], problems: Sequence[Problem]) -> np.ndarray:
    """Whitened simulations (ΣL,)."""
    pairs = zip(blocks, problems, strict=True)
    return np.concatenate([problem.whiten(simulate(block, problem)) for block, problem in pairs])
