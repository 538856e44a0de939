"""Decisions that need a fit: the history, a noise that was not measured, and the grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import (
    HistoryOption,
    Noise,
    Preparation,
    alternative_history,
    noise_below,
    read_from_residual,
    refine_noise,
)
from .._solve import (
    TARGET,
    Progress,
    Solved,
    fit_block,
    refine_until_accurate,
    solve_from,
    tolerated_error,
)
from ._history import prefers_other_history

_LEAST_MEAN_SQUARE = 0.5
"""Mean square of a whitened residual below which the measured noise is not only noise.  Chosen by
judgement."""
_SHARE_OF_MISFIT = 0.02
"""Numerical error that a fit tolerates, as a share of the residual beyond the noise, where the
noise was not measured and may be far larger than second differences show.  Chosen by judgement."""


def settle(
    block: AbstractBlock,
    preparation: Preparation,
    *,
    history: HistoryOption | None,
    starts: int,
    seed: int,
) -> Solved:
    """The fit, its history and its noises.

    The history is chosen by comparing fits where it is None and another is possible.  A noise that
    was not measured, or whose measured level is too large, is read from the residual.  A coloured
    noise under which the fit is worse than a constant is taken as white: the fit then follows the
    frequencies at which there is least noise, and not the response.
    """
    solved = fit_block(block, preparation, starts, seed)
    if history is None:
        others = [alternative_history(take) for take in preparation.takes]
        if any(others):
            takes = zip(others, preparation.takes, strict=True)
            alternative = replace(preparation, takes=tuple(o or t for o, t in takes))
            other = fit_block(block, alternative, starts, seed)
            if prefers_other_history(other, solved):
                solved, preparation = other, alternative
    noises = []
    for take, whitened, simulation in zip(
        preparation.takes, solved.whitened, solved.simulations, strict=True
    ):
        residual = take.recording.response - simulation
        if take.noise is None or take.noise.is_leftover:
            noises.append(read_from_residual(take.noise, residual, take.used, take.recording))
        elif _is_too_large(take.noise, whitened):
            noises.append(noise_below(residual, take.used, take.recording))
        else:
            noises.append(refine_noise(take.noise, residual, take.used, take.recording))
    if any(noise is not take.noise for noise, take in zip(noises, preparation.takes, strict=True)):
        solved = _refitted(solved, preparation.with_noises(noises), starts, seed)
    if any(noise.filter.size > 1 for noise in noises) and _is_worse_than_constant(solved):
        white = [noise.uncoloured() for noise in noises]
        solved = _refitted(solved, solved.preparation.with_noises(white), starts, seed)
    return solved


def settle_finely(
    block: AbstractBlock,
    preparation: Preparation,
    *,
    history: HistoryOption | None,
    starts: int,
    seed: int,
    progress: Progress,
) -> tuple[Solved, float]:
    """The fit of `settle` on a fine enough grid, and √λ_num, its numerical error.

    A noise that was read from the residual is read again on the finer grid.
    """
    solved = settle(block, preparation, history=history, starts=starts, seed=seed)
    while True:
        previous = solved.preparation
        solved, error = refine_until_accurate(solved, progress, _tolerated_share(solved))
        takes = solved.preparation.takes
        from_residual = any(take.noise and take.noise.is_leftover for take in takes)
        if solved.preparation is previous or not from_residual:
            return solved, error
        reread = solved.preparation.with_noises(
            [
                read_from_residual(
                    take.noise, take.recording.response - simulation, take.used, take.recording
                )
                if take.noise is None or take.noise.is_leftover
                else take.noise
                for take, simulation in zip(takes, solved.simulations, strict=True)
            ]
        )
        solved = solve_from([solved.block], reread)


def tolerated_numerical_error(solved: Solved) -> float:
    """The largest numerical error of a fit that changes nothing of note, in noise units."""
    return tolerated_error(TARGET, solved, _tolerated_share(solved))


def _tolerated_share(solved: Solved) -> float:
    """The share of the residual beyond the noise that a numerical error may be."""
    noises = [take.noise for take in solved.preparation.takes]
    is_bound = any(noise is None or noise.method == "residual" for noise in noises)
    return _SHARE_OF_MISFIT if is_bound else 0.0


def _refitted(solved: Solved, preparation: Preparation, starts: int, seed: int) -> Solved:
    """The fit under other noises: the same optimum where they only scale χ²."""
    scale = _scale(solved.preparation, preparation)
    if scale is None:
        return fit_block(solved.block, preparation, starts, seed)
    return replace(
        solved.on(preparation),
        cost=scale**2 * solved.cost,
        whitened=tuple(scale * residual for residual in solved.whitened),
        start_costs=tuple(scale**2 * cost for cost in solved.start_costs),
    )


def _scale(before: Preparation, after: Preparation) -> float | None:
    """The common factor of all whitened residuals, None where the change is another."""
    pairs = list(zip(before.problems(), after.problems(), strict=True))
    scale = float(pairs[0][1].whitening[0] / pairs[0][0].whitening[0])
    proportional = all(
        np.allclose(b.whitening, scale * a.whitening, 1e-12, 0)
        and np.array_equal(a.weights, b.weights)
        for a, b in pairs
    )
    return scale if proportional and not after.conditions.priors else None


def _is_too_large(noise: Noise, whitened: np.ndarray) -> bool:
    """Whether a measured noise is much larger than the whitened residual (L,) of the fit.

    The difference between periods, or the motion at rest, was then not noise.
    """
    counted = whitened[whitened != 0]
    measured = noise.method != "specification"
    return measured and counted.size > 0 and float(np.mean(counted**2)) < _LEAST_MEAN_SQUARE


def _is_worse_than_constant(solved: Solved) -> bool:
    """Whether constants are closer to the responses than the fit."""
    pairs = zip(solved.preparation.takes, solved.simulations, strict=True)
    errors = [
        (np.sum((y - s) ** 2), np.sum((y - y.mean()) ** 2))
        for y, s in ((t.recording.response[t.used], s[t.used]) for t, s in pairs)
    ]
    of_fit, of_constants = np.sum(errors, axis=0)
    return bool(of_fit > of_constants)
