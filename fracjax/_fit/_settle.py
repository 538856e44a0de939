"""Decisions that need a fit: the history, a noise that was not measured, and the grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import (
    HistoryOption,
    Noise,
    Preparation,
    alternative_history,
    read_from_residual,
    refine_noise,
)
from .._solve import TARGET, Progress, Solved, fit_blocks, refine_all, solve_again
from ._history import prefers_other_history

_LEAST_MEAN_SQUARE = 0.5
"""Mean square of a whitened residual below which the measured noise is not only noise.  Chosen by
judgement."""


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
    was not measured, or whose measured level is too large, is read from the residual.
    """
    return settle_all([block], [preparation], history=history, starts=starts, seed=seed)[0]


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
    return settle_all_finely(
        [block], [preparation], history=history, starts=starts, seed=seed, progress=progress
    )[0]


def settle_all(
    blocks: Sequence[AbstractBlock],
    preparations: Sequence[Preparation],
    *,
    history: HistoryOption | None,
    starts: int,
    seed: int,
) -> list[Solved]:
    """`settle` for each of many blocks, those alike together."""
    solved = fit_blocks(blocks, preparations, starts, seed)
    if history is None:
        alternatives = {at: other for at, p in enumerate(preparations) if (other := _other(p))}
        others = fit_blocks(
            [blocks[at] for at in alternatives], [*alternatives.values()], starts, seed
        )
        for at, other in zip(alternatives, others, strict=True):
            if prefers_other_history(other, solved[at]):
                solved[at] = other
    changed = {at: p for at, one in enumerate(solved) if (p := _with_read_noises(one))}
    coloured = {at: p for at, p in changed.items() if _scale(solved[at].preparation, p) is None}
    again = fit_blocks([solved[at].block for at in coloured], [*coloured.values()], starts, seed)
    refitted = dict(zip(coloured, again, strict=True))
    for at, preparation in changed.items():
        scale = _scale(solved[at].preparation, preparation)
        # The same optimum where the noises only scale χ².
        solved[at] = refitted[at] if scale is None else solved[at].scaled(preparation, scale)
    return solved


def settle_all_finely(
    blocks: Sequence[AbstractBlock],
    preparations: Sequence[Preparation],
    *,
    history: HistoryOption | None,
    starts: int,
    seed: int,
    progress: Progress,
) -> list[tuple[Solved, float]]:
    """`settle_finely` for each of many blocks, those alike together."""
    solved = settle_all(blocks, preparations, history=history, starts=starts, seed=seed)
    errors, pending = [np.inf] * len(solved), list(range(len(solved)))
    while pending:
        refined = refine_all([solved[at] for at in pending], progress)
        reread: dict[int, Preparation] = {}
        for at, (finer, error) in zip(pending, refined, strict=True):
            same_grid = finer.preparation is solved[at].preparation
            solved[at], errors[at] = finer, error
            if not same_grid and any(_is_from_residual(t.noise) for t in finer.preparation.takes):
                reread[at] = _with_reread_noises(finer)
        scaled = {at: _scale(solved[at].preparation, p) for at, p in reread.items()}
        pending = [at for at, scale in scaled.items() if scale is None]
        again = solve_again([solved[at] for at in pending], [reread[at] for at in pending])
        for at, one in zip(pending, again, strict=True):
            solved[at] = one
        for at, scale in scaled.items():
            if scale is not None:  # the same optimum, and its numerical error in the new unit
                solved[at], errors[at] = solved[at].scaled(reread[at], scale), scale * errors[at]
                pending += [at] if errors[at] > TARGET else []
    return list(zip(solved, errors, strict=True))


def _other(preparation: Preparation) -> Preparation | None:
    """The preparation with the other possible histories, None where no recording has one."""
    others = [alternative_history(take) for take in preparation.takes]
    if not any(others):
        return None
    takes = zip(others, preparation.takes, strict=True)
    return replace(preparation, takes=tuple(other or take for other, take in takes))


def _with_read_noises(solved: Solved) -> Preparation | None:
    """The preparation with noises read or refined from the residual, None where none changes."""
    takes, noises = solved.preparation.takes, []
    for noise, take, simulation in zip(
        _credible_noises(solved), takes, solved.simulations, strict=True
    ):
        residual = take.recording.response - simulation
        if noise is None or noise.is_leftover:
            noises.append(read_from_residual(noise, residual, take.used, take.recording))
        else:
            noises.append(refine_noise(noise, residual, take.used, take.recording))
    if all(noise is take.noise for noise, take in zip(noises, takes, strict=True)):
        return None
    return solved.preparation.with_noises(noises)


def _with_reread_noises(solved: Solved) -> Preparation:
    """The preparation with those noises read again that were read from a residual."""
    takes, noises = solved.preparation.takes, []
    for take, simulation in zip(takes, solved.simulations, strict=True):
        residual = take.recording.response - simulation
        reread = _is_from_residual(take.noise)
        noises.append(
            read_from_residual(take.noise, residual, take.used, take.recording)
            if reread
            else take.noise
        )
    return solved.preparation.with_noises(noises)


def _is_from_residual(noise: Noise | None) -> bool:
    """Whether a noise was, or has to be, read from the residual of a fit."""
    return noise is None or noise.is_leftover


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


def _credible_noises(solved: Solved) -> list[Noise | None]:
    """The measured noises, None for those much larger than the residual of the fit.

    The difference between periods, or the motion at rest, was then not noise.
    """
    noises: list[Noise | None] = []
    for take, whitened in zip(solved.preparation.takes, solved.whitened, strict=True):
        counted = whitened[whitened != 0]
        measured = take.noise is not None and take.noise.method != "specification"
        too_large = (
            measured and counted.size > 0 and float(np.mean(counted**2)) < _LEAST_MEAN_SQUARE
        )
        noises.append(None if too_large else take.noise)
    return noises
