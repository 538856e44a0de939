"""How far a prediction may be off: the interval of a model's response, of its parameters and of the
noise together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._computing import computing
from .._prepare import Take, free_parameters_of
from .._recording import Recording
from .._solve import Linearised, sensitivity
from ._held_out import take_to_predict
from ._result import Fit


def interval_errors(fit: Fit, most: int) -> list[np.ndarray]:
    """The standard deviation (N,) [response] of a new sample about the model, for each of at most
    so many recordings.

    With J the derivative of the response by the parameters, minus its mean where the zero is read
    from n samples, C their covariance and σ the noise:

        s² = σ² (1 + 1/n) + diag(J C Jᵀ)

    What the model leaves out is in C alone, which a misfit inflates.
    """
    takes = fit.preparation.takes[:most]
    problems = fit.preparation.problems()[:most]
    return _errors(fit, problems, takes, [take.used for take in takes])


def interval_errors_beyond(fit: Fit, recording: Recording) -> np.ndarray:
    """The same (N,) of a recording held out, whose zero is read from its first samples."""
    take, problem = take_to_predict(fit, recording)
    zero = np.zeros(len(recording), bool)
    zero[take.baseline] = True
    return _errors(fit, [problem], [take], [zero])[0]


def _errors(
    fit: Fit, problems: Sequence[Linearised], takes: Sequence[Take], zeros: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """The standard deviations (N,) of recordings, by the samples (N,) that each zero is from."""
    block, preparation = fit.model.block, fit.preparation
    parameters = free_parameters_of(block, len(preparation.takes), preparation.conditions)
    blocks = [block] * len(takes)
    if not parameters.shared:
        blocks = [model.block for model in fit.models[: len(takes)]]
    with computing():
        derivative = sensitivity(blocks, problems, parameters)[0][:, : len(parameters.labels)]
    errors = np.array([estimate.standard_error for estimate in fit.estimates])
    ends = np.cumsum([len(problem.response) for problem in problems])[:-1]
    deviations = []
    for part, take, zero in zip(np.split(derivative, ends), takes, zeros, strict=True):
        columns = part[: len(take.recording)] * errors
        columns = columns - columns[zero].mean(axis=0)
        sigma = fit.noise.sigma if take.noise is None else take.noise.sigma
        variance = np.einsum("ni,ni->n", columns @ fit.correlation, columns)
        deviations.append(np.sqrt(sigma**2 * (1 + 1 / zero.sum()) + np.maximum(variance, 0.0)))
    return deviations
