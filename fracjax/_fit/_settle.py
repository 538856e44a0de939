"""What only a fit can decide: the history, a noise that was not measured, and the grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import (
    Noise,
    Past,
    Preparation,
    cleared,
    other_histories,
    read_from_residual,
)
from .._solve import Progress, Solved, fine_enough, fit_block, solve_from
from ._history import is_likelier

_OVERRATED = 0.5
"""Mean square of a whitened residual below which the measured noise is more than noise."""


def settle(
    block: AbstractBlock,
    preparation: Preparation,
    *,
    history: Past | None,
    starts: int,
    seed: int,
) -> Solved:
    """Fit, and settle what only a fit can tell: the history, and a noise that was not measured."""
    solved = fit_block(block, preparation, starts, seed)
    if history is None:
        others = [other_histories(take) for take in preparation.takes]
        if any(others):
            takes = zip(others, preparation.takes, strict=True)
            alternative = replace(preparation, takes=tuple(o or t for o, t in takes))
            other = fit_block(block, alternative, starts, seed)
            if is_likelier(other, solved):
                solved, preparation = other, alternative
    believed, noises = _believed_noises(solved), []
    for noise, take, simulation in zip(
        believed, preparation.takes, solved.simulations, strict=True
    ):
        left = take.recording.response - simulation
        if noise is None or noise.is_leftover:
            noises.append(read_from_residual(noise, left, take.used, take.recording))
        else:
            noises.append(cleared(noise, left, take.used, take.recording))
    if any(found is not take.noise for found, take in zip(noises, preparation.takes, strict=True)):
        solved = _refitted(solved, preparation.with_noises(noises), starts, seed)
    return solved


def settle_finely(
    block: AbstractBlock,
    preparation: Preparation,
    *,
    history: Past | None,
    starts: int,
    seed: int,
    progress: Progress,
) -> tuple[Solved, float]:
    """`settle`, on a grid fine enough for the noise, which is read again where a fit told it; and
    √λ_num, the numerical error that is left."""
    solved = settle(block, preparation, history=history, starts=starts, seed=seed)
    while True:
        coarse = solved.preparation
        solved, error = fine_enough(solved, progress)
        takes = solved.preparation.takes
        leftover = any(take.noise and take.noise.is_leftover for take in takes)
        if solved.preparation is coarse or not leftover:
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


def _refitted(solved: Solved, preparation: Preparation, starts: int, seed: int) -> Solved:
    """A fit under other noises: where they only scale χ², its optimum is theirs."""
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
    """What multiplies every whitened residual, where it is one number; None of other changes."""
    pairs = list(zip(before.problems(), after.problems(), strict=True))
    scale = float(pairs[0][1].whitening[0] / pairs[0][0].whitening[0])
    alike = all(
        np.allclose(b.whitening, scale * a.whitening, 1e-12, 0)
        and np.array_equal(a.weights, b.weights)
        for a, b in pairs
    )
    return scale if alike and not after.conditions.priors else None


def _believed_noises(solved: Solved) -> list[Noise | None]:
    """The noises that were measured, but for those far larger than what the fit leaves over: then
    what differed between periods, or moved at rest, was no noise."""
    found: list[Noise | None] = []
    for take, whitened in zip(solved.preparation.takes, solved.whitened, strict=True):
        counted = whitened[whitened != 0]
        told = take.noise is not None and take.noise.method != "specification"
        overrated = told and counted.size > 0 and float(np.mean(counted**2)) < _OVERRATED
        found.append(None if overrated else take.noise)
    return found
