"""Predictions of held-out data: a recording if there is one, else stretches in turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from .._parameters import named_parameters
from .._prepare import Preparation, Take, layout_of
from .._recording import Recording
from ._fitted import Fitted

_Value = TypeVar("_Value")

FOLDS = 5
"""Folds of held-out data; chosen by judgement."""
STRETCHES = 22
"""Stretches of a recording.  If its drive occurs twice, no fold then contains the same phase of
both."""
_LEAST_READ = 1e-6
"""The smallest singular value of columns that are fitted to held-out data, over the largest one."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """How one model predicts data that its fit has not used.

    Per fold: the RMSE in the response's unit, the number of samples, and whether the other folds
    determine the prediction, with less uncertainty than the error of the whole fit.  Of a recording
    also the response (N,) that is predicted, and which samples (N,) are scored.
    """

    folds: tuple[float, ...]
    counts: tuple[int, ...]
    determined: tuple[bool, ...]
    response: np.ndarray | None = None
    scored: np.ndarray | None = None

    @property
    def rmse(self) -> float:
        """RMSE over all folds."""
        return float(np.sqrt(np.average(np.square(self.folds), weights=self.counts)))

    def of(self, folds: Sequence[int]) -> Prediction:
        """The prediction of some folds alone."""

        def some(values: tuple[_Value, ...]) -> tuple[_Value, ...]:
            return tuple(values[k] for k in folds)

        return replace(
            self,
            folds=some(self.folds),
            counts=some(self.counts),
            determined=some(self.determined),
        )


def of_determined(predictions: Sequence[Prediction]) -> list[Prediction]:
    """Predictions of the held-out folds that the others determine under every model, if there are
    any: a recording's only step, held out, says nothing about creep."""
    each = zip(*(prediction.determined for prediction in predictions), strict=True)
    common = [k for k, determined in enumerate(each) if all(determined)]
    return [p.of(common) for p in predictions] if common else list(predictions)


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
        # The constant among them is none of the prediction: its zero is read below, for all folds.
        error[inside] -= own[inside, 1:] @ terms[1:]
    error -= error[take.baseline].mean()
    scores = _prediction(error[counted], folds[counted], np.zeros(FOLDS))
    measured = take.recording.response
    count = measured.size
    return replace(scores, response=measured - error[:count], scored=counted[:count])


def predict_stretches(fitted: Fitted) -> Prediction:
    """The prediction of each stretch by a fit without it, to first order about the full one.

    With J the whitened Jacobian and r the residual, a fit without the stretch b has
    θ_(b) = θ̂ - (JᵀJ - J_bᵀJ_b)⁻¹ J_bᵀ r_b; the usual range bounds a parameter that the others do
    not determine.  Five folds consist of interleaved stretches, which are whole periods if the
    drive repeats.  A fold's prediction is as uncertain as its parameters.
    """
    fold, counted = folds_of(fitted), fitted.counted
    white, residual = fitted.whitened(fitted.tangent), fitted.whitened(fitted.error)
    free = fitted.solved.on(fitted.preparation).sensitivity().parameters
    parameters = named_parameters(fitted.solved.block)
    ranges = [np.ravel(parameters[p.name].expected_sd)[p.component] for p in free]
    usual = np.eye(len(free), white.shape[1]) / np.array(ranges)[:, None]
    error, uncertainty = fitted.error.copy(), np.zeros(FOLDS)
    for k in range(FOLDS):
        inside, others = counted & (fold == k), counted & (fold != k)
        # As Jᵀr = 0, the sum over the other stretches is minus that over this one.
        rows = np.concatenate([white[others], usual])
        # A gain that only this fold determines keeps its value.
        scale = np.linalg.norm(rows, axis=0) + 1e-300
        toward = np.concatenate([residual[others], np.zeros(len(usual))])
        basis, sizes, turned = np.linalg.svd(rows / scale, full_matrices=False)
        clear = sizes > np.finfo(float).eps * len(rows) * sizes[0]
        # Of the prediction by coefficients that are uncorrelated and of unit variance.
        moved = (fitted.tangent[inside] / scale) @ (turned[clear].T / sizes[clear])
        error[inside] -= moved @ (basis[:, clear].T @ toward)
        variance = np.mean(np.sum(moved**2, axis=1))
        uncertainty[k] = np.sqrt(variance / max(np.mean(fitted.error[inside] ** 2), 1e-300))
    return _prediction(error[counted], fold[counted], uncertainty)


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


def _prediction(error: np.ndarray, fold: np.ndarray, uncertainty: np.ndarray) -> Prediction:
    """The prediction with errors (n,) in folds (n,), and its uncertainty (FOLDS,) over the fit's
    error."""
    present = np.unique(fold)
    parts = [error[fold == k] for k in present]
    return Prediction(
        tuple(float(np.sqrt(np.mean(part**2))) for part in parts),
        tuple(part.size for part in parts),
        tuple((uncertainty[present] < 1).tolist()),
    )
