"""Results as sentences and tables, the same on the terminal and in the report."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from .._fit import (
    Comparison,
    Fit,
    combination_row,
    estimate_row,
    is_useless,
    listed,
    rank_fits,
    shortcomings_of,
)
from .._prepare import Noise
from .._show import figure, percentage, pretty_unit, quantity

if TYPE_CHECKING:
    from .._crosscheck import Crosscheck
    from .._diagnose import Diagnosis
    from .._fit import HeldOutScores
    from .._frequency import FrequencyFit

Figures = tuple[list[str], list[list[str]]]
"""Headers and rows of a table."""
_METHODS = {
    "repeats": "from repeats",
    "static": "at rest",
    "specification": "as specified",
    "residual": "from the residual itself",
}


def opening(sentence: str) -> str:
    """A sentence with its first letter in upper case."""
    return sentence[:1].upper() + sentence[1:]


def noise_of(fit: Fit) -> Noise:
    """The noise by which the residuals of a fit were weighted."""
    return fit.noise


def noise_text(noise: Noise) -> str:
    """The noise floor, how sure it is, and how it was determined."""
    error = noise.relative_error
    doubt = "" if error is None else f" ± {percentage(error)} %"
    return f"{quantity(noise.sigma, noise.unit)}{doubt} ({_METHODS[noise.method]})"


def sources(fit: Fit) -> str:
    """The names of the fitted files; of more than three, the first and their number."""
    names = [Path(take.recording.source).name for take in fit.preparation.takes]
    return ", ".join(names) if len(names) <= 3 else f"{names[0]} and {len(names) - 1} others"


def fit_sentence(fits: Sequence[Fit]) -> str:
    """What a fit, or the best of several, is worth, and its error compared with the noise."""
    fit, noise = fits[0], noise_of(fits[0])
    recording = fit.preparation.takes[0].recording
    scores, files = fit.scores, sources(fit)
    best = _best_of(fits)
    error = f"error of {quantity(scores.rmse, recording.response_unit)} rms"
    error += f" (fit {scores.nrmse_percent:.4g} %)"
    if noise.method == "residual":
        rests = "the rests do not show" if recording.static_stretches() else "no rest shows"
        most = f", of which neighbouring samples show at most {quantity(noise.sigma, noise.unit)}"
        error += f"; no repeat and {rests} how much of the error is noise"
        error += most if fit.shortcomings else ""
    else:
        error += (
            f", {figure(scores.rmse / noise.sigma)} times the noise floor of {noise_text(noise)}"
        )
    if not fit.shortcomings:
        return f"{fit.model.name} describes {files}{best}, with an {error}."
    others = shortcomings_of(scores.rmse, np.inf, scores.r_squared, fit.at_bound)
    why = f": {', and '.join(others)}" if others else ""
    if is_useless(scores.r_squared):
        return (
            f"{fit.model.name} does not describe {files}{best and ','}{best}{why}, with an {error}."
        )
    return f"{fit.model.name} describes {files}{best} only in part{why}, with an {error}."


def _best_of(fits: Sequence[Fit]) -> str:
    """By what the first of several fits is the best."""
    if len(fits) == 1:
        return ""
    by = "by BIC" if rank_fits(fits)[0][0] is fits[0] else "on data held out"
    return f" best of {len(fits)} models {by}"


def fit_badge(fits: Sequence[Fit]) -> tuple[str, str]:
    """The badge of a report of fits, best first, and the verdict that colours it."""
    if not all(fit.converged for fit in fits):
        return "not converged", "unexplained"
    if not fits[0].shortcomings:
        return "converged", "none"
    useless = is_useless(fits[0].scores.r_squared)
    return "does not describe it" if useless else "describes it in part", "unexplained"


def file_name(model: str) -> str:
    """A model's name as part of a file name: foh >> creep becomes foh-then-creep."""
    return model.replace(" >> ", "-then-").replace(" + ", "-plus-")


def parameter_rows(fit: Fit | FrequencyFit) -> list[dict[str, str]]:
    """Rows of the table of parameters and of the combinations that the data determine."""
    estimates = fit.shown_estimates if isinstance(fit, Fit) else fit.estimates
    return [
        *(estimate_row(estimate) for estimate in estimates),
        *(combination_row(combination) for combination in listed(fit.combinations)),
    ]


def key_figures(result: Comparison | Sequence[Fit]) -> Figures:
    """Headers and rows of the table of scores, a column per model."""
    if isinstance(result, Comparison):
        held_out = [row.unseen for row in result.rows]
        errors = [None if scores is None else scores.rmse for scores in held_out]
        return _scores(result.fits, [row.bic for row in result.rows], errors, held_out)
    return _scores(result, [bic for _, bic in rank_fits(result)])


def diagnosis_figures(diagnosis: Diagnosis) -> Figures:
    """Headers and rows of the table of scores without and with what is missing."""
    fits = [fit for fit in (diagnosis.base, diagnosis.extended) if fit is not None]
    errors = [diagnosis.held_out.base_rmse, diagnosis.held_out.extended_rmse][: len(fits)]
    return _scores(fits, [fit.scores.bic for fit in fits], errors)


def _scores(
    fits: Sequence[Fit],
    bics: Sequence[float],
    held_out: Sequence[float | None] = (),
    held_out_scores: Sequence[HeldOutScores | None] = (),
) -> Figures:
    """Headers and rows of the scores of models, a column each: of fitted and of held-out data."""
    noise = noise_of(fits[0])
    unit = noise.unit
    scores = [fit.scores for fit in fits]
    counts = [str(len(fit.estimates) + len(fit.offsets)) for fit in fits]
    rows = [["RMSE, fitted data", *(quantity(s.rmse, unit) for s in scores)]]
    if held_out:
        rows.append(["RMSE, held-out data", *(quantity(rmse, unit) for rmse in held_out)])
    if held_out_scores:
        e_r = [None if errors is None else errors.e_r for errors in held_out_scores]
        nrmse = [None if errors is None else errors.nrmse_percent for errors in held_out_scores]
        rows.append(["relative error, held-out data", *(figure(value) for value in e_r)])
        rows.append(["NRMSE fit, held-out data [%]", *(figure(value, 4) for value in nrmse)])
    if noise.method != "residual":
        rows.append(["RMSE over noise floor", *(figure(s.rmse / noise.sigma) for s in scores)])
    rows += [
        ["relative error", *(figure(s.e_r) for s in scores)],
        ["NRMSE fit", *(f"{s.nrmse_percent:.4g} %" for s in scores)],
        ["R²", *(f"{s.r_squared:.7g}" for s in scores)],
        ["BIC", *(f"{bic:.1f}" for bic in bics)],
        ["free parameters and offsets", *counts],
    ]
    return ["", *(fit.model.name for fit in fits)], rows


def frequency_sentence(fits: Sequence[FrequencyFit]) -> str:
    """The errors of the best fit to one frequency response."""
    fit = fits[0]
    best = "" if len(fits) == 1 else f" best of {len(fits)} models by BIC"
    return (
        f"{fit.model.name} describes {Path(fit.table.source).name}{best}, to "
        f"{figure(fit.amplitude_rms_dB)} dB and {figure(fit.phase_rms_deg)} degrees rms at "
        f"{len(fit.table)} frequencies."
    )


def frequency_figures(fits: Sequence[FrequencyFit]) -> Figures:
    """Headers and rows of the scores of fits to one frequency response, a column per model."""
    rows = [
        ["amplitude residual [dB rms]", *(figure(fit.amplitude_rms_dB) for fit in fits)],
        ["phase residual [degrees rms]", *(figure(fit.phase_rms_deg) for fit in fits)],
        ["relative error", *(figure(fit.e_r) for fit in fits)],
        ["BIC", *(f"{fit.bic:.1f}" for fit in fits)],
        ["free parameters", *(str(len(fit.estimates)) for fit in fits)],
    ]
    return ["", *(fit.model.name for fit in fits)], rows


def crosscheck_sentence(crosscheck: Crosscheck) -> str:
    """Whether other methods converge to the same optimum as the gradient fit."""
    fit = crosscheck.fit
    unit = fit.preparation.takes[0].recording.response_unit
    best, others = crosscheck.best, crosscheck.rows[1:]
    agree = sum(row.agrees for row in others)
    name = f"{fit.model.name} on {sources(fit)}"
    if crosscheck.warning is not None:
        return (
            f"{name}: the gradient fit is not at the optimum; {best.method} has the least error, "
            f"{quantity(best.rmse, unit)} rms."
        )
    return (
        f"{name}: no method has a smaller error than the gradient fit, "
        f"{quantity(best.rmse, unit)} rms, and {agree} of {len(others)} others agree with it."
    )


def crosscheck_figures(crosscheck: Crosscheck) -> Figures:
    """Headers and rows of the cross-check's table: a column per method, and the unit."""
    methods = crosscheck.rows
    unit = crosscheck.fit.preparation.takes[0].recording.response_unit
    rows = [
        ["rms error", *(f"{row.rmse:.5g}" for row in methods), pretty_unit(unit)],
        ["rel. error", *(f"{row.e_r:.5g}" for row in methods), ""],
        ["over the best", *(f"{row.over_best:.6g}" for row in methods), ""],
        ["agrees", *("yes" if row.agrees else "no" for row in methods), ""],
        *(
            [name, *(f"{row.parameters[name]:.4g}" for row in methods), pretty_unit(unit)]
            for name, unit in crosscheck.units.items()
        ),
        ["evaluations", *(str(row.evaluations) for row in methods), ""],
        ["derivatives", *("yes" if row.derivatives else "no" for row in methods), ""],
        ["seconds", *(figure(row.seconds, 2) for row in methods), "s"],
    ]
    return ["", *(row.method for row in methods), "unit"], rows


def download(name: str, content: dict) -> dict[str, str]:
    """A JSON file that the page contains as a link."""
    encoded = base64.b64encode(json.dumps(content, indent=1).encode()).decode()
    return {"name": name, "href": Markup(f"data:application/json;base64,{encoded}")}
