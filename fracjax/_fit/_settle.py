"""Decisions that need a fit: the history, a noise that was not measured, and the grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeGuard

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import (
    HistoryOption,
    Noise,
    Preparation,
    Residual,
    alternative_history,
    levels_of_residuals,
    noises_below,
    read_from_residuals,
    refine_noise,
)
from .._solve import (
    TARGET,
    Progress,
    Solved,
    fit_blocks,
    refine_all,
    solve_again,
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
    solved = _fits([block], [preparation], history, starts, seed)
    _read_noises(solved, [0], refine_measured=True)
    return solved[0]


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


def settle_all_finely(
    blocks: Sequence[AbstractBlock],
    preparations: Sequence[Preparation],
    *,
    history: HistoryOption | None,
    starts: int,
    seed: int,
    progress: Progress,
) -> list[tuple[Solved, float]]:
    """`settle_finely` for each of many blocks, those alike together.

    The colour of a residual is read where the grid is fine enough for its level: on a coarser one
    it would be that of the numerical error.
    """
    solved = _fits(blocks, preparations, history, starts, seed)
    _replace(solved, range(len(solved)), _with_levels)
    errors, pending, is_first = [np.inf] * len(solved), list(range(len(solved))), True
    while pending:
        shares = [_tolerated_share(solved[at]) for at in pending]
        refined = refine_all([solved[at] for at in pending], progress, shares)
        unread: list[int] = []
        for at, (finer, error) in zip(pending, refined, strict=True):
            if is_first or finer.preparation is not solved[at].preparation:
                unread.append(at)
            solved[at], errors[at] = finer, error
        scales = _read_noises(solved, unread, refine_measured=is_first)
        # Where the noise has another level alone, the numerical error is known in the new unit.
        errors = [scales.get(at, 1.0) * error for at, error in enumerate(errors)]
        pending = [at for at in scales if not errors[at] <= tolerated_numerical_error(solved[at])]
        is_first = False
    return list(zip(solved, errors, strict=True))


def _fits(
    blocks: Sequence[AbstractBlock],
    preparations: Sequence[Preparation],
    history: HistoryOption | None,
    starts: int,
    seed: int,
) -> list[Solved]:
    """The fit of each block, with the better history where none is given and two are possible."""
    solved = fit_blocks(blocks, preparations, starts, seed)
    if history is None:
        alternatives = {at: other for at, p in enumerate(preparations) if (other := _other(p))}
        others = fit_blocks(
            [blocks[at] for at in alternatives], [*alternatives.values()], starts, seed
        )
        for at, other in zip(alternatives, others, strict=True):
            if prefers_other_history(other, solved[at]):
                solved[at] = other
    return solved


def _read_noises(
    solved: list[Solved], which: Sequence[int], refine_measured: bool
) -> dict[int, float]:
    """Replace fits by those with noises read from their residuals; returns as `_replace`."""
    scales = _replace(solved, which, partial(_with_read_noises, refine_measured=refine_measured))
    whiter = _replace(solved, which, _with_white_noises)
    return scales | {at: scale * scales.get(at, 1.0) for at, scale in whiter.items()}


def _replace(
    solved: list[Solved],
    which: Sequence[int],
    changed: Callable[[Sequence[Solved]], Sequence[Preparation | None]],
) -> dict[int, float]:
    """Replace fits by those with changed preparations, from where they are.

    Returns the factor of all whitened residuals of each that changed, NaN where there is none.
    """
    preparations = zip(which, changed([solved[at] for at in which]), strict=True)
    changes = {at: preparation for at, preparation in preparations if preparation}
    scales = {at: _scale(solved[at].preparation, change) for at, change in changes.items()}
    moved = [at for at, scale in scales.items() if np.isnan(scale)]
    again = solve_again([solved[at] for at in moved], [changes[at] for at in moved])
    for at, scale in scales.items():
        if np.isfinite(scale):  # the same optimum, as the noises only scale χ²
            solved[at] = solved[at].scaled(changes[at], scale)
    for at, one in zip(moved, again, strict=True):
        solved[at] = one
    return scales


def tolerated_numerical_error(solved: Solved) -> float:
    """The largest numerical error of a fit that changes nothing of note, in noise units."""
    return tolerated_error(TARGET, solved, _tolerated_share(solved))


def _tolerated_share(solved: Solved) -> float:
    """The share of the residual beyond the noise that a numerical error may be."""
    noises = [take.noise for take in solved.preparation.takes]
    is_bound = any(noise is None or noise.method == "residual" for noise in noises)
    return _SHARE_OF_MISFIT if is_bound else 0.0


def _other(preparation: Preparation) -> Preparation | None:
    """The preparation with the other possible histories, None where no recording has one."""
    others = [alternative_history(take) for take in preparation.takes]
    if not any(others):
        return None
    takes = zip(others, preparation.takes, strict=True)
    return replace(preparation, takes=tuple(other or take for other, take in takes))


def _with_levels(solved: Sequence[Solved]) -> list[Preparation | None]:
    """Each preparation with white noises of the residual's level where there are none, None where
    none is missing."""
    pairs = [
        pair for one in solved for pair in zip(one.preparation.takes, _residuals(one), strict=True)
    ]
    levels = iter(levels_of_residuals([r for take, r in pairs if take.noise is None]))
    return [
        one.preparation.with_noises([take.noise or next(levels) for take in one.preparation.takes])
        if any(take.noise is None for take in one.preparation.takes)
        else None
        for one in solved
    ]


def _with_read_noises(solved: Sequence[Solved], refine_measured: bool) -> list[Preparation | None]:
    """Each preparation with noises read from the residual, None where none changes.

    Measured noises are refined by the residual, or are kept.
    """
    pairs = [
        [
            (take.noise, residual)
            for take, residual in zip(one.preparation.takes, _residuals(one), strict=True)
        ]
        for one in solved
    ]
    # A noise that is None, or was read from another fit's residual, has to be read from this one.
    read = iter(read_from_residuals([p for its in pairs for p in its if not _is_measured(p[0])]))
    preparations = []
    for one, its in zip(solved, pairs, strict=True):
        noises = []
        for (noise, residual), whitened in zip(its, one.whitened, strict=True):
            if not _is_measured(noise):
                noises.append(next(read))
            elif not refine_measured:
                noises.append(noise)
            elif _is_too_large(noise, whitened):
                noises += noises_below([residual])
            else:
                noises.append(refine_noise(noise, residual))
        same = all(new is noise for new, (noise, _) in zip(noises, its, strict=True))
        preparations.append(None if same else one.preparation.with_noises(noises))
    return preparations


def _with_white_noises(solved: Sequence[Solved]) -> list[Preparation | None]:
    """Each preparation with white noises of the same levels where the fit under coloured ones is
    worse than a constant; None elsewhere."""
    preparations: list[Preparation | None] = []
    for one in solved:
        noises = [noise for take in one.preparation.takes if (noise := take.noise)]
        is_coloured = any(noise.filter.size > 1 for noise in noises)
        whiter = is_coloured and _is_worse_than_constant(one)
        white = [noise.uncoloured() for noise in noises]
        preparations.append(one.preparation.with_noises(white) if whiter else None)
    return preparations


def _residuals(solved: Solved) -> list[Residual]:
    """What the simulations leave of each recording."""
    return [
        Residual(take.recording.response - simulation, take.used, take.recording)
        for take, simulation in zip(solved.preparation.takes, solved.simulations, strict=True)
    ]


def _is_measured(noise: Noise | None) -> TypeGuard[Noise]:
    """Whether a noise need not be read from the residual of a fit."""
    return noise is not None and not noise.is_leftover


def _scale(before: Preparation, after: Preparation) -> float:
    """The common factor of all whitened residuals, NaN where the change is another."""
    pairs = list(zip(before.problems(), after.problems(), strict=True))
    scale = float(pairs[0][1].whitening[0] / pairs[0][0].whitening[0])
    proportional = all(
        np.all(np.abs(b.whitening - scale * a.whitening) <= 1e-12 * np.abs(b.whitening))
        and np.array_equal(a.weights, b.weights)
        for a, b in pairs
    )
    return scale if proportional and not after.conditions.priors else np.nan


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
