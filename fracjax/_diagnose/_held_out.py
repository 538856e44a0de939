"""Held-out comparison: by recording where there is one, else by stretches set aside in turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._fit import Preparation, Problem, Solved, Take, jacobian, layout_of

_FOLDS, _WILLING = 5, 0.8
# Of a drive given twice no fold holds the same phase of both times.
_BLOCKS = 22
_LEAST_KNOWN = 1e-10
"""Of what is known best: less known than that counts as this."""


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

    The recording's baseline displacement is read from its first samples, which are not scored.
    """
    problem = Preparation((take,), preparation.oversampling).problems()[0]
    samples = len(take.recording)
    error = take.recording.response - np.asarray(problem.simulate(solved.block))[:samples]
    error = error - error[take.baseline].mean()
    scored = np.arange(samples) >= take.baseline.stop
    folds = np.minimum(np.arange(samples) * _FOLDS // samples, _FOLDS - 1)
    assert take.noise is not None  # given its noise by the caller
    sigma = take.noise.sigma
    spread = _spread(solved, preparation, problem)[:samples]
    spread = (spread - spread[take.baseline].mean(axis=0)) / sigma
    return _prediction(error[scored], error[scored] / sigma, folds[scored], spread[scored])


def _spread(solved: Solved, preparation: Preparation, problem: Problem) -> np.ndarray:
    """What one standard error in each independent direction of the parameters (r) makes of the
    response (L, r) in another recording."""
    layout = layout_of(solved.block)
    names = [name for name, _ in layout.shapes + layout.gains]
    derivative = problem.linearised(solved.block, names)[1]
    known = jacobian(solved.block, preparation.problems())[1]
    scale = np.linalg.norm(known, axis=0) + 1e-300
    _, singular, directions = np.linalg.svd(known / scale, full_matrices=False)
    kept = singular > 1e-6 * singular[0]
    errors = (directions[kept] / singular[kept, None] / scale).T
    return derivative @ errors[: derivative.shape[1]]


def predict_stretches(solved: Solved, preparation: Preparation) -> Prediction:
    """Each stretch predicted by a fit that has not seen it.

    The refit without a stretch b is taken to first order from the full fit, with J the whitened
    Jacobian and r the residual: θ_(b) = θ̂ - (JᵀJ - J_bᵀJ_b)⁻¹ J_bᵀ r_b.
    Stretches are whole periods where the drive has them; five folds of interleaved stretches.
    """
    problems = preparation.problems()
    raw, whitened = (np.asarray(a) for a in jacobian(solved.block, problems))
    lengths = [p.response.shape[0] for p in problems]
    residual, filtered, used, folds = [], [], [], []
    for take, problem, simulation in zip(
        preparation.takes, problems, solved.simulations, strict=True
    ):
        samples, length = len(take.recording), problem.response.shape[0]
        error = np.zeros(length)
        error[:samples] = take.recording.response - simulation
        residual.append(error)
        filtered.append(np.asarray(problem.whiten(error)))
        used.append(np.asarray(problem.weights) > 0)
        repeats = take.recording.drive_period()
        stretch = samples / _BLOCKS
        if repeats is not None and repeats.period < samples / _FOLDS:
            stretch = repeats.period * max(1, round(stretch / repeats.period))
        folds.append((np.arange(length) / stretch).astype(int) % _FOLDS)
    assert sum(lengths) == raw.shape[0]
    error, white = np.concatenate(residual), np.concatenate(filtered)
    counted, fold = np.concatenate(used), np.concatenate(folds)

    scale = np.linalg.norm(whitened, axis=0) + 1e-300
    derivative, raw = whitened / scale, raw / scale
    information = derivative.T @ derivative
    predicted, predicted_white = error.copy(), white.copy()
    spread = np.zeros_like(derivative)
    for k in range(_FOLDS):
        inside = counted & (fold == k)
        own = derivative[inside]
        squares, turned = np.linalg.eigh(information - own.T @ own)
        errors = turned / np.sqrt(np.maximum(squares, _LEAST_KNOWN * squares[-1]))
        step = errors @ (errors.T @ (own.T @ white[inside]))
        predicted[inside] += raw[inside] @ step
        predicted_white[inside] += own @ step
        spread[inside] = own @ errors
    return _prediction(predicted[counted], predicted_white[counted], fold[counted], spread[counted])


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
