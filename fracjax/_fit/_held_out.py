"""Data held out from a fit: other recordings, or stretches of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from .._prepare import Preparation, Problem, Take, measured_noise, take_of
from .._recording import Recording
from .._solve import solve_from
from ._fit import Fit

FOLDS = 5
"""Folds, the usual number."""
_STRETCHES = 20
"""Stretches of a recording, four per fold.  Chosen by judgement."""
_UNCORRELATED = 0.1
"""Autocorrelation below which samples count as uncorrelated.  Chosen by judgement."""


@dataclass(frozen=True)
class HeldOutScores:
    """Errors on data that were held out from the fit.

    Attributes:
        rmse: in the response's unit.
        e_r: ‖y-ŷ‖/‖y - mean‖, dimensionless.
        nrmse_percent: 100 (1 - e_r), dimensionless.
        folds: the rmse of each fold, in the response's unit.
    """

    rmse: float
    e_r: float
    nrmse_percent: float
    folds: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Predicted:
    """A recording held out, and what models predict of it.

    Attributes:
        recording: the recording.
        scored: (N,), where the predictions count: behind the samples from which the zero was read.
        responses: of each model (N,), in the response's unit, in the order of the comparison.
    """

    recording: Recording
    scored: np.ndarray
    responses: tuple[np.ndarray, ...]


def take_to_predict(fit: Fit, recording: Recording) -> tuple[Take, Problem]:
    """A recording that a fit is to predict, as what is simulated of it."""
    noise = measured_noise(recording) or fit.preparation.takes[0].noise
    take = take_of(recording, noise, None, None)
    return take, Preparation((take,), fit.preparation.oversampling).problems()[0]


def prediction(fit: Fit, recording: Recording) -> tuple[np.ndarray, int]:
    """What the first recording's model predicts of another (N,), and from which sample on: the zero
    is read from the samples before."""
    take, problem = take_to_predict(fit, recording)
    response = np.asarray(problem.simulate(fit.model.block))[: len(recording)]
    zero = (recording.response - response)[take.baseline].mean()
    return response + zero, take.baseline.stop


def scores_of_predictions(
    predictions: Sequence[tuple[np.ndarray, int]], recordings: Sequence[Recording]
) -> HeldOutScores | None:
    """The scores of predictions of recordings."""
    errors, responses = [], []
    for (predicted, stop), recording in zip(predictions, recordings, strict=True):
        errors.append((recording.response - predicted)[stop:])
        responses.append(recording.response[stop:] - recording.response[stop:].mean())
    return _held_out_scores(errors, responses)


def scores_on_stretches(fit: Fit) -> HeldOutScores | None:
    """The scores on folds of stretches, each predicted by a fit that omits the fold.

    The fit also omits samples next to a stretch, until the residual's autocorrelation falls below
    0.1 and at most for half a stretch, so that no model profits from the same error one sample
    away.  Stretches are whole periods where the drive has at least ten.  The drive before each
    stretch is still simulated; only the loss omits the samples.  None where too few samples remain.

    Source: h-block cross-validation, Burman, Chow & Nolan, Biometrika 81 (1994) 351.
    """
    preparation = fit.weighed
    folds = [_folds(take, residual) for take, residual in _takes_and_residuals(fit)]
    errors: list[np.ndarray] = []
    responses: list[np.ndarray] = []
    for k in range(FOLDS):
        takes = tuple(
            replace(take, used=take.used & ~near[k])
            for take, (_, near) in zip(preparation.takes, folds, strict=True)
        )
        if min(int(take.used.sum()) for take in takes) < 2 * len(fit.estimates):
            return None
        solved = solve_from([fit.model.block], replace(preparation, takes=takes))
        fold_error, fold_response = [], []
        for take, (fold_of, _), simulation in zip(
            preparation.takes, folds, solved.simulations, strict=True
        ):
            scored = take.used & (fold_of == k)
            centre = take.recording.response[take.used].mean()
            fold_error.append((take.recording.response - simulation)[scored])
            fold_response.append(take.recording.response[scored] - centre)
        errors.append(np.concatenate(fold_error))
        responses.append(np.concatenate(fold_response))
    return _held_out_scores(errors, responses)


def _takes_and_residuals(fit: Fit) -> list[tuple[Take, np.ndarray]]:
    """Each recording of a fit with its residual (N,)."""
    return list(zip(fit.preparation.takes, fit.residuals, strict=True))


def _folds(take: Take, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Per sample its fold (N,), and per fold the samples (folds, N) in or next to it."""
    count = len(take.recording)
    stretch = max(count // _STRETCHES, 1)
    repeats = take.recording.drive_period()
    if repeats is not None and 2 * FOLDS * repeats.period <= count:
        stretch = repeats.period * max(1, round(stretch / repeats.period))
    fold_of = np.arange(count) // stretch % FOLDS
    gap = min(_correlation_length(residual[take.used]), stretch // 2)
    near = [
        maximum_filter1d((fold_of == k).astype(np.uint8), 2 * gap + 1, mode="constant") > 0
        for k in range(FOLDS)
    ]
    return fold_of, np.stack(near)


def _correlation_length(residual: np.ndarray) -> int:
    """The number of samples after which the residual's autocorrelation is below 0.1."""
    centred = residual - residual.mean()
    size = 1 << int(np.ceil(np.log2(2 * centred.size)))
    products = np.fft.irfft(np.abs(np.fft.rfft(centred, size)) ** 2, size)[: centred.size]
    below = np.flatnonzero(products < _UNCORRELATED * products[0])
    return int(below[0]) if below.size else centred.size


def _held_out_scores(
    errors: Sequence[np.ndarray], responses: Sequence[np.ndarray]
) -> HeldOutScores:
    """The scores from each fold's errors (n,) and its responses (n,) minus their mean."""
    error = np.concatenate(errors)
    e_r = float(np.linalg.norm(error) / np.linalg.norm(np.concatenate(responses)))
    return HeldOutScores(
        rmse=float(np.sqrt(np.mean(error**2))),
        e_r=e_r,
        nrmse_percent=100 * (1 - e_r),
        folds=tuple(float(np.sqrt(np.mean(fold**2))) for fold in errors if fold.size),
    )
