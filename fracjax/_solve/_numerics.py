"""Whether the simulation is accurate enough to be compared with the recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._prepare import Preparation, Problem
from ._elimination import eliminate
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


def tolerated_error(limit: float, solved: Solved, share: float) -> float:
    """The largest numerical error that is accepted, in noise units.

    It is `limit`, or, if that is more, a share of the residual's norm beyond the noise.
    """
    return max(limit, share * float(np.sqrt(max(0.0, solved.cost - solved.samples))))


def refine_all(
    solved: Sequence[Solved], progress: Progress, shares: Sequence[float]
) -> list[tuple[Solved, float]]:
    """Each fit on a grid that is fine enough, and its numerical error √λ_num in noise units: the
    change when the step is halved, minus what the fit can absorb.

    The grid is refined until the error is far below the noise, or below its share of the residual
    beyond the noise, or the grid is the finest.  Only those whose grid is too coarse are fitted
    again.  The quadrature is of order four, so that this change is the coarser grid's error to 7 %.
    """
    fits, errors = list(solved), [np.inf] * len(solved)
    coarse = list(range(len(fits)))
    while coarse:
        steps = max(fits[at].preparation.oversampling for at in coarse)
        progress(f"checking the numerical error with {steps} steps per sample")
        tolerated = [tolerated_error(TARGET, fits[at], shares[at]) for at in coarse]
        grids = _accurate_grids([fits[at] for at in coarse], tolerated)
        refined: list[tuple[int, Preparation]] = []
        for at, (finer, error) in zip(coarse, grids, strict=True):
            errors[at] = error
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


def _accurate_grids(
    solved: Sequence[Solved], targets: Sequence[float]
) -> list[tuple[Preparation, float]]:
    """For each fit the coarsest grid, from the present one on, that reaches its target, and its
    numerical error.

    The error is that of the solved blocks, without a new fit.  If no grid reaches the target, it is
    the coarsest that is nearly as accurate as any: a fractional derivative hardly converges at a
    kink that meets a sample, and many small steps would not help.
    """
    grids: list[list[tuple[Preparation, float]]] = [[] for _ in solved]
    coarse = _whitened(solved, [one.preparation.problems() for one in solved])
    finer, pending = [one.preparation for one in solved], list(range(len(solved)))
    while pending:
        problems = [finer[at].problems(2 * finer[at].oversampling) for at in pending]
        halved = _whitened([solved[at] for at in pending], problems)
        remaining = []
        for at, signal in zip(pending, halved, strict=True):
            enough = targets[at] if np.isfinite(targets[at]) else 0.0
            change = _unabsorbed(solved[at], signal - coarse[at], enough)
            grids[at].append((finer[at], change))
            doubled = 2 * finer[at].oversampling
            longest = max(len(take.recording) for take in solved[at].preparation.takes)
            is_last = doubled > FINEST or doubled * longest > _MOST_SAMPLES
            if not (is_last or grids[at][-1][1] <= targets[at]):
                finer[at], coarse[at] = finer[at].with_oversampling(doubled), signal
                remaining.append(at)
        pending = remaining
    return [_chosen(of_fit, target) for of_fit, target in zip(grids, targets, strict=True)]


def _chosen(grids: Sequence[tuple[Preparation, float]], target: float) -> tuple[Preparation, float]:
    """The last of the grids where it reaches the target, else the first nearly as good as any."""
    if grids[-1][1] <= target:
        return grids[-1]
    least = min(error for _, error in grids)
    enough = least * _NEARLY_BEST if least > LIMIT else min(LIMIT, least * _NEARLY_BEST)
    return next(grid for grid in grids if grid[1] <= enough)


def _unabsorbed(solved: Solved, change: np.ndarray, enough: float) -> float:
    """The norm of what a fit cannot absorb of a change (ΣL,) of its whitened simulations.

    Of a row of a stack it is what its own terms cannot absorb, which is little more and takes far
    less time, where that is `enough`.
    """
    if solved.stacked:
        (problem,) = solved.preparation.problems()
        bound = float(np.linalg.norm(eliminate(problem.whiten(problem.own), change)[1]))
        if bound <= enough:
            return bound
    derivative = solved.whitened_derivative()
    square, along = derivative.T @ derivative, derivative.T @ change
    lengths = np.sqrt(np.diag(square))
    lengths[lengths == 0] = 1.0  # of a parameter that moves nothing
    scaled = square / np.outer(lengths, lengths)
    absorbed = np.linalg.lstsq(scaled, along / lengths, rcond=_DEPENDENT)[0] / lengths
    unabsorbed = float(np.linalg.norm(change - derivative @ absorbed))
    return float(np.nan_to_num(unabsorbed, nan=np.inf))


def _whitened(solved: Sequence[Solved], problems: Sequence[Sequence[Problem]]) -> list[np.ndarray]:
    """Each fit's whitened simulations (ΣL,) on the grids of its problems; those of stacks together.

    On a fit's own grid they stand in it, with own terms, which are absorbed anyway.
    """
    pairs = list(zip(solved, problems, strict=True))
    new = [one.preparation.problems() is not its for one, its in pairs]
    rows = [pair for pair, is_new in zip(pairs, new, strict=True) if is_new and pair[0].stacked]
    responses = iter(respond_rows([one.block for one, _ in rows], [its[0] for _, its in rows]))
    whitened = []
    for (one, its), is_new in zip(pairs, new, strict=True):
        if not is_new:
            sized = zip(one.simulations, its, strict=True)
            signals = [np.pad(s, (0, len(p.response) - len(s))) for s, p in sized]
        elif one.stacked:
            signals = [next(responses)]
        else:
            signals = map(simulate, one.blocks, its)
        signals = [p.whiten(signal) for p, signal in zip(its, signals, strict=True)]
        whitened.append(np.concatenate(signals))
    return whitened
