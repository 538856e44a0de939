"""Whether the simulation is accurate enough to be compared with the recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._prepare import Preparation, Problem
from ._least_squares import simulate
from ._result import Progress, Solved
from ._solve import solve_again
from ._stack import respond_rows

FINEST = 32
"""Most steps per sample."""
_MOST_SAMPLES = 2**18
"""Most steps of a simulation, which limits time and memory."""
TARGET = 0.5
"""Numerical error [noise units] at which refinement ends: it adds at most 0.25 to χ²."""
LIMIT = 1.0
"""Numerical error [noise units] above which a fit is not compared with others.  Chosen by
judgement."""
_DEPENDENT = 1e-13
"""Eigenvalues of JᵀJ below this share of the largest are rounding."""
_NEARLY_BEST = 1.5
"""Largest ratio of an error to that of the best grid, where no grid reaches the target.  Chosen by
judgement."""


def numerical_error(solved: Solved) -> float:
    """√λ_num: the change when the step is halved, minus what the fit can absorb, in noise units.

    The quadrature is of order four, so that this change is the coarser grid's error to 7 %.
    """
    return _halved_until(np.inf, solved, *_halved([solved]))[1]


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
    return refine_all([solved], progress, [share])[0]


def refine_all(
    solved: Sequence[Solved], progress: Progress, shares: Sequence[float]
) -> list[tuple[Solved, float]]:
    """Each fit on a grid that is fine enough, as `refine_until_accurate` finds it for its share.

    Only those whose grid is too coarse are fitted again.
    """
    fits, errors = list(solved), [np.inf] * len(solved)
    coarse = list(range(len(fits)))
    while coarse:
        steps = max(fits[at].preparation.oversampling for at in coarse)
        progress(f"checking the numerical error with {steps} steps per sample")
        halved = _halved([fits[at] for at in coarse])
        refined: list[tuple[int, Preparation]] = []
        for at, first in zip(coarse, halved, strict=True):
            finer, errors[at] = _halved_until(
                tolerated_error(TARGET, fits[at], shares[at]), fits[at], first
            )
            if finer is not fits[at].preparation:
                refined.append((at, finer))
        coarse = [at for at, _ in refined]
        again = solve_again([fits[at] for at in coarse], [finer for _, finer in refined])
        for at, one in zip(coarse, again, strict=True):
            fits[at] = one
    return list(zip(fits, errors, strict=True))


def discretisation_warnings(error: float, tolerated: float = TARGET) -> tuple[str, ...]:
    """Warnings about a numerical error that remains on the finest grid that was tried."""
    if error <= tolerated:
        return ()
    return (
        f"The discretisation error is {error:.2g} noise units (target {TARGET:g}) on the finest "
        "grid: a higher sampling rate of the drive would help.",
    )


def _halved(solved: Sequence[Solved]) -> list[np.ndarray]:
    """Each fit's whitened simulation (ΣL,) with half its step; those of stacks together."""
    finer = [one.preparation.problems(2 * one.preparation.oversampling) for one in solved]
    stacked = [at for at, one in enumerate(solved) if one.stacked]
    responses = respond_rows([solved[at].block for at in stacked], [finer[at][0] for at in stacked])
    together = dict(zip(stacked, responses, strict=True))
    return [
        problems[0].whiten(together[at]) if one.stacked else _whitened(one, problems)
        for at, (one, problems) in enumerate(zip(solved, finer, strict=True))
    ]


def _halved_until(target: float, solved: Solved, halved: np.ndarray) -> tuple[Preparation, float]:
    """The coarsest grid, from the present one on, that reaches the target, and its numerical error.

    `halved` (ΣL,) is the whitened simulation with half the present step.

    The error is that of the solved blocks, without a new fit.  If no grid reaches the target, it is
    the coarsest that is nearly as accurate as any: a fractional derivative hardly converges at a
    kink that meets a sample, and many small steps would not help.
    """
    preparation = solved.preparation
    derivative = solved.whitened_derivative()
    derivative = derivative / (np.linalg.norm(derivative, axis=0) + 1e-300)
    square = derivative.T @ derivative
    longest = max(len(take.recording) for take in preparation.takes)
    coarse = _present(solved)
    grids: list[tuple[Preparation, float]] = []
    while True:
        doubled = 2 * preparation.oversampling
        change = halved - coarse
        absorbed = np.linalg.lstsq(square, derivative.T @ change, rcond=_DEPENDENT)[0]
        unabsorbed = np.linalg.norm(change - derivative @ absorbed)
        error = float(np.nan_to_num(unabsorbed, nan=np.inf))
        grids.append((preparation, error))
        if error <= target:
            return preparation, error
        if doubled > FINEST or doubled * longest > _MOST_SAMPLES:
            least = min(error for _, error in grids)
            enough = least * _NEARLY_BEST if least > LIMIT else min(LIMIT, least * _NEARLY_BEST)
            return next(grid for grid in grids if grid[1] <= enough)
        preparation, coarse = preparation.with_oversampling(doubled), halved
        halved = _whitened(solved, preparation.problems(2 * doubled))


def _present(solved: Solved) -> np.ndarray:
    """A fit's whitened simulation (ΣL,) on its own grid, own terms left out or absorbed anyway."""
    problems = solved.preparation.problems()
    if not solved.stacked:
        return _whitened(solved, problems)
    (problem,), (simulation,) = problems, solved.simulations
    return problem.whiten(np.pad(simulation, (0, len(problem.response) - len(simulation))))


def _whitened(solved: Solved, problems: Sequence[Problem]) -> np.ndarray:
    """A fit's whitened simulations (ΣL,) on the grids of these problems."""
    if solved.stacked:
        responses = respond_rows(solved.blocks, problems)
    else:
        responses = map(simulate, solved.blocks, problems)
    pairs = zip(responses, problems, strict=True)
    return np.concatenate([problem.whiten(response) for response, problem in pairs])
