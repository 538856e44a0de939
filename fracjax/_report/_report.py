"""The report: a result as one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from .._compensate import Compensation
from .._crosscheck import Crosscheck
from .._diagnose import Candidate, Diagnosis, entry_of
from .._fit import Comparison, Fit, analyse_residuals, estimate_row
from .._frequency import FrequencyFit
from .._posterior import Posterior
from .._recording import InputError, found_in
from .._show import figure, p_value, percent, quantity
from .._show.drawing import svg
from . import _figures, _fit_figures
from ._compensation_page import compensation_content
from ._posterior_page import posterior_content
from ._provenance import provenance
from ._recordings_section import MOST_RECORDINGS, recordings_section
from ._text import (
    crosscheck_figures,
    crosscheck_sentence,
    download,
    file_name,
    fit_badge,
    fit_sentence,
    frequency_figures,
    frequency_sentence,
    key_figures,
    noise_of,
    noise_text,
    opening,
    parameter_rows,
    rank_fits,
    sources,
)

_MOST_MODELS = 4
"""Most models drawn, as many as there are colours."""
_BADGES = {
    "none": "nothing missing beyond noise",
    "missing": "physics missing",
    "confusable": "physics missing, several explanations",
    "unexplained": "mismatch not explained",
}


Reported = (
    Fit | FrequencyFit | Comparison | Diagnosis | Crosscheck | Posterior | Compensation
    | Sequence[Fit] | Sequence[FrequencyFit]
)  # fmt: skip


def write_report(
    result: Reported, path: str | Path, *, command: str | None = None, seed: int | None = None
) -> None:
    """Write a result as one self-contained HTML file.

    Args:
        result: A fit, a cross-check, a comparison, a diagnosis, a posterior or a compensation, or a
            sequence of fits to the same data.
        path: The file to write.
        command: What was called to get the result, which the report states.
        seed: The seed of its random numbers, likewise.

    Raises:
        InputError: When the result is none of these.
    """
    template = "report.html.jinja"
    if isinstance(result, Diagnosis):
        content = _diagnosis_content(result)
    elif isinstance(result, Crosscheck):
        content = _crosscheck_content(result)
    elif isinstance(result, Posterior):
        template, content = "posterior.html.jinja", posterior_content(result)
    elif isinstance(result, Compensation):
        template, content = "compensation.html.jinja", compensation_content(result)
    elif isinstance(result, FrequencyFit):
        content = _frequency_content([result])
    elif isinstance(result, Comparison):
        content = _comparison_content(result)
    elif isinstance(result, Fit):
        content = _fit_content([result])
    else:
        listed = result if isinstance(result, Sequence) else []
        tables = [fit for fit in listed if isinstance(fit, FrequencyFit)]
        recordings = [fit for fit in listed if isinstance(fit, Fit)]
        if not (tables or recordings):
            raise InputError.at("report", "a result of fracjax", found_in(result), "give one")
        content = _frequency_content(tables) if tables else _fit_content(recordings)
    content["provenance"] = provenance(_sources(result), command, seed)
    write_page(template, content, path)


def write_page(template: str, content: dict[str, Any], path: str | Path) -> None:
    """Write a page from its template and content."""
    page = _environment().get_template(template).render(content)
    Path(path).write_text(page, encoding="utf-8")


def _sources(result: Reported) -> list[str]:
    """The names of all recordings of a result."""
    if isinstance(result, Diagnosis):
        return [*_sources(result.base), result.held_out.source]
    if isinstance(result, Crosscheck):
        return _sources(result.fit)
    if isinstance(result, Comparison):
        return _sources(result.fits[0])
    if isinstance(result, Fit):
        return [take.recording.source for take in result.preparation.takes]
    if isinstance(result, FrequencyFit):
        return [result.table.source]
    if isinstance(result, Posterior):
        return [band.source for band in result.bands]
    if isinstance(result, Compensation):
        return [result.source]
    return _sources(result[0])


def _environment() -> jinja2.Environment:
    """The templates, with filters for numbers and units."""
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


def _fit_content(fits: Sequence[Fit]) -> dict[str, Any]:
    """The content of the report of fits to the same recordings."""
    best_first = [fit for fit, _ in rank_fits(fits)]
    downloads = [
        download(f"fit_{file_name(fit.model.name)}.json", fit.to_dict()) for fit in best_first
    ]
    badge, verdict = fit_badge(best_first)
    return {
        **_common(best_first, best_first),
        "title": f"Fit of {sources(fits[0])}",
        "sentence": fit_sentence(best_first),
        "badge": badge,
        "verdict": verdict,
        "facts": [("Noise floor", noise_text(noise_of(best_first[0])))],
        "warnings": _warnings(best_first),
        "diagnosis": None,
        "residual_tests": _residual_tests(best_first[0]),
        "downloads": downloads,
    }


def _frequency_content(fits: Sequence[FrequencyFit]) -> dict[str, Any]:
    """The content of the report of fits to one frequency response, best first."""
    headers, rows = frequency_figures(fits)
    converged = all(fit.converged for fit in fits)
    return {
        "title": f"Frequency response of {Path(fits[0].table.source).name}",
        "sentence": frequency_sentence(fits),
        "badge": "converged" if converged else "not converged",
        "verdict": "none" if converged else "unexplained",
        "headers": headers,
        "rows": rows,
        "facts": [],
        "diagnosis": None,
        "bode": _fit_figures.bode_plot(fits[:_MOST_MODELS]),
        "recordings": [],
        "omitted": 0,
        "layers": [],
        "scripts": "",
        "residual_tests": [],
        "models": [
            {
                "name": fit.model.name,
                "estimates": parameter_rows(fit),
                "profiles": None,
                "correlated": fit.correlated,
                "assumptions": [
                    "The model is linear and was fitted to amplitude and phase in steady state."
                ],
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


def _comparison_content(comparison: Comparison) -> dict[str, Any]:
    """The content of the report of fits, with the scores on held-out data."""
    content = _fit_content(comparison.fits)
    headers, rows = key_figures(comparison)
    held_out = ("Held out", comparison.method)
    attached = download("comparison.json", comparison.to_dict())
    return content | {
        "headers": headers,
        "rows": rows,
        "facts": [*content["facts"], held_out],
        "downloads": [attached, *content["downloads"]],
    }


def _residual_tests(fit: Fit) -> list[dict[str, Any]]:
    """The tests of the residual of each recording that is drawn."""
    drawn = replace(
        fit,
        preparation=replace(fit.preparation, takes=fit.preparation.takes[:MOST_RECORDINGS]),
        simulations=fit.simulations[:MOST_RECORDINGS],
    )
    return [
        {
            "source": analysis.source,
            "findings": analysis.findings,
            "figure": svg(analysis.plot()),
        }
        for analysis in analyse_residuals(drawn)
    ]


def _crosscheck_content(crosscheck: Crosscheck) -> dict[str, Any]:
    """The content of the report of the gradient fit, with the table of methods as key figures."""
    content = _fit_content([crosscheck.fit])
    headers, rows = crosscheck_figures(crosscheck)
    attached = download("crosscheck.json", crosscheck.to_dict())
    changes = {
        "title": f"Cross-check of {sources(crosscheck.fit)}",
        "sentence": crosscheck_sentence(crosscheck),
        "headers": headers,
        "rows": rows,
        "downloads": [attached, *content["downloads"]],
    }
    if crosscheck.warning is not None:
        changes |= {"badge": "not at the optimum", "verdict": "unexplained"}
    return content | changes


def _diagnosis_content(diagnosis: Diagnosis) -> dict[str, Any]:
    """The content of the report of a diagnosis."""
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
            ("Probability of such a residual from noise alone", p_value(diagnosis.p_value)),
        ],
        "warnings": diagnosis.warnings,
        "diagnosis": diagnosis,
        "residual_tests": [],
        "groups": _groups(diagnosis),
        "largest_score": max(candidate.score for candidate in diagnosis.candidates),
        "effects": [
            (effect, entry_of(effect.name), [estimate_row(e) for e in effect.parameters])
            for effect in diagnosis.effects
        ],
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
    """The figure of the proposed drive of the next experiment; None without a proposal."""
    if diagnosis.next_experiment is None:
        return None
    unit = diagnosis.base.preparation.takes[0].recording.drive_unit
    return _figures.drive(diagnosis.next_experiment.drive, unit)


def _common(fits: Sequence[Fit], result: Diagnosis | Sequence[Fit]) -> dict[str, Any]:
    """The content that reports of fits and diagnoses share."""
    diagnosis = result if isinstance(result, Diagnosis) else None
    headers, rows = key_figures(result)
    return {
        **recordings_section(fits[:_MOST_MODELS], noise_of(fits[0]), diagnosis),
        "headers": headers,
        "rows": rows,
        "bode": None,
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
    """The assumptions of the fits: sentences for each recording, the parameters and the grid."""
    states = {
        "rest": "at zero drive",
        "constant": "at the first value of the drive",
        "periodic": "in the same steady cycles",
        "estimated": "in a different state, which the fit estimates",
    }
    assumptions = []
    for take in fit.preparation.takes:
        name, count = Path(take.recording.source).name, len(take.recording)
        samples = f"all {count} samples are used"
        if take.settling:
            samples = (
                f"the first {take.settling} of {count} samples are not used, since they depend on "
                "the unknown prior history"
            )
        assumptions.append(
            f"{name}: before the first sample the actuator was {states[take.history]}; {samples}."
        )
        if excluded := int((~take.used[take.settling :]).sum()):
            assumptions.append(f"{name}: weight or mask excluded {excluded} more samples.")
    assumptions += _conditions(fit)
    if fit.residual_order:
        assumptions.append(
            "The residual is coloured; the standard errors allow for this by an autoregression of "
            f"order {fit.residual_order}."
        )
    finer = fit.preparation.oversampling
    return [*assumptions, f"The simulation used a grid {finer} times finer than the samples."]


def _conditions(fit: Fit) -> list[str]:
    """The conditions on parameters and the loss, a sentence each."""
    conditions = fit.preparation.conditions.as_shown(fit.model.block)
    sentences = [
        f"{name} was tied to {source}"
        + ("." if factor == 1 else f", as {factor:g} times its value.")
        for name, (source, factor) in conditions.ties.items()
    ]
    sentences += [
        f"{name} had the prior {float(p.mean):.6g} ± {float(p.sd):.2g}."
        for name, p in conditions.priors.items()
        if p.mean.size == p.sd.size == 1
    ]
    sentences += [
        f"{name} has a separate value for each recording; @1 is that of the first."
        for name in conditions.own
    ]
    if fit.robust is not None:
        sentences.append(
            f"The loss is {fit.robust.loss}; {100 * fit.robust.downweighted:.2g} % of the samples "
            "have less than half the weight of the others."
        )
    return sentences


def _warnings(fits: Sequence[Fit]) -> list[str]:
    """The warnings about recordings and fits."""
    takes = fits[0].preparation.takes
    checks = [w for take in takes for w in (*take.recording.warnings, *take.recording.checks())]
    failed = [f"The fit of {fit.model.name} did not converge." for fit in fits if not fit.converged]
    return [*checks, *failed, *(warning for fit in fits for warning in fit.warnings)]


def _groups(diagnosis: Diagnosis) -> list[tuple[bool, list[Candidate]]]:
    """Each identified effect with its look-alikes, in one bracket, then the others by rank."""
    by_name = {candidate.name: candidate for candidate in diagnosis.candidates}
    groups: list[tuple[bool, list[Candidate]]] = []
    for effect in diagnosis.effects:
        names = (effect.name, *effect.confusable_with)
        alike = [by_name.pop(name) for name in names if name in by_name]
        if alike:  # the loop's shape is no candidate
            groups.append((len(alike) > 1, alike))
    return [*groups, (False, list(by_name.values()))]
