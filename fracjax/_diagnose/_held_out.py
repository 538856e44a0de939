"""Comparison on held-out data: a recording if there is one, else stretches in turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._parameters import named_parameters
from .._prepare import Preparation, Problem, Take, layout_of
from .._recording import Recording
from .._solve import Solved, solve_from
from ._residual import errors_of

_FOLDS = 5
"""Folds of held-out data; chosen by judgement."""
_WILLING = 0.8
"""The smallest share of folds that must not contradict an effect; chosen by judgement."""
_SURE = 2.0
"""Standard errors from which a gain is significant."""
_CLEARLY_WORSE = 2.0
"""Ratio of errors from which a prediction is clearly worse; chosen by judgement."""
_AS_TRAINED = 2.0
"""Ratio of χ² per sample up to which a prediction agrees with the training; chosen by judgement."""
_BLOCKS = 22
"""Stretches of a recording.  If its drive occurs twice, no fold then contains the same phase of
both."""
_LEAST_KNOWN = 1e-10
"""The smallest information about a direction of the parameters, over the largest one: less counts
as this."""
_LEAST_READ = 1e-6
"""The smallest singular value of columns that are fitted to held-out data, over the largest one."""


@dataclass(frozen=True)
class Prediction:
    """Errors of one model on data that its fit has not used: RMSE in all and per fold, in the
    response's unit, and whitened errors (n,).

    `spread` (n, r) maps r independent standard normal numbers to the contribution of the
    parameters' uncertainty to the whitened errors.
    """

    rmse: float
    folds: tuple[float, ...]
    whitened: np.ndarray
    fold_of_sample: np.ndarray
    spread: np.ndarray

    def is_as_good_as(self, trained: float) -> bool:
        """Whether the whitened errors agree with the χ² per sample of the training, with the
        parameters taken as exact."""
        return float(np.mean(self.whitened**2)) <= _AS_TRAINED * trained


Predict = Callable[[Solved], Prediction]


def predicts_worse(predict: Predict, base: Prediction, extended: Prediction) -> bool:
    """Whether the extended model's error on a held-out recording is clearly larger than the base's:
    uncertain parameters do not excuse a prediction that is worse than without the effect.

    Stretches do not count: if the neighbouring stretches do not predict one, nothing does.
    """
    return predict is not predict_stretches and extended.rmse > _CLEARLY_WORSE * base.rmse


def predict_recording(solved: Solved, take: Take) -> Prediction:
    """The prediction of another recording by a solved block.

    The offset and the gains that are separate for each recording are estimated from it: for each
    fifth, which consists of interleaved stretches, from the other four.  For the RMSE, however, the
    offset is the mean error in its first samples, the baseline, which are not scored.
    """
    problem = Preparation((take,), solved.preparation.oversampling).problems()[0]
    parameters, layout = named_parameters(solved.block), layout_of(solved.block)
    anew = [name for name, _ in layout.gains if parameters[name].per_recording]
    response, columns = problem.linearised(solved.block, anew)
    error = np.asarray(problem.response) - response
    spread = _spread(solved, problem, anew)
    own = np.concatenate([problem.own, columns], axis=1)
    folds = _fold_of_sample(take.recording, error.size)
    counted = np.asarray(problem.weights) > 0
    counted[: take.baseline.stop] = False
    white, white_own, white_spread = (problem.whiten(signals) for signals in (error, own, spread))
    terms, of_spread = np.zeros_like(own), np.zeros_like(white_spread)
    open_ = np.zeros_like(own)
    for k in range(_FOLDS):
        inside, others = folds == k, counted & (folds != k)
        read = _Read(white_own[others])
        terms[inside] = read.of(white[others])
        of_spread[inside] = white_own[inside] @ read.of(white_spread[others])
        # If columns are nearly parallel there, fewer directions than columns are determined.
        open_[inside, : read.errors.shape[1]] = white_own[inside] @ read.errors
    error = error - np.sum(own * terms, axis=1)
    return _prediction(
        (error - error[take.baseline].mean())[counted],
        (white - np.sum(white_own * terms, axis=1))[counted],
        folds[counted],
        np.concatenate([white_spread - of_spread, open_], axis=1)[counted],
    )


class _Read:
    """Coefficients (q,) of columns (n, q), by least squares; `errors` (q, r) are their changes by
    one standard error in each independent direction."""

    def __init__(self, columns: np.ndarray):
        scale = np.linalg.norm(columns, axis=0) + 1e-300
        basis, singular, right = np.linalg.svd(columns / scale, full_matrices=False)
        kept = singular > _LEAST_READ * singular[0]
        self.basis = basis[:, kept]
        self.errors = (right[kept] / singular[kept, None] / scale).T

    def of(self, signals: np.ndarray) -> np.ndarray:
        """The coefficients (q, …) of signals (n, …)."""
        return self.errors @ (self.basis.T @ signals)


def _spread(solved: Solved, problem: Problem, anew: Sequence[str]) -> np.ndarray:
    """The changes of the response (L, r) in another recording by one standard error in each of r
    independent directions of the parameters, except those that are estimated anew."""
    sensitivity = solved.sensitivity()
    numbers, whitened = sensitivity.parameters, sensitivity.whitened
    # Parameters that are separate for each recording have the values of the first.
    transferred = [
        k for k, n in enumerate(numbers) if n.name not in anew and n.recording in (None, 0)
    ]
    names = list(dict.fromkeys(numbers[k].name for k in transferred))
    derivative = problem.linearised(solved.block, names)[1]
    # The usual range bounds a parameter that the training does not determine.
    parameters = named_parameters(solved.block)
    sds = [np.ravel(parameters[n.name].expected_sd)[n.component] for n in numbers]
    usual = np.eye(len(sds), whitened.shape[1]) / np.array(sds)[:, None]
    return derivative @ _Read(np.concatenate([whitened, usual])).errors[transferred]


def predict_stretches(solved: Solved) -> Prediction:
    """The prediction of each stretch by a fit that has not used it.

    The refit without a stretch b is computed to first order from the full fit, with J the whitened
    Jacobian and r the residual: θ_(b) = θ̂ - (JᵀJ - J_bᵀJ_b)⁻¹ J_bᵀ r_b.  If that changes the
    response by more than the noise, the first order is not accurate enough, and the refit is made.
    Five folds consist of interleaved stretches, which are whole periods if the drive repeats.
    """
    preparation, full = solved.preparation, _errors_of_fit(solved)
    weights = [np.asarray(problem.weights) > 0 for problem in preparation.problems()]
    folds = [
        _fold_of_sample(take.recording, w.size)
        for take, w in zip(preparation.takes, weights, strict=True)
    ]
    counted, fold = np.concatenate(weights), np.concatenate(folds)
    predicted, predicted_white = full.error.copy(), full.white.copy()
    spread = np.zeros_like(full.derivative)
    for k in range(_FOLDS):
        inside = counted & (fold == k)
        errors = _errors_without(full, inside)
        step = errors @ (errors.T @ (full.derivative[inside].T @ full.white[inside]))
        change = full.derivative[inside] @ step
        if change @ change <= change.size:
            predicted[inside] += full.raw[inside] @ step
            predicted_white[inside] += change
            spread[inside] = full.derivative[inside] @ errors
        else:
            trust = [
                np.where(f[: len(take.recording)] == k, 0.0, 1.0)
                for take, f in zip(preparation.takes, folds, strict=True)
            ]
            # All samples are scored, those too that the refit has not used.
            refit = solve_from([solved.block], preparation.with_trust(trust)).on(preparation)
            refit = _errors_of_fit(refit)
            predicted[inside], predicted_white[inside] = refit.error[inside], refit.white[inside]
            spread[inside] = refit.derivative[inside] @ _errors_without(refit, inside)
    return _prediction(predicted[counted], predicted_white[counted], fold[counted], spread[counted])


class _FitErrors(NamedTuple):
    """A fit's errors (ΣL,) and derivatives (ΣL, n), in the response's unit and whitened; the
    columns are scaled to unit length after whitening."""

    error: np.ndarray
    white: np.ndarray
    raw: np.ndarray
    derivative: np.ndarray


def _errors_of_fit(solved: Solved) -> _FitErrors:
    """The errors and the scaled derivatives of a fit at the padded recordings' samples."""
    error, white = errors_of(solved)
    _, raw, whitened = solved.sensitivity()
    scale = np.linalg.norm(whitened, axis=0) + 1e-300
    return _FitErrors(error, white, raw / scale, whitened / scale)


def _fold_of_sample(recording: Recording, size: int) -> np.ndarray:
    """The index of the fold of each sample (size,), in interleaved stretches."""
    repeats, stretch = recording.drive_period(), len(recording) / _BLOCKS
    if repeats is not None and repeats.period < len(recording) / _FOLDS:
        stretch = repeats.period * max(1, round(stretch / repeats.period))
    return (np.arange(size) / stretch).astype(int) % _FOLDS


def _errors_without(fit: _FitErrors, inside: np.ndarray) -> np.ndarray:
    """One standard error of the parameters in each independent direction (n, n), if the samples
    `inside` are left out."""
    own = fit.derivative[inside]
    squares, turned = np.linalg.eigh(fit.derivative.T @ fit.derivative - own.T @ own)
    return turned / np.sqrt(np.maximum(squares, _LEAST_KNOWN * squares[-1]))


def _prediction(
    error: np.ndarray, whitened: np.ndarray, fold: np.ndarray, spread: np.ndarray
) -> Prediction:
    """The prediction from errors (n,), in the response's unit and whitened, and folds (n,)."""
    folds = tuple(float(np.sqrt(np.mean(error[fold == k] ** 2))) for k in np.unique(fold))
    return Prediction(float(np.sqrt(np.mean(error**2))), folds, whitened, fold, spread)


@dataclass(frozen=True)
class Gain:
    """Base against extended model on held-out data.

    `fall` is the reduction of χ², with its standard error; `improved` the share of folds that do
    not contradict the effect; `predicted_folds` states which folds the extended model can predict
    at all; `base_rmse` and `extended_rmse` are the errors in those, in the response's unit; and
    `chi_square_per_sample` is that of the extended model.
    """

    fall: float
    standard_error: float
    improved: float
    predicted_folds: tuple[bool, ...]
    base_rmse: float
    extended_rmse: float
    chi_square_per_sample: float

    @property
    def convincing(self) -> bool:
        """More than 2 standard errors, and negative in no more than a fifth of the folds."""
        return self.fall > _SURE * self.standard_error and not self.refuted

    @property
    def refuted(self) -> bool:
        """Negative altogether, or in more than a fifth of the folds."""
        return self.fall < 0 or self.improved < _WILLING

    def agrees_with_training(self, trained: float) -> bool:
        """Whether the extended model's χ² per sample agrees with that of the training."""
        return self.chi_square_per_sample <= _AS_TRAINED * trained

    @property
    def is_open(self) -> bool:
        """Whether the held-out data cannot decide between the two models.

        If the whitened predictions of two models differ by d, the right one's χ² is lower by
        d² ± 2 d, with the standard error 2 d: this can be convincing only if 2 d exceeds 8.
        """
        return self.standard_error < 4 * _SURE

    @property
    def share_of_rmse(self) -> float:
        """The reduction of the RMSE, as a share of the base's."""
        return 1 - self.extended_rmse / self.base_rmse


def gain(base: Prediction, extended: Prediction) -> Gain:
    r"""The gain of an effect on held-out data, with regard to the uncertainty of each model.

    If a model is right, the whitened errors e of a fold have the covariance V = I + S Sᵀ, where S
    is the spread: the uncertainty of its parameters is no error of the model.

        fall = Σ_folds (eᵀV⁻¹e)_base - (eᵀV⁻¹e)_extended

    The standard error of one fold's contribution is 2 ‖(V⁻¹e)_base - (V⁻¹e)_extended‖; a fold that
    is negative by more than that contradicts the effect.  The RMSE has no V: a fold counts for it
    if the uncertainty of the extended model changes it less than the effect does.
    """
    folds = [base.fold_of_sample == k for k in np.unique(base.fold_of_sample)]
    before, after = ([_weighed(p, k) for k in folds] for p in (base, extended))
    pairs = list(zip(folds, before, after, strict=True))
    chi_squares = np.array([extended.whitened[k] @ a for k, _, a in pairs])
    falls = np.array([base.whitened[k] @ b for k, b, _ in pairs]) - chi_squares
    unsure = np.array([2 * np.linalg.norm(b - a) for _, b, a in pairs])
    predicted_folds = np.array([_is_predicted(base, extended, k) for k in folds])
    sizes = np.array([np.count_nonzero(k) for k in folds])
    sizes = sizes * (predicted_folds if predicted_folds.any() else 1)

    def rmse(prediction: Prediction) -> float:
        return float(np.sqrt(np.average(np.square(prediction.folds), weights=sizes)))

    return Gain(
        fall=float(np.sum(falls)),
        standard_error=float(np.linalg.norm(unsure)),
        improved=1 - float(np.mean(falls < -unsure)),
        predicted_folds=tuple(predicted_folds.tolist()),
        base_rmse=rmse(base),
        extended_rmse=rmse(extended),
        chi_square_per_sample=float(np.sum(chi_squares)) / extended.whitened.size,
    )


def _weighed(prediction: Prediction, fold: np.ndarray) -> np.ndarray:
    """V⁻¹e of a fold's errors."""
    error = prediction.whitened[fold]
    basis, sizes, _ = np.linalg.svd(prediction.spread[fold], full_matrices=False)
    return error - basis @ (sizes**2 / (1 + sizes**2) * (basis.T @ error))


def _is_predicted(base: Prediction, extended: Prediction, fold: np.ndarray) -> bool:
    """Whether the extended model's uncertainty changes the χ² of a fold less than the effect."""
    before, after = base.whitened[fold], extended.whitened[fold]
    open_ = np.linalg.norm((before - after) @ extended.spread[fold])
    return bool(abs(before @ before - after @ after) > 2 * open_)
