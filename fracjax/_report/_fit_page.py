"""The report of fits and of their comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from .._fit import Comparison, Fit, Predicted, ResidualAnalysis, analyse_residuals
from ._embedding import PlottedFigure
from ._recordings_section import MOST_RECORDINGS, recordings_section
from ._text import (
    Figures,
    download,
    file_name,
    fit_badge,
    fit_sentence,
    key_figures,
    noise_of,
    noise_text,
    parameter_rows,
    rank_fits,
    sources,
)

if TYPE_CHECKING:
    from .._diagnose import Diagnosis

_MOST_MODELS = 4
"""Most models drawn, as many as there are colours."""


def fit_content(fits: Sequence[Fit]) -> dict[str, Any]:
    """The content of the report of fits to the same recordings."""
    return _content([fit for fit, _ in rank_fits(fits)])


def _content(best_first: Sequence[Fit], predicted: Sequence[Predicted] = ()) -> dict[str, Any]:
    """The same of fits that are in order, with what they predict of recordings held out."""
    downloads = [
        download(f"fit_{file_name(fit.model.name)}.json", fit.to_dict()) for fit in best_first
    ]
    badge, verdict = fit_badge(best_first)
    return {
        **common_content(
            best_first, key_figures(best_first), tests=_tests(best_first[0]), predicted=predicted
        ),
        "title": f"Fit of {sources(best_first[0])}",
        "sentence": fit_sentence(best_first),
        "badge": badge,
        "verdict": verdict,
        "facts": [("Noise floor", noise_text(noise_of(best_first[0])))],
        "warnings": _warnings(best_first),
        "diagnosis": None,
        "downloads": downloads,
    }


def comparison_content(comparison: Comparison) -> dict[str, Any]:
    """The content of the report of fits, with the scores on held-out data."""
    content = _content(comparison.fits, comparison.predicted)
    headers, rows = key_figures(comparison)
    held_out = ("Held out", comparison.method)
    attached = download("comparison.json", comparison.to_dict())
    return content | {
        "headers": headers,
        "rows": rows,
        "facts": [*content["facts"], held_out],
        "warnings": [*comparison.remarks, *content["warnings"]],
        "downloads": [attached, *content["downloads"]],
    }


def common_content(
    fits: Sequence[Fit],
    figures: Figures,
    diagnosis: Diagnosis | None = None,
    tests: Sequence[ResidualAnalysis] = (),
    predicted: Sequence[Predicted] = (),
    beside: Mapping[str, PlottedFigure] = MappingProxyType({}),
) -> dict[str, Any]:
    """The content that reports of fits and diagnoses share, with the tests of residuals and other
    figures by their names in the template."""
    headers, rows = figures
    return {
        **recordings_section(
            fits[:_MOST_MODELS], noise_of(fits[0]), diagnosis, tests, predicted, beside
        ),
        "headers": headers,
        "rows": rows,
        "bode": None,
        "models": [
            {
                "name": fit.model.name,
                "estimates": parameter_rows(fit),
                "profiles": _profiles(fit),
                "correlated": fit.correlated,
                "assumptions": _assumptions(fit),
            }
            for fit in fits
        ],
    }


def _tests(fit: Fit) -> tuple[ResidualAnalysis, ...]:
    """The tests of the residual of each recording that is drawn."""
    drawn = replace(
        fit,
        preparation=replace(fit.preparation, takes=fit.preparation.takes[:MOST_RECORDINGS]),
        simulations=fit.simulations[:MOST_RECORDINGS],
    )
    return analyse_residuals(drawn)


def _profiles(fit: Fit) -> Markup | None:
    """The figure of the profiles; None where none was asked for."""
    if not fit.profiles:
        return None
    from ._fit_figures import profiles

    return profiles(fit.profiles)


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
