"""Held-out comparison: by recording where there is one, else by stretches set aside in turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .._parameters import named_parameters
from .._prepare import Preparation, Take, layout_of
from .._recording import Recording
from ._fitted import Fitted

FOLDS = 5
# Of a drive given twice no fold holds the same phase of both times.
_BLOCKS = 22
_LEAST_READ = 1e-6
"""Of the direction that is read best, the share below which another is not read at all."""


@dataclass(frozen=True)
class Prediction:
    """Errors, rms, of one model on data it has not seen, altogether and by fold."""

    rmse: float
    folds: tuple[float, ...]


Predict = Callable[[Fitted], Prediction]


def predict_recording(found: Fitted, take: Take) -> Prediction:
    """A fitted block on another recording.

    What only that recording can show, its offset and the gains that begin anew with it, is read
    from it: for a fifth of it, interleaved stretches, from the other four.  The offset is the
    baseline displacement of its first samples, which are not scored.
    """
    block, oversampling = found.solved.block, found.preparation.oversampling
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


def predict_stretches(found: Fitted) -> Prediction:
    """Each stretch predicted by a fit that has not seen it, to first order about the full one.

    With J the whitened Jacobian and r the residual, a fit without the stretch b has
    θ_(b) = θ̂ - (JᵀJ - J_bᵀJ_b)⁻¹ J_bᵀ r_b; of a parameter that the others say nothing of, its usual
    range is known.  Stretches are whole periods where the drive has them; five folds of interleaved
    stretches.
    """
    takes, problems = found.preparation.takes, found.problems
    pairs = zip(takes, problems, strict=True)
    fold = np.concatenate([fold_of_sample(t.recording, len(p.response)) for t, p in pairs])
    counted = np.concatenate([np.asarray(problem.weights) for problem in problems]) > 0
    white, residual = found.whitened(found.tangent), found.whitened(found.error)
    fitted = found.solved.on(found.preparation).sensitivity().parameters
    parameters = named_parameters(found.solved.block)
    ranges = [np.ravel(parameters[p.name].expected_sd)[p.component] for p in fitted]
    usual = np.eye(len(fitted), white.shape[1]) / np.array(ranges)[:, None]
    error = found.error.copy()
    for k in range(FOLDS):
        inside, others = counted & (fold == k), counted & (fold != k)
        # The full fit has left none of what the others could still tell.
        rows = np.concatenate([white[others], usual])
        scale = np.linalg.norm(rows, axis=0)
        toward = np.concatenate([residual[others], np.zeros(len(usual))])
        step = np.linalg.lstsq(rows / scale, toward, rcond=None)[0] / scale
        error[inside] -= found.tangent[inside] @ step
    return _prediction(error[counted], fold[counted])


def fold_of_sample(recording: Recording, size: int) -> np.ndarray:
    """Which fold each of `size` samples from the recording's first belongs to."""
    repeats, stretch = recording.drive_period(), len(recording) / _BLOCKS
    if repeats is not None and repeats.period < len(recording) / FOLDS:
        stretch = repeats.period * max(1, round(stretch / repeats.period))
    return (np.arange(size) / stretch).astype(int) % FOLDS


def _prediction(error: np.ndarray, fold: np.ndarray) -> Prediction:
    folds = tuple(float(np.sqrt(np.mean(error[fold == k] ** 2))) for k in np.unique(fold))
    return Prediction(float(np.sqrt(np.mean(error**2))), folds)
