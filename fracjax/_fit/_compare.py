"""Models compared on the same recordings: on what they were fitted to, and on data held out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from math import log
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d

from .._computing import computing
from .._models import Model
from .._prepare import Preparation, Take, take_of
from .._recording import InputError, Recording, require_units_of
from .._solve import Progress, silent, solve_from
from ._fit import Fit, fit

SCHEMA = "fracjax.comparison/2"
_FOLDS = 5
_STRETCHES = 20
_FORGOTTEN = 0.1


@dataclass(frozen=True)
class Unseen:
    """Errors on data that no fit has seen: rmse [response], e_r = ‖y-ŷ‖/‖y - mean‖, NRMSE fit %,
    and the rmse of every fold."""

    rmse: float
    e_r: float
    nrmse_percent: float
    folds: tuple[float, ...]


@dataclass(frozen=True)
class Row:
    """One model: how many numbers were fitted (offsets included), scores on the data fitted, where
    `bic` makes models with noises of their own comparable, and on those held out."""

    model: str
    parameters: int
    rmse: float
    e_r: float
    nrmse_percent: float
    bic: float
    unseen: Unseen | None
    converged: bool


@dataclass(frozen=True)
class Comparison:
    """Fits of several models to the same recordings, best first by BIC, a row for each.

    `method` says what was held out; errors are in the response's unit.
    """

    fits: tuple[Fit, ...]
    rows: tuple[Row, ...]
    method: str

    @property
    def best(self) -> str:
        """The model with the least BIC."""
        return self.rows[0].model

    @property
    def best_unseen(self) -> str | None:
        """The model with the least error on data held out."""
        scored = [(row.unseen.rmse, row.model) for row in self.rows if row.unseen is not None]
        return min(scored)[1] if scored else None

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "schema": SCHEMA,
            "best": self.best,
            "best_on_held_out": self.best_unseen,
            "held_out": self.method,
            "rows": [asdict(row) for row in self.rows],
            "fits": [
                {"bic": row.bic, **found.to_dict()}
                for row, found in zip(self.rows, self.fits, strict=True)
            ],
        }

    def save(self, path: str | Path) -> None:
        """Write comparison.json."""
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def compare(
    models: Sequence[Model | str],
    recordings: Recording | Sequence[Recording],
    *,
    holdout: Recording | Sequence[Recording] | None = None,
    progress: Progress = silent,
    **options: Any,
) -> Comparison:
    """Fit several models to the same recordings and score them on data held out.

    `holdout`: recordings that no fit sees; without them stretches of the recordings themselves, set
    aside in turn.  `options` are those of `fit`.
    Raises InputError as `fit` does, and for a holdout in other units.
    """
    fits = [fit(model, recordings, progress=progress, **options) for model in models]
    return compared(fits, holdout=holdout, progress=progress)


def compared(
    fits: Sequence[Fit],
    *,
    holdout: Recording | Sequence[Recording] | None = None,
    progress: Progress = silent,
) -> Comparison:
    """Fits of the same recordings, as `compare` would have made them, ranked and scored."""
    others = [holdout] if isinstance(holdout, Recording) else list(holdout or ())
    if not fits:
        raise InputError("expected at least one model, found none; give one")
    for other in others:
        require_units_of(fits[0].preparation.takes[0].recording, other)
    rows = []
    with computing():
        for found, bic in ranked(fits):
            progress(f"scoring {found.model.name} on data held out")
            unseen = _on_recordings(found, others) if others else _on_stretches(found)
            rows.append((found, bic, unseen))
    names = ", ".join(Path(other.source).name for other in others)
    return Comparison(
        fits=tuple(found for found, _, _ in rows),
        rows=tuple(
            Row(
                model=found.model.name,
                parameters=len(found.estimates) + len(found.offsets),
                rmse=found.scores.rmse,
                e_r=found.scores.e_r,
                nrmse_percent=found.scores.nrmse_percent,
                bic=bic,
                unseen=unseen,
                converged=found.converged,
            )
            for found, bic, unseen in rows
        ),
        method=names
        or f"{_FOLDS} folds of stretches, each by a fit without it and what lies about it",
    )


def ranked(fits: Sequence[Fit]) -> list[tuple[Fit, float]]:
    """Fits of the same recordings with their BIC, best first.

    Where the noise was taken from the residuals each fit has a noise of its own; then the BIC with
    that noise unknown, n ln(rmse²) + k ln n, makes them comparable.
    """
    noises = [take.noise for found in fits for take in found.preparation.takes]
    if all(noise is not None and noise.method != "residual" for noise in noises):
        return sorted(((found, found.scores.bic) for found in fits), key=lambda pair: pair[1])
    count = int(sum(take.used.sum() for take in fits[0].preparation.takes))

    def bic(found: Fit) -> float:
        free = len(found.estimates) + len(found.offsets)
        return 2 * count * log(found.scores.rmse) + free * log(count)

    return sorted(((found, bic(found)) for found in fits), key=lambda pair: pair[1])


# Data held out ------------------------------------------------------------------------------------


def _on_recordings(found: Fit, others: Sequence[Recording]) -> Unseen | None:
    """The first recording's model on others, the zero of each read from its first samples, which
    are not scored."""
    errors, responses = [], []
    for other in others:
        take = take_of(other, found.preparation.takes[0].noise, None, None)
        problem = Preparation((take,), found.preparation.oversampling).problems()[0]
        error = other.response - np.asarray(problem.simulate(found.model.block))[: len(other)]
        stop = take.baseline.stop
        errors.append((error - error[take.baseline].mean())[stop:])
        responses.append(other.response[stop:] - other.response[stop:].mean())
    return _unseen(errors, responses)


def _on_stretches(found: Fit) -> Unseen | None:
    """Each fold of stretches by a fit that has not seen it, nor what lies about it.

    Next to a stretch, samples are left out for as long as the residual remembers: until its
    autocorrelation falls below 0.1, up to half a stretch, so that a model is not helped by having
    seen the same error a sample away (h-block cross-validation, Burman, Chow & Nolan, Biometrika 81
    (1994) 351).  Stretches are whole periods where the drive has at least ten.  The history of the
    drive is known all along; only the loss leaves them out.
    """
    preparation = found.weighed
    folds = [_folds(take, residual) for take, residual in _pairs(found)]
    errors: list[np.ndarray] = []
    responses: list[np.ndarray] = []
    for k in range(_FOLDS):
        takes = tuple(
            replace(take, used=take.used & ~near[k])
            for take, (_, near) in zip(preparation.takes, folds, strict=True)
        )
        if min(int(take.used.sum()) for take in takes) < 2 * len(found.estimates):
            return None
        solved = solve_from([found.model.block], replace(preparation, takes=takes))
        fold_error, fold_response = [], []
        for take, (of, _), simulation in zip(
            preparation.takes, folds, solved.simulations, strict=True
        ):
            scored = take.used & (of == k)
            centre = take.recording.response[take.used].mean()
            fold_error.append((take.recording.response - simulation)[scored])
            fold_response.append(take.recording.response[scored] - centre)
        errors.append(np.concatenate(fold_error))
        responses.append(np.concatenate(fold_response))
    return _unseen(errors, responses)


def _pairs(found: Fit) -> list[tuple[Take, np.ndarray]]:
    return list(zip(found.preparation.takes, found.residuals, strict=True))


def _folds(take: Take, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Per sample its fold (N,), and per fold the samples (folds, N) in or next to it."""
    count = len(take.recording)
    stretch = max(count // _STRETCHES, 1)
    repeats = take.recording.drive_period()
    if repeats is not None and 2 * _FOLDS * repeats.period <= count:
        stretch = repeats.period * max(1, round(stretch / repeats.period))
    of = np.arange(count) // stretch % _FOLDS
    gap = min(_memory(residual[take.used]), stretch // 2)
    near = [
        maximum_filter1d((of == k).astype(np.uint8), 2 * gap + 1, mode="constant") > 0
        for k in range(_FOLDS)
    ]
    return of, np.stack(near)


def _memory(residual: np.ndarray) -> int:
    """After how many samples the residual's autocorrelation is below 0.1."""
    centred = residual - residual.mean()
    size = 1 << int(np.ceil(np.log2(2 * centred.size)))
    products = np.fft.irfft(np.abs(np.fft.rfft(centred, size)) ** 2, size)[: centred.size]
    below = np.flatnonzero(products < _FORGOTTEN * products[0])
    return int(below[0]) if below.size else centred.size


def _unseen(errors: Sequence[np.ndarray], responses: Sequence[np.ndarray]) -> Unseen:
    error = np.concatenate(errors)
    e_r = float(np.linalg.norm(error) / np.linalg.norm(np.concatenate(responses)))
    return Unseen(
        rmse=float(np.sqrt(np.mean(error**2))),
        e_r=e_r,
        nrmse_percent=100 * (1 - e_r),
        folds=tuple(float(np.sqrt(np.mean(fold**2))) for fold in errors if fold.size),
    )
