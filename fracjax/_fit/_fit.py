"""Fitting a model to recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Unpack

import numpy as np

from .._blocks import AbstractBlock
from .._computing import computing
from .._models import Model
from .._prepare import (
    Conditions,
    FitOptions,
    HistoryOption,
    Mask,
    ModelOptions,
    Noise,
    Preparation,
    apply_options,
    model_of,
    prepare,
    prepare_fit,
    recordings_of,
    require_whole_number,
)
from .._recording import Recording
from .._solve import Progress, Solved, discretisation_warnings, silent
from ._result import Fit, Scores
from ._robust import Loss, Robust, reweight, shape_of
from ._settle import settle_all_finely, settle_finely, tolerated_numerical_error
from ._uncertainty import Evidence, Uncertainty, uncertainties_of


def scores_of(solved: Solved) -> Scores:
    """Scores over the samples that count, all recordings together."""
    pairs = list(zip(solved.preparation.takes, solved.simulations, strict=True))
    residual = np.concatenate([(t.recording.response - s)[t.used] for t, s in pairs])
    centred = np.concatenate(
        [t.recording.response[t.used] - t.recording.response[t.used].mean() for t, _ in pairs]
    )
    e_r = float(np.linalg.norm(residual) / np.linalg.norm(centred))
    return Scores(
        rmse=float(np.sqrt(np.mean(residual**2))),
        e_r=e_r,
        nrmse_percent=100 * (1 - e_r),
        r_squared=1 - e_r**2,
        bic=solved.bic,
    )


def fit_of(model: Model, solved: Solved, loss: Loss = "least_squares") -> Fit:
    """The result of a fit, with standard errors, from a solved block."""
    return _fits_of([model], [solved], loss)[0]


def _fits_of(models: Sequence[Model], solved: Sequence[Solved], loss: Loss) -> list[Fit]:
    """The result of each of many fits; the standard errors of those alike are found together."""
    weighted: list[tuple[Solved, Robust | None, float]] = [
        (one, None, float(np.sqrt(one.excess_ratio)))
        if loss == "least_squares"
        else reweight(one, loss)
        for one in solved
    ]
    evidence = [_evidence_of(*each) for each in weighted]
    alike: dict[tuple, list[int]] = {}
    for at, (model, one) in enumerate(zip(models, evidence, strict=True)):
        recording = solved[at].preparation.takes[0].recording
        units = recording.drive_unit, recording.response_unit
        key = id(model), one.derivative.shape, one.residuals is None, units
        alike.setdefault(key, []).append(at)
    uncertainties: dict[int, Uncertainty] = {}
    for (*_, units), members in alike.items():
        conditions = solved[members[0]].preparation.conditions
        of_members = uncertainties_of([evidence[at] for at in members], conditions, units)
        uncertainties |= zip(members, of_members, strict=True)
    return [
        _fit_with(model, one, uncertainties[at], robust)
        for at, (model, (one, robust, _)) in enumerate(zip(models, weighted, strict=True))
    ]


def _evidence_of(solved: Solved, robust: Robust | None, inflation: float) -> Evidence:
    """What the standard errors of a fit follow from."""
    preparation = solved.preparation
    noises = [take.noise for take in preparation.takes]
    # A noise that is the residual itself has whitened it already.
    is_white = robust is None and all(noise and noise.is_residual for noise in noises)
    triangle = solved.triangle if is_white else None
    derivative = solved.whitened_derivative() if triangle is None else triangle
    residuals = None if is_white else solved.whitened
    return Evidence(
        solved.blocks,
        preparation.problems(),
        inflation,
        derivative,
        residuals,
        max(take.recording.rate for take in preparation.takes) / 2,
    )


def _fit_with(model: Model, solved: Solved, uncertainty: Uncertainty, robust: Robust | None) -> Fit:
    """The result of a fit with this uncertainty."""
    models = tuple(Model(block, model.name) for block in solved.blocks)
    return Fit(
        model=models[0],
        preparation=solved.preparation,
        estimates=uncertainty.estimates,
        correlated=uncertainty.correlated,
        offsets=tuple(float(terms[0]) for terms in solved.own),
        simulations=solved.simulations,
        scores=scores_of(solved),
        converged=solved.converged,
        start_costs=solved.start_costs,
        models=models,
        residual_order=uncertainty.order,
        correlation=uncertainty.correlation,
        robust=robust,
    )


def _warned_fits_of(
    models: Sequence[Model], settled: Sequence[tuple[Solved, float]], loss: Loss
) -> list[Fit]:
    """The results of solved problems, with warnings of their numerical errors [noise units]."""
    fits = _fits_of(models, [solved for solved, _ in settled], loss)
    return [
        replace(fit, warnings=discretisation_warnings(error, tolerated_numerical_error(solved)))
        for fit, (solved, error) in zip(fits, settled, strict=True)
    ]


class Outcome(NamedTuple):
    """What has become of one of many fits.

    Attributes:
        fit: the fit, or the error that ended it.
        stacked: whether it was solved together with others.
    """

    fit: Fit | Exception
    stacked: bool = False


def fit_all(
    models: Sequence[Model],
    recordings: Sequence[Recording],
    *,
    history: HistoryOption | None = None,
    settling: int | str | None = None,
    loss: Loss = "least_squares",
    starts: int = 8,
    seed: int = 0,
    mask: Mask = (),
    **options: Unpack[ModelOptions],
) -> list[Outcome]:
    """Each model fitted to its recording, as `fit` does it, recordings alike together.

    A recording that cannot be fitted has its error instead, and changes nothing for the others.
    """
    outcomes = [Outcome(RuntimeError())] * len(models)
    with computing():
        blocks: dict[int, tuple[AbstractBlock, Conditions]] = {}
        prepared: dict[int, tuple[AbstractBlock, Preparation]] = {}
        for at, (model, recording) in enumerate(zip(models, recordings, strict=True)):
            try:
                # Equal models are one object, so that their options are applied once.
                if id(model) not in blocks:
                    blocks[id(model)] = apply_options(model, **options)
                block, conditions = blocks[id(model)]
                preparation = prepare(
                    [recording], history=history, settling=settling, mask=mask,
                    conditions=conditions,
                )  # fmt: skip
                prepared[at] = block, preparation
            except Exception as error:
                outcomes[at] = Outcome(error)
        groups: list[list[int]] = [[*prepared]]
        while groups:
            group = groups.pop()
            try:
                settled = settle_all_finely(
                    [prepared[at][0] for at in group], [prepared[at][1] for at in group],
                    history=history, starts=starts, seed=seed, progress=silent,
                )  # fmt: skip
                fits = _warned_fits_of([models[at] for at in group], settled, loss)
            except Exception as error:
                # One of them is the cause: each is tried alone.
                if len(group) == 1:
                    outcomes[group[0]] = Outcome(error)
                else:
                    groups += [[at] for at in group]
                continue
            for at, (solved, _), fitted in zip(group, settled, fits, strict=True):
                outcomes[at] = Outcome(fitted, solved.stacked)
    return outcomes


def fit(
    model: Model | str,
    recordings: Recording | Sequence[Recording],
    *,
    noise: Noise | float | str | None = None,
    settling: int | str | None = None,
    history: HistoryOption | None = None,
    loss: Loss = "least_squares",
    starts: int = 8,
    seed: int = 0,
    progress: Progress = silent,
    **options: Unpack[FitOptions],
) -> Fit:
    """Fit a model to one recording, or to several with shared parameters and offsets of their own.

    The fit is by least squares, whitened by the noise's own colour, with gains eliminated.  The
    step of the simulation is halved until its error is negligible compared with the noise, or to 32
    steps per sample; a warning reports an error that remains.

    Args:
        model: a model, or its name, such as "foh >> creep".
        recordings: one recording or several, with their units.
        noise: the sensor's specified noise [response unit, rms], or a text such as "0.07 um", used
            where neither repeats nor rests show the noise; or a Noise, used as it is.
        settling: samples to leave out at the start, or a time such as "1 s"; decided from the data
            where not given.
        history: the drive before the first sample, "constant", "rest", "periodic" or "estimated",
            which fits the effect of an unknown drive; decided from the data where not given.
        loss: "least_squares", or "huber", "soft_l1" or "student_t", which reduce the weight of
            outliers.
        starts: the number of starts.
        seed: of the random starts.
        progress: called with a sentence at each stage.
        **options: by parameter name, in the parameters' units: `fixed` holds parameters at values,
            `bounds` narrows their range, `priors` gives prior knowledge, `tied` sets one equal to
            another, `{"creep.mu": "foh.alpha"}`, or to a multiple of it, `("foh.alpha", 2.0)`.
            `own` names parameters of which each recording has its own value, reported as `name@1`,
            `name@2`, …; parameters that start anew with each recording, such as the mains' phases,
            always have.  `weights` (N,), one array per recording, multiply the squared residuals.
            `mask` leaves out times [s], ends included.

    Returns:
        The fitted model with standard errors and scores; `converged` is false where the fit did not
        converge.

    Raises:
        InputError: where a name is unknown, or arguments do not fit together.
    """
    all_recordings = recordings_of(recordings)
    model = model_of(model, all_recordings)
    shape_of(loss)
    starts, seed = require_whole_number(starts, "starts", 1), require_whole_number(seed, "seed", 0)
    with computing():
        progress(f"fitting {model.name}")
        block, preparation = prepare_fit(
            model, all_recordings, noise=noise, history=history, settling=settling, **options
        )
        settled = settle_finely(
            block, preparation, history=history, starts=starts, seed=seed, progress=progress
        )
        return _warned_fits_of([model], [settled], loss)[0]
