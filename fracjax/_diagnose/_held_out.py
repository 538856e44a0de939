"""Held-out comparison: by recording where there is one, else by stretches set aside in turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._parameters import named_parameters
from .._prepare import Preparation, Problem, Take, layout_of
from .._recording import Recording
from .._solve import Solved, solve_from

_FOLDS, _WILLING, _SURE, _CLEARLY_WORSE = 5, 0.8, 2.0, 2.0
_FORETOLD = 2.0
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


Predict = Callable[[Solved, Preparation], Prediction]


def foretells_worse(predict: Predict, base: Prediction, extended: Prediction) -> bool:
    """Whether a recording that was held out is clearly further from the extended model than from
    the base: what the training leaves open excuses no prediction that is worse than none.

    Stretches are no such recording: where their neighbours do not foretell them, nothing does.
    """
    return predict is not predict_stretches and extended.rmse > _CLEARLY_WORSE * base.rmse


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
        # Of columns that look alike there, fewer directions than columns are known.
        open_[inside, : read.errors.shape[1]] = white_own[inside] @ read.errors
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
    known = solved.on(preparation).sensitivity()
    # What a recording has for itself is taken over from the first.
    taken = [
        k for k, n in enumerate(known.parameters) if n.name not in anew and n.recording in (None, 0)
    ]
    names = list(dict.fromkeys(known.parameters[k].name for k in taken))
    derivative = problem.linearised(solved.block, names)[1]
    # Of a number that the training says nothing of, its usual range is known.
    parameters = named_parameters(solved.block)
    sds = [np.ravel(parameters[n.name].expected_sd)[n.component] for n in known.parameters]
    usual = np.eye(len(sds), known.whitened.shape[1]) / np.array(sds)[:, None]
    return derivative @ _Read(np.concatenate([known.whitened, usual])).errors[taken]


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


def errors_of(solved: Solved, preparation: Preparation) -> tuple[np.ndarray, np.ndarray]:
    """What a fit leaves (ΣL,) at the padded recordings' samples, as it is and whitened."""
    problems, errors = preparation.problems(), []
    for problem, simulation in zip(problems, solved.simulations, strict=True):
        error = np.zeros(len(problem.response))
        error[: simulation.size] = np.asarray(problem.response)[: simulation.size] - simulation
        errors.append(error)
    whitened = [problem.whiten(error) for problem, error in zip(problems, errors, strict=True)]
    return np.concatenate(errors), np.concatenate(whitened)


class _Seen(NamedTuple):
    """A fit's errors (ΣL,) and derivative (ΣL, n), as they are and whitened; columns scaled."""

    error: np.ndarray
    white: np.ndarray
    raw: np.ndarray
    derivative: np.ndarray


def _seen(solved: Solved, preparation: Preparation) -> _Seen:
    error, white = errors_of(solved, preparation)
    _, raw, whitened = solved.on(preparation).sensitivity()
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
    that do not speak against the effect, which folds the extended model foretells at all, and the
    RMSE of both in them, in the response's unit; and χ² per sample that the extended one leaves."""

    fall: float
    standard_error: float
    improved: float
    foretold: tuple[bool, ...]
    base_rmse: float
    extended_rmse: float
    left: float

    @property
    def convincing(self) -> bool:
        """More than 2 standard errors, and negative in no more than a fifth of the folds."""
        return self.fall > _SURE * self.standard_error and not self.refuted

    @property
    def refuted(self) -> bool:
        """Negative altogether, or in more than a fifth of the folds."""
        return self.fall < 0 or self.improved < _WILLING

    def foretells(self, trained: float) -> bool:
        """Whether it is as far off as what the training leaves, χ² per sample, lets expect."""
        return self.left <= _FORETOLD * trained

    @property
    def share_of_rmse(self) -> float:
        """By how much of itself the RMSE falls."""
        return 1 - self.extended_rmse / self.base_rmse


def gain(base: Prediction, extended: Prediction) -> Gain:
    r"""What the effect gains on held-out data, where each model answers for what it claims to know.

    Of a right model the whitened errors e of a fold have the covariance V = I + S Sᵀ, S the spread:
    what the training leaves open of its parameters is no error of the model.

        fall = Σ_folds (eᵀV⁻¹e)_base - (eᵀV⁻¹e)_extended

    The noise makes a fold's uncertain by 2 ‖(V⁻¹e)_base - (V⁻¹e)_extended‖; one that is negative by
    more than that speaks against the effect.  For the RMSE, which knows no V, a fold counts where
    what is left open of the extended model changes it less than the effect does.
    """
    folds = [base.fold_of_sample == k for k in np.unique(base.fold_of_sample)]
    before, after = ([_weighed(p, k) for k in folds] for p in (base, extended))
    pairs = list(zip(folds, before, after, strict=True))
    left = np.array([extended.whitened[k] @ a for k, _, a in pairs])
    falls = np.array([base.whitened[k] @ b for k, b, _ in pairs]) - left
    unsure = np.array([2 * np.linalg.norm(b - a) for _, b, a in pairs])
    foretold = np.array([_is_foretold(base, extended, k) for k in folds])
    sizes = np.array([np.count_nonzero(k) for k in folds])
    sizes = sizes * (foretold if foretold.any() else 1)

    def rmse(prediction: Prediction) -> float:
        return float(np.sqrt(np.average(np.square(prediction.folds), weights=sizes)))

    return Gain(
        fall=float(np.sum(falls)),
        standard_error=float(np.linalg.norm(unsure)),
        improved=1 - float(np.mean(falls < -unsure)),
        foretold=tuple(foretold.tolist()),
        base_rmse=rmse(base),
        extended_rmse=rmse(extended),
        left=float(np.sum(left)) / extended.whitened.size,
    )


def _weighed(prediction: Prediction, fold: np.ndarray) -> np.ndarray:
    """V⁻¹e of a fold's errors."""
    error = prediction.whitened[fold]
    basis, sizes, _ = np.linalg.svd(prediction.spread[fold], full_matrices=False)
    return error - basis @ (sizes**2 / (1 + sizes**2) * (basis.T @ error))


def _is_foretold(base: Prediction, extended: Prediction, fold: np.ndarray) -> bool:
    before, after = base.whitened[fold], extended.whitened[fold]
    open_ = np.linalg.norm((before - after) @ extended.spread[fold])
    return bool(abs(before @ before - after @ after) > 2 * open_)
