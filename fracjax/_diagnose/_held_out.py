"""Held-out comparison: by recording where there is one, else by stretches set aside in turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._fit import Preparation, Problem, Solved, Take, layout_of, sensitivity_of, solve_from
from .._parameters import named_parameters
from .._recording import Recording
from ._residual import errors_of

_FOLDS, _WILLING = 5, 0.8
# Of a drive given twice no fold holds the same phase of both times.
_BLOCKS = 22
_LEAST_KNOWN = 1e-10
"""Of what is known best: less known than that counts as this."""
_LEAST_READ = 1e-6


@dataclass(frozen=True)
class Prediction:
    """Errors of one model on data it has not seen: per fold RMSE, and whitened errors (n,).

    `spread` (n, r): what r independent standard normals make of the whitened errors through the
    uncertainty of the parameters.
    """

    rmse: float
    folds: tuple[float, ...]
    whitened: np.ndarray
    fold_of_sample: np.ndarray
    spread: np.ndarray


def predict_recording(solved: Solved, preparation: Preparation, take: Take) -> Prediction:
    """The solved block on another recording.

    What only that recording can tell, its offset and the gains that begin anew with it, is read
    from it: for a fifth of it, interleaved stretches, from the other four.  But for the RMSE the
    offset is the baseline displacement of its first samples, which are not scored.
    """
    problem = Preparation((take,), preparation.oversampling).problems()[0]
    parameters, layout = named_parameters(solved.block), layout_of(solved.block)
    anew = [name for name, _ in layout.gains if parameters[name].per_recording]
    response, columns = problem.linearised(solved.block, anew)
    error = np.asarray(problem.response) - response
    spread = _spread(solved, preparation, problem, anew)
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
        open_[inside] = white_own[inside] @ read.errors
    error = error - np.sum(own * terms, axis=1)
    return _prediction(
        (error - error[take.baseline].mean())[counted],
        (white - np.sum(white_own * terms, axis=1))[counted],
        folds[counted],
        np.concatenate([white_spread - of_spread, open_], axis=1)[counted],
    )


class _Read:
    """Coefficients (q,) of columns (n, q), by least squares; `errors` (q, r) is what one standard
    error in each independent direction makes of them."""

    def __init__(self, columns: np.ndarray):
        scale = np.linalg.norm(columns, axis=0) + 1e-300
        left, singular, right = np.linalg.svd(columns / scale, full_matrices=False)
        kept = singular > _LEAST_READ * singular[0]
        self.basis = left[:, kept]
        self.errors = (right[kept] / singular[kept, None] / scale).T

    def of(self, signals: np.ndarray) -> np.ndarray:
        """The coefficients (q, …) of signals (n, …)."""
        return self.errors @ (self.basis.T @ signals)


def _spread(
    solved: Solved, preparation: Preparation, problem: Problem, anew: Sequence[str]
) -> np.ndarray:
    """What one standard error in each independent direction of the parameters (r), but for those
    that begin anew, makes of the response (L, r) in another recording."""
    known = sensitivity_of(solved, preparation)
    # What a recording has for itself is taken over from the first.
    taken = [
        k for k, n in enumerate(known.numbers) if n.name not in anew and n.recording in (None, 0)
    ]
    names = list(dict.fromkeys(known.numbers[k].name for k in taken))
    derivative = problem.linearised(solved.block, names)[1]
    return derivative @ _Read(known.whitened).errors[taken]


def predict_stretches(solved: Solved, preparation: Preparation) -> Prediction:
    """Each stretch predicted by a fit that has not seen it.

    The refit without a stretch b is taken to first order from the full fit, with J the whitened
    Jacobian and r the residual: θ_(b) = θ̂ - (JᵀJ - J_bᵀJ_b)⁻¹ J_bᵀ r_b.  Where that moves the
    response by more than the noise, it is too far for a first order, and the refit is made.
    Stretches are whole periods where the drive has them; five folds of interleaved stretches.
    """
    seen = _seen(solved, preparation)
    weights = [np.asarray(problem.weights) > 0 for problem in preparation.problems()]
    folds = [
        _fold_of_sample(take.recording, w.size)
        for take, w in zip(preparation.takes, weights, strict=True)
    ]
    counted, fold = np.concatenate(weights), np.concatenate(folds)
    predicted, predicted_white = seen.error.copy(), seen.white.copy()
    spread = np.zeros_like(seen.derivative)
    for k in range(_FOLDS):
        inside = counted & (fold == k)
        errors = _errors_without(seen, inside)
        step = errors @ (errors.T @ (seen.derivative[inside].T @ seen.white[inside]))
        moved = seen.derivative[inside] @ step
        if moved @ moved <= moved.size:
            predicted[inside] += seen.raw[inside] @ step
            predicted_white[inside] += moved
            spread[inside] = seen.derivative[inside] @ errors
        else:
            trust = [
                np.where(f[: len(take.recording)] == k, 0.0, 1.0)
                for take, f in zip(preparation.takes, folds, strict=True)
            ]
            refit = _seen(solve_from([solved.block], preparation.with_trust(trust)), preparation)
            predicted[inside], predicted_white[inside] = refit.error[inside], refit.white[inside]
            spread[inside] = refit.derivative[inside] @ _errors_without(refit, inside)
    return _prediction(predicted[counted], predicted_white[counted], fold[counted], spread[counted])


class _Seen(NamedTuple):
    """A fit's errors (ΣL,) and derivative (ΣL, n), as they are and whitened; columns scaled."""

    error: np.ndarray
    white: np.ndarray
    raw: np.ndarray
    derivative: np.ndarray


def _seen(solved: Solved, preparation: Preparation) -> _Seen:
    error, white = errors_of(solved, preparation)
    _, raw, whitened = sensitivity_of(solved, preparation)
    scale = np.linalg.norm(whitened, axis=0) + 1e-300
    return _Seen(error, white, raw / scale, whitened / scale)


def _fold_of_sample(recording: Recording, size: int) -> np.ndarray:
    repeats, stretch = recording.drive_period(), len(recording) / _BLOCKS
    if repeats is not None and repeats.period < len(recording) / _FOLDS:
        stretch = repeats.period * max(1, round(stretch / repeats.period))
    return (np.arange(size) / stretch).astype(int) % _FOLDS


def _errors_without(seen: _Seen, inside: np.ndarray) -> np.ndarray:
    """One standard error in each independent direction (n, n), without some of the samples."""
    own = seen.derivative[inside]
    squares, turned = np.linalg.eigh(seen.derivative.T @ seen.derivative - own.T @ own)
    return turned / np.sqrt(np.maximum(squares, _LEAST_KNOWN * squares[-1]))


def _prediction(
    error: np.ndarray, whitened: np.ndarray, fold: np.ndarray, spread: np.ndarray
) -> Prediction:
    folds = tuple(float(np.sqrt(np.mean(error[fold == k] ** 2))) for k in np.unique(fold))
    return Prediction(float(np.sqrt(np.mean(error**2))), folds, whitened, fold, spread)


@dataclass(frozen=True)
class Gain:
    """Base against extended on held-out data: fall of χ² and its standard error, the share of folds
    that do not speak against the effect, which folds are heard at all, and the RMSE of both in
    them, in the response's unit."""

    fall: float
    standard_error: float
    improved: float
    heard: tuple[bool, ...]
    base_rmse: float
    extended_rmse: float

    @property
    def convincing(self) -> bool:
        """More than 2 standard errors, and negative in no more than a fifth of the folds."""
        return self.fall > 2 * self.standard_error and not self.refuted

    @property
    def refuted(self) -> bool:
        """Negative altogether, or in more than a fifth of the folds."""
        return self.fall < 0 or self.improved < _WILLING

    @property
    def share_of_rmse(self) -> float:
        """By how much of itself the RMSE falls."""
        return 1 - self.extended_rmse / self.base_rmse


def gain(base: Prediction, extended: Prediction) -> Gain:
    """The noise makes the fall of χ² uncertain by 2 ‖difference of the predictions‖.

    A fold is not heard where what the training leaves open of the parameters matters more in it
    than the effect.
    """
    difference = base.whitened - extended.whitened
    folds = [base.fold_of_sample == k for k in np.unique(base.fold_of_sample)]
    falls = np.array([np.sum(base.whitened[k] ** 2 - extended.whitened[k] ** 2) for k in folds])
    doubts = np.array([2 * np.linalg.norm(difference[k] @ extended.spread[k]) for k in folds])
    heard = np.abs(falls) > doubts
    fall = float(np.sum(falls, where=heard))
    spoken = difference[np.any(np.array(folds)[heard], axis=0)]
    sizes = np.array([np.count_nonzero(k) for k in folds]) * (heard if heard.any() else 1)

    def rmse(prediction: Prediction) -> float:
        return float(np.sqrt(np.average(np.square(prediction.folds), weights=sizes)))

    return Gain(
        fall=fall,
        standard_error=2 * float(np.linalg.norm(spoken)),
        improved=1 - float(np.mean(heard & (falls < -1e-3 * abs(fall)))),
        heard=tuple(heard.tolist()),
        base_rmse=rmse(base),
        extended_rmse=rmse(extended),
    )
