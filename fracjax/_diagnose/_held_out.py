"""Predictions of held-out data: a recording if there is one, else stretches in turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .._parameters import named_parameters
from .._prepare import Preparation, Take, layout_of
from .._recording import Recording
from ._fitted import Fitted

FOLDS = 5
"""Folds of held-out data; chosen by judgement."""
STRETCHES = 22
"""Stretches of a recording.  If its drive occurs twice, no fold then contains the same phase of
both."""
_LEAST_READ = 1e-6
"""The smallest singular value of columns that are fitted to held-out data, over the largest one."""


@dataclass(frozen=True)
class Prediction:
    """RMSE of one model on data that its fit has not used, in all and per fold, in the response's
    unit."""

    rmse: float
    folds: tuple[float, ...]


Predict = Callable[[Fitted], Prediction]


def predict_recording(fitted: Fitted, take: Take) -> Prediction:
    """The prediction of another recording by a fitted block.

    The offset and the gains that are separate for each recording are estimated from it: for each
    fifth, which consists of interleaved stretches, from the other four.  Finally the mean error in
    its first samples, the baseline, is subtracted; these are not scored.
    """
    block, oversampling = fitted.solved.block, fitted.preparation.oversampling
    problem = Preparation((take,), oversampling).problems()[0]
    parameters, layout = named_parameters(block), layout_of(block)
    anew = [name for name, _ in layout.gains if parameters[name].per_recording]
    response, columns = problem.linearised(block, anew)
    error = np.asarray(problem.response) - response
    own = np.concatenate([problem.own, columns], axis=1)
    folds = fold_of_sample(take.recording, error.size)
    counted = np.asarray(problem.weights) > 0
    counted[: take.baseline.stop] = False
    white, white_own = problem.whiten(error), problem.whiten(own)
    for k in range(FOLDS):
        inside, others = folds == k, counted & (folds != k)
        terms = np.linalg.lstsq(white_own[others], white[others], rcond=_LEAST_READ)[0]
        error[inside] -= own[inside] @ terms
    return _prediction((error - error[take.baseline].mean())[counted], folds[counted])


def predict_stretches(fitted: Fitted) -> Prediction:
    """The prediction of each stretch by a fit without it, to first order about the full one.

    With J the whitened Jacobian and r the residual, a fit without the stretch b has
    θ_(b) = θ̂ - (JᵀJ - J_bᵀJ_b)⁻¹ J_bᵀ r_b; the usual range bounds a parameter that the others do
    not determine.  Five folds consist of interleaved stretches, which are whole periods if the
    drive repeats.
    """
    fold, counted = folds_of(fitted), fitted.counted
    white, residual = fitted.whitened(fitted.tangent), fitted.whitened(fitted.error)
    free = fitted.solved.on(fitted.preparation).sensitivity().parameters
    parameters = named_parameters(fitted.solved.block)
    ranges = [np.ravel(parameters[p.name].expected_sd)[p.component] for p in free]
    usual = np.eye(len(free), white.shape[1]) / np.array(ranges)[:, None]
    error = fitted.error.copy()
    for k in range(FOLDS):
        inside, others = counted & (fold == k), counted & (fold != k)
        # As Jᵀr = 0, the sum over the other stretches is minus that over this one.
        rows = np.concatenate([white[others], usual])
        # A gain that only this fold determines keeps its value.
        scale = np.linalg.norm(rows, axis=0) + 1e-300
        toward = np.concatenate([residual[others], np.zeros(len(usual))])
        step = np.linalg.lstsq(rows / scale, toward, rcond=None)[0] / scale
        error[inside] -= fitted.tangent[inside] @ step
    return _prediction(error[counted], fold[counted])


def folds_of(fitted: Fitted) -> np.ndarray:
    """The index of the fold of each padded sample (ΣL,) of all recordings."""
    pairs = zip(fitted.preparation.takes, fitted.problems, strict=True)
    return np.concatenate([fold_of_sample(t.recording, len(p.response)) for t, p in pairs])


def fold_of_sample(recording: Recording, size: int) -> np.ndarray:
    """The index of the fold of each sample (size,), in interleaved stretches."""
    repeats, stretch = recording.drive_period(), len(recording) / STRETCHES
    if repeats is not None and repeats.period < len(recording) / FOLDS:
        stretch = repeats.period * max(1, round(stretch / repeats.period))
    return (np.arange(size) / stretch).astype(int) % FOLDS


def _prediction(error: np.ndarray, fold: np.ndarray) -> Prediction:
    """The RMSE of errors (n,) in all and per fold."""
    folds = tuple(float(np.sqrt(np.mean(error[fold == k] ** 2))) for k in np.unique(fold))
    return Prediction(float(np.sqrt(np.mean(error**2))), folds)
