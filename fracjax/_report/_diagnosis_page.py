"""The report of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .._diagnose import Candidate, Diagnosis, entry_of
from .._fit import estimate_row
from .._show import figure, p_value
from . import _figures
from ._embedding import PlottedFigure
from ._fit_page import common_content
from ._text import diagnosis_figures, download, file_name, noise_text, sources

_BADGES = {
    "none": "nothing missing beyond noise",
    "missing": "physics missing",
    "confusable": "physics missing, several explanations",
    "unexplained": "mismatch not explained",
}


def diagnosis_content(diagnosis: Diagnosis) -> dict[str, Any]:
    """The content of the report of a diagnosis."""
    fits = [fit for fit in (diagnosis.base, diagnosis.extended) if fit is not None]
    names = [fit.model.name for fit in fits]
    span = diagnosis.base.preparation.setting.response_span
    return {
        **common_content(
            fits,
            diagnosis_figures(diagnosis),
            diagnosis,
            predicted=[predicted] if (predicted := diagnosis.held_out.predicted) else [],
            beside=_figures_of(diagnosis, names),
        ),
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
        "groups": _groups(diagnosis),
        "largest_score": max(candidate.score for candidate in diagnosis.candidates),
        "effects": [
            (effect, entry_of(effect.name), [estimate_row(e) for e in effect.parameters])
            for effect in diagnosis.effects
        ],
        "span": span,
        "linear": diagnosis.linear_approximations,
        "unit": diagnosis.noise.unit,
        "downloads": [
            download("diagnosis.json", diagnosis.to_dict()),
            *(download(f"fit_{file_name(fit.model.name)}.json", fit.to_dict()) for fit in fits),
        ],
    }


def _figures_of(diagnosis: Diagnosis, names: Sequence[str]) -> dict[str, PlottedFigure]:
    """The figures beside those of the recordings, by their names in the template; `names` are the
    models'."""
    base, noise = diagnosis.base.preparation, diagnosis.noise
    span = base.setting.response_span
    drawn = {
        "hidden": _figures.hidden(diagnosis.candidates, noise, span),
        "held_out": _figures.held_out(diagnosis.held_out, names, noise),
    }
    if diagnosis.can_show:
        drawn["shown"] = _figures.shown(diagnosis.can_show, span)
    if diagnosis.linear_approximations:
        drawn["linear"] = _figures.approximations(diagnosis.linear_approximations)
    if diagnosis.next_experiment is not None:
        unit = base.takes[0].recording.drive_unit
        drawn["next_drive"] = _figures.drive(diagnosis.next_experiment.drive, unit)
    return drawn


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
