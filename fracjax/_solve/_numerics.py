"""Whether the simulation is exact enough to be held against the recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import Preparation, Problem
from ._elimination import orthonormal
from ._least_squares import simulate
from ._result import Progress, Solved
from ._solve import solve_from

FINEST, _MOST_SAMPLES = 32, 2**18
TARGET, LIMIT = 0.5, 1.0
_NEARLY = 1.5


def numerical_error(solved: Solved) -> float:
    """√λ_num: what halving the step changes beyond what the fit can absorb, in noise units.

    The order of the quadrature is four, so that the change is the coarser grid's error to 7 %.
    """
    return _halved_until(np.inf, solved)[1]


def tolerated(limit: float, solved: Solved, share: float) -> float:
    """The numerical error that is let be: a limit in noise units, or a share of what the fit leaves
    beyond the noise, where that is more."""
    return max(limit, share * float(np.sqrt(max(0.0, solved.cost - solved.samples))))


def fine_enough(solved: Solved, progress: Progress, share: float = 0.0) -> tuple[Solved, float]:
    """Refine the grid until the numerical error is far under the noise, or under a share of what
    the fit leaves beyond it, or the grid is finest; the fit there, and that error."""
    while True:
        steps = solved.preparation.oversampling
        progress(f"checking the numerics with {steps} steps per sample")
        finer, error = _halved_until(tolerated(TARGET, solved, share), solved)
        if finer is solved.preparation:
            return solved, error
        solved = solve_from([solved.block], finer)


def too_coarse(error: float) -> tuple[str, ...]:
    """What a numerical error says against a fit on the finest grid that was tried."""
    if error <= TARGET:
        return ()
    return (
        f"The discretisation error is {error:.2g} noise units (target {TARGET:g}) on the finest "
        "grid: a higher sampling rate of the drive would help.",
    )


def _halved_until(target: float, solved: Solved) -> tuple[Preparation, float]:
    """The coarsest grid, from the one at hand on, whose numerical error is at most the target; and
    that error, of the solved blocks as they are.

    Where no grid is so fine, the coarsest that is nearly as good as any: at a kink that meets a
    sample a fractional derivative hardly converges, and many small steps would gain nothing.
    """
    preparation = solved.preparation
    problems = preparation.problems()
    basis = orthonormal(solved.sensitivity().whitened)
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
            enough = least * _NEARLY if least > LIMIT else min(LIMIT, least * _NEARLY)
            return next(grid for grid in grids if grid[1] <= enough)
        preparation, coarse = finer, halved


def _whitened(blocks: Sequence[AbstractBlock], problems: Sequence[Problem]) -> np.ndarray:
    """Whitened simulations (ΣL,)."""
    pairs = zip(blocks, problems, strict=True)
    return np.concatenate([problem.whiten(simulate(block, problem)) for block, problem in pairs])
