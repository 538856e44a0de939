"""`fracjax fit`: models fitted to recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._files import Content, folder
from ._fit_table import fit_table
from ._given import Given
from ._options import (
    bound_option,
    fix_option,
    folder_option,
    loss_option,
    mask_option,
    own_option,
    pauses_option,
    prior_option,
    recordings_argument,
    takes_asked,
    takes_given,
    takes_results,
    tie_option,
)
from ._progress import stages
from ._results import Results, Summary
from ._statuses import status_of
from ._tables import fit_notes, parameter_figures

if TYPE_CHECKING:
    from .._fit import Comparison, Fit
    from .._recording import Recording


@click.command("fit")
@recordings_argument
@click.option(
    "--model",
    "names",
    multiple=True,
    required=True,
    help="May be given more than once; see `models`.",
)
@folder_option
@click.option(
    "--holdout",
    "held_out_paths",
    multiple=True,
    metavar="FILE",
    help="A recording for validation alone; no fit uses it.",
)
@click.option(
    "--profile",
    "profiled",
    multiple=True,
    metavar="NAME",
    help="A parameter whose profile likelihood is computed too.",
)
@click.option(
    "--frequency-response",
    "to_table",
    is_flag=True,
    help="Fit a linear model to a table of frequency, amplitude and phase.",
)
@pauses_option
@takes_asked(
    fix_option,
    bound_option,
    prior_option,
    tie_option,
    own_option,
    mask_option,
    loss_option,
)
@takes_given
@takes_results
def fit_command(
    recordings: tuple[str, ...],
    names: tuple[str, ...],
    out: Path,
    held_out_paths: tuple[str, ...],
    profiled: tuple[str, ...],
    to_table: bool,
    pauses: str | None,
    asked: dict[str, Any],
    given: Given,
    results: Results,
) -> int:
    """Fit models to recordings, jointly where there are several.

    Writes fit.json (the best model by BIC that held-out data do not refute), report.html and, for
    several models, fit_MODEL.json for each and comparison.json.  The comparison scores all models
    on the fitted data and on held-out data: the recordings of --holdout, or stretches of the
    recordings held out in turn.  Options for a parameter apply to the models that have it; --fix to
    --mask may be given more than once.
    """
    if to_table:
        return fit_table(recordings, names, out, given, results, asked, pauses)
    from .._fit import compare_fits, fit, with_profiles
    from .._naming import accepted_names
    from .._prepare import options_for
    from .._report import file_name

    requested = asked | {"profiled": profiled}
    data, models = given.understood(recordings, names, pauses)
    settings = given.how(data)
    held_out = [given.read(path) for path in held_out_paths]
    all_names = set().union(*(accepted_names(model.block) for model in models))

    content = Content("fit", [each.source for each in data], [model.name for model in models])
    with folder(out, content), stages(results.quiet) as progress:
        fits = []
        for model in models:
            options = options_for(requested, accepted_names(model.block), all_names)
            to_profile = options.pop("profiled")
            fitted = fit(model, data, progress=progress, **settings, **options)
            fits.append(with_profiles(fitted, to_profile, progress))
            if len(models) > 1:
                results.save(fits[-1].save, out / f"fit_{file_name(model.name)}.json")
        comparison = None
        if len(models) > 1 or held_out:
            comparison = compare_fits(fits, holdout=held_out, progress=progress)
        best = list(comparison.fits) if comparison else fits
        progress("writing the report")
        results.save(best[0].save, out / "fit.json")
        if comparison:
            results.save(comparison.save, out / "comparison.json")
        result = comparison or fits[0]
        results.save_report(result, out / "report.html", given.seed)
    results.show(result.to_dict, lambda: _summary(best, comparison, data))
    return status_of(fits, out)


def _summary(
    fits: Sequence[Fit], comparison: Comparison | None, recordings: Sequence[Recording]
) -> Summary:
    """The summary of fits, best first, of their comparison if there is one, and of recordings."""
    from .._fit import analyse_residuals
    from .._report import fit_sentence, key_figures

    notes = [note for fit in fits for note in (*_profile_notes(fit), *fit_notes(fit))]
    notes.append(". ".join(analyse_residuals(fits[0])[0].findings) + ".")
    warnings = (warning for r in recordings for warning in (*r.warnings, *r.checks()))
    notes += [f"Warning: {warning}" for warning in dict.fromkeys(warnings)]
    if comparison:
        notes = [*comparison.remarks, *notes]
    figures = key_figures(comparison or fits)
    return Summary(fit_sentence(fits), figures, notes, parameter_figures(fits[0]))


def _profile_notes(fit: Fit) -> list[str]:
    """The intervals of the requested profiles."""
    from .._show import figure, pretty_unit

    notes = []
    for profile in fit.profiles:
        low, high = ("open" if end is None else figure(end, 5) for end in profile.interval_95)
        unit = pretty_unit(profile.unit)
        notes.append(f"Profile of {profile.name}: 95 % from {low} to {high} {unit}".strip() + ".")
    return notes
