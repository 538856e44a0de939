"""The report: a result as one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from .._blocks import EFFECTS
from .._compensate import Compensation
from .._crosscheck import Crosscheck
from .._diagnose import Candidate, Diagnosis
from .._fit import Comparison, Fit, analyse_residuals
from .._frequency import FrequencyFit
from .._posterior import Posterior
from .._recording import InputError, found_in
from . import _figures, _fit_figures
from ._compensation_page import of_compensation
from ._posterior_page import of_posterior
from ._text import (
    crosscheck_figures,
    crosscheck_sentence,
    download,
    estimate_row,
    figure,
    file_name,
    fit_sentence,
    frequency_figures,
    frequency_sentence,
    key_figures,
    noise_of,
    noise_text,
    opening,
    p_value,
    parameter_rows,
    percent,
    quantity,
    rank_fits,
    sources,
)

_MOST_MODELS = 4
_MOST_RECORDINGS = 3
_BADGES = {
    "none": "nothing missing beyond noise",
    "missing": "physics missing",
    "confusable": "physics missing, not told apart",
    "unexplained": "mismatch without a name",
}


Reported = (
    Fit | FrequencyFit | Comparison | Diagnosis | Crosscheck | Posterior | Compensation
    | Sequence[Fit] | Sequence[FrequencyFit]
)  # fmt: skip


def write_report(result: Reported, path: str | Path) -> None:
    """Write a result as one HTML file: fits, a cross-check, diagnosis, posterior, compensation."""
    template = "report.html.jinja"
    if isinstance(result, Diagnosis):
        content = _of_diagnosis(result)
    elif isinstance(result, Crosscheck):
        content = _of_crosscheck(result)
    elif isinstance(result, Posterior):
        template, content = "posterior.html.jinja", of_posterior(result)
    elif isinstance(result, Compensation):
        template, content = "compensation.html.jinja", of_compensation(result)
    elif isinstance(result, FrequencyFit):
        content = _of_frequency_fits([result])
    elif isinstance(result, Comparison):
        content = _of_comparison(result)
    elif isinstance(result, Fit):
        content = _of_fits([result])
    else:
        listed = result if isinstance(result, Sequence) else []
        tables = [fit for fit in listed if isinstance(fit, FrequencyFit)]
        recordings = [fit for fit in listed if isinstance(fit, Fit)]
        if not (tables or recordings):
            raise InputError.at("report", "a result of fracjax", found_in(result), "give one")
        content = _of_frequency_fits(tables) if tables else _of_fits(recordings)
    page = _environment().get_template(template).render(content)
    Path(path).write_text(page, encoding="utf-8")


def _environment() -> jinja2.Environment:
    folder = files("fracjax._report")
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: folder.joinpath(name).read_text("utf-8")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(figure=figure, opening=opening, percent=percent, quantity=quantity)
    return environment


def _of_fits(fits: Sequence[Fit]) -> dict[str, Any]:
    best_first = [fit for fit, _ in rank_fits(fits)]
    downloads = [
        download(f"fit_{file_name(fit.model.name)}.json", fit.to_dict()) for fit in best_first
    ]
    converged = all(fit.converged for fit in fits)
    return {
        **_common(best_first, best_first),
        "title": f"Fit of {sources(fits[0])}",
        "sentence": fit_sentence(best_first),
        "badge": "converged" if converged else "not converged",
        "verdict": "none" if converged else "unexplained",
        "facts": [("Noise floor", noise_text(noise_of(best_first[0])))],
        "warnings": _warnings(best_first),
        "diagnosis": None,
        "leftovers": _leftovers(best_first[0]),
        "downloads": downloads,
    }


def _of_frequency_fits(fits: Sequence[FrequencyFit]) -> dict[str, Any]:
    """The report of fits to one frequency response, best first."""
    heads, rows = frequency_figures(fits)
    converged = all(fit.converged for fit in fits)
    return {
        "title": f"Frequency response of {Path(fits[0].table.source).name}",
        "sentence": frequency_sentence(fits),
        "badge": "converged" if converged else "not converged",
        "verdict": "none" if converged else "unexplained",
        "heads": heads,
        "rows": rows,
        "facts": [],
        "diagnosis": None,
        "bode": _fit_figures.bode_plot(fits[:_MOST_MODELS]),
        "recordings": [],
        "undrawn": 0,
        "leftovers": [],
        "models": [
            {
                "name": fit.model.name,
                "estimates": parameter_rows(fit),
                "profiles": None,
                "correlated": fit.correlated,
                "assumptions": ["Amplitude and phase in steady state, of a linear law."],
            }
            for fit in fits
        ],
        "warnings": [
            f"The fit of {f.model.name} did not converge." for f in fits if not f.converged
        ],
        "downloads": [
            download(f"fit_{file_name(fit.model.name)}.json", fit.to_dict()) for fit in fits
        ],
    }


def _of_comparison(comparison: Comparison) -> dict[str, Any]:
    """The report of the fits, with the scores on data held out."""
    content = _of_fits(comparison.fits)
    heads, rows = key_figures(comparison)
    held_out = ("Held out", comparison.method)
    attached = download("comparison.json", comparison.to_dict())
    return content | {
        "heads": heads,
        "rows": rows,
        "facts": [*content["facts"], held_out],
        "downloads": [attached, *content["downloads"]],
    }


def _leftovers(fit: Fit) -> list[dict[str, Any]]:
    """The tests on the residual of each recording that is drawn."""
    drawn = replace(
        fit,
        preparation=replace(fit.preparation, takes=fit.preparation.takes[:_MOST_RECORDINGS]),
        simulations=fit.simulations[:_MOST_RECORDINGS],
    )
    return [
        {
            "source": analysis.source,
            "findings": analysis.findings,
            "figure": _fit_figures.residual_tests(analysis),
        }
        for analysis in analyse_residuals(drawn)
    ]


def _of_crosscheck(crosscheck: Crosscheck) -> dict[str, Any]:
    """The report of the gradient fit, the methods' table in place of its key figures."""
    content = _of_fits([crosscheck.fit])
    heads, rows = crosscheck_figures(crosscheck)
    attached = download("crosscheck.json", crosscheck.to_dict())
    told = {
        "title": f"Cross-check of {sources(crosscheck.fit)}",
        "sentence": crosscheck_sentence(crosscheck),
        "heads": heads,
        "rows": rows,
        "downloads": [attached, *content["downloads"]],
    }
    if crosscheck.warning is not None:
        told |= {"badge": "not at the optimum", "verdict": "unexplained"}
    return content | told


def _of_diagnosis(diagnosis: Diagnosis) -> dict[str, Any]:
    fits = [fit for fit in (diagnosis.base, diagnosis.extended) if fit is not None]
    names = [fit.model.name for fit in fits]
    span = diagnosis.base.preparation.setting.response_span
    return {
        **_common(fits, diagnosis),
        "title": f"Diagnosis of {sources(diagnosis.base)}",
        "sentence": diagnosis.sentence,
        "badge": _BADGES[diagnosis.verdict],
        "verdict": diagnosis.verdict,
        "facts": [
            ("Noise floor", noise_text(diagnosis.noise)),
            ("Discretisation error over noise", figure(diagnosis.numerics)),
            ("Chance of such a residual from noise alone", p_value(diagnosis.p_value)),
        ],
        "warnings": diagnosis.warnings,
        "diagnosis": diagnosis,
        "leftovers": [],
        "groups": _groups(diagnosis),
        "largest_score": max(candidate.score for candidate in diagnosis.candidates),
        "effects": [
            (effect, EFFECTS[effect.name], [estimate_row(e) for e in effect.parameters])
            for effect in diagnosis.effects
        ],
        "places": _figures.places(diagnosis.axes),
        "hidden": _figures.hidden(diagnosis.candidates, diagnosis.noise, span),
        "span": span,
        "held_out": _figures.held_out(diagnosis.held_out, names, diagnosis.noise),
        "next_drive": _next_drive(diagnosis),
        "unit": diagnosis.noise.unit,
        "downloads": [
            download("diagnosis.json", diagnosis.to_dict()),
            *(download(f"fit_{file_name(fit.model.name)}.json", fit.to_dict()) for fit in fits),
        ],
    }


def _next_drive(diagnosis: Diagnosis) -> Markup | None:
    """The drive of the next experiment, where one is proposed."""
    if diagnosis.next_experiment is None:
        return None
    unit = diagnosis.base.preparation.takes[0].recording.drive_unit
    return _figures.drive(diagnosis.next_experiment.drive, unit)


def _common(fits: Sequence[Fit], result: Diagnosis | Sequence[Fit]) -> dict[str, Any]:
    """What the reports of fits and diagnoses share."""
    drawn, noise = fits[:_MOST_MODELS], noise_of(fits[0])
    takes = fits[0].preparation.takes
    heads, rows = key_figures(result)
    return {
        "heads": heads,
        "rows": rows,
        "bode": None,
        "recordings": [
            {
                "source": take.recording.source,
                "loops": _figures.loops(drawn, index, noise),
                "series": _figures.series(drawn, index),
                "residuals": _figures.residuals(drawn, index, noise),
            }
            for index, take in enumerate(takes[:_MOST_RECORDINGS])
        ],
        "undrawn": max(0, len(takes) - _MOST_RECORDINGS),
        "models": [
            {
                "name": fit.model.name,
                "estimates": parameter_rows(fit),
                "profiles": _fit_figures.profiles(fit.profiles) if fit.profiles else None,
                "correlated": fit.correlated,
                "assumptions": _assumptions(fit),
            }
            for fit in fits
        ],
    }


def _assumptions(fit: Fit) -> list[str]:
    """What the figures rest on, a sentence for each recording and one for the grid."""
    sentences = {
        "rest": "at zero drive",
        "constant": "the first value of the drive, held for ever",
        "periodic": "the same steady cycles",
        "estimated": "another drive, whose memory the fit estimates",
    }
    found = []
    for take in fit.preparation.takes:
        name, count = Path(take.recording.source).name, len(take.recording)
        counted = f"all {count} samples count"
        if take.settling:
            counted = (
                f"the first {take.settling} of {count} samples, of unknown memory, do not count"
            )
        found.append(f"{name}: before the first sample {sentences[take.history]}; {counted}.")
        if left_out := int((~take.used[take.settling :]).sum()):
            found.append(f"{name}: {left_out} samples more were left out by weight or mask.")
    found += _asked(fit)
    if fit.residual_order:
        found.append(
            "What is left is coloured; the standard errors allow for it by an autoregression of "
            f"order {fit.residual_order}."
        )
    return [*found, f"Simulated on a grid {fit.preparation.oversampling} times finer than sampled."]


def _asked(fit: Fit) -> list[str]:
    """What was asked of parameters and of the loss, a sentence each."""
    asked = fit.preparation.conditions
    found = [
        f"{name} was tied to {source}"
        + ("." if factor == 1 else f", as {factor:g} times its value.")
        for name, (source, factor) in asked.ties.items()
    ]
    found += [
        f"{name} was known before as {float(p.mean):.6g} ± {float(p.sd):.2g}."
        for name, p in asked.priors.items()
        if p.mean.size == p.sd.size == 1
    ]
    found += [f"Of {name} every recording has its own value, @1 the first's." for name in asked.own]
    if fit.robust is not None:
        found.append(
            f"The loss is {fit.robust.loss}; {100 * fit.robust.downweighted:.2g} % of the samples "
            "count for less than half."
        )
    return found


def _warnings(fits: Sequence[Fit]) -> list[str]:
    takes = fits[0].preparation.takes
    noted = [w for take in takes for w in (*take.recording.warnings, *take.recording.checks())]
    failed = [f"The fit of {fit.model.name} did not converge." for fit in fits if not fit.converged]
    return [*noted, *failed, *(warning for fit in fits for warning in fit.warnings)]


def _groups(diagnosis: Diagnosis) -> list[tuple[bool, list[Candidate]]]:
    """What was named, each with its look-alikes in one bracket, then the others as ranked."""
    by_name = {candidate.name: candidate for candidate in diagnosis.candidates}
    groups: list[tuple[bool, list[Candidate]]] = []
    for effect in diagnosis.effects:
        together = [by_name.pop(n) for n in (effect.name, *effect.confusable_with) if n in by_name]
        groups.append((len(together) > 1, together))
    return [*groups, (False, list(by_name.values()))]
