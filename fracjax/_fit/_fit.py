"""Fitting a model to recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np

from .._computing import computing
from .._models import Model
from .._prepare import Asked, Noise, Past, model_of, ready, recordings_of, whole
from .._recording import Recording
from .._solve import Progress, Solved, silent, too_coarse
from ._result import Fit, Scores
from ._robust import Loss, reweighted, shape_of
from ._settle import settle_finely
from ._uncertainty import uncertainty_of


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
    """The result, with standard errors, from a solved block."""
    robust = None
    if loss == "least_squares":
        inflation = float(np.sqrt(solved.left))
    else:
        solved, robust, inflation = reweighted(solved, loss)
    preparation = solved.preparation
    first = preparation.takes[0].recording
    known = uncertainty_of(
        solved.blocks,
        preparation.problems(),
        preparation.conditions,
        units=(first.drive_unit, first.response_unit),
        inflation=inflation,
        residuals=solved.whitened,
    )
    return Fit(
        model=Model(solved.block, model.name),
        preparation=preparation,
        estimates=known.estimates,
        correlated=known.correlated,
        offsets=tuple(float(terms[0]) for terms in solved.own),
        simulations=solved.simulations,
        scores=scores_of(solved),
        converged=solved.converged,
        start_costs=solved.start_costs,
        models=tuple(Model(block, model.name) for block in solved.blocks),
        combinations=known.combinations,
        residual_order=known.order,
        robust=robust,
    )


def fit(
    model: Model | str,
    recordings: Recording | Sequence[Recording],
    *,
    noise: Noise | float | str | None = None,
    settling: int | str | None = None,
    history: Past | None = None,
    loss: Loss = "least_squares",
    starts: int = 8,
    seed: int = 0,
    progress: Progress = silent,
    **asked: Unpack[Asked],
) -> Fit:
    """Fit a model to one recording, or to several with shared parameters and own offsets.

    Least squares, whitened by the noise's own colour, gains eliminated, from `starts` points.  A
    model is also given by its name, "foh >> creep".  `noise`: the sensor's, as specified, such as
    "0.07 um", used where neither repeats nor rests show it; or a Noise, used as it is.
    `history` and `settling`, samples or a time such as "1 s", are decided from the data where not
    given; the history "estimated" fits what the drive before the first sample still adds.  `loss`:
    "huber", "soft_l1" or "student_t" let outliers weigh less.

    By name, `fixed` holds parameters at values, `bounds` narrows their range, `priors` says what
    was known of them before, `tied` lets one equal another, `{"second.mu": "first.alpha"}`, or a
    multiple of it, `("first.alpha", 2.0)`; of `own` every recording has its own value, told as
    `name@1`, `name@2`, …, as it has of what begins anew with it, such as the mains' phases.
    `weights` (N,), one array per recording, multiply the squared residuals, `mask` leaves out times
    [s], ends included.

    The simulation's step is halved until that no longer matters beside the noise, or to 32 steps
    per sample; where it still matters then, a warning says so.
    Raises InputError where names are unknown, and for what does not fit together.  A fit that did
    not converge says so in `converged`.
    """
    listed = recordings_of(recordings)
    model = model_of(model, listed)
    shape_of(loss)
    starts, seed = whole(starts, "starts", 1), whole(seed, "seed", 0)
    with computing():
        progress(f"fitting {model.name}")
        block, preparation = ready(
            model, listed, noise=noise, history=history, settling=settling, **asked
        )
        solved, numerics = settle_finely(
            block, preparation, history=history, starts=starts, seed=seed, progress=progress
        )
        return replace(fit_of(model, solved, loss), warnings=too_coarse(numerics))
