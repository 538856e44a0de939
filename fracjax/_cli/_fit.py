"""`fracjax fit`: models fitted to recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._files import folder
from ._fit_table import fit_table
from ._given import Given
from ._jax import prepare_jax
from ._options import (
    bound_option,
    fix_option,
    folder_option,
    loss_option,
    mask_option,
    own_option,
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
from ._tables import doubts, parameter_figures

if TYPE_CHECKING:
    from .._fit import Comparison, Fit
    from .._recording import Recording


@click.command("fit")
@recordings_argument
@click.option("--model", "names", multiple=True, required=True, help="Once or more; see `models`.")
@folder_option
@click.option(
    "--holdout", "unseen", multiple=True, metavar="FILE", help="A recording that no fit sees."
)
@click.option(
    "--profile", "profiled", multiple=True, metavar="NAME", help="Its profile likelihood too."
)
@click.option(
    "--frequency-response",
    "of_frequency",
    is_flag=True,
    help="Of a table of frequency, amplitude and phase, by a linear law.",
)
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
    unseen: tuple[str, ...],
    profiled: tuple[str, ...],
    of_frequency: bool,
    asked: dict[str, Any],
    given: Given,
    results: Results,
) -> int:
    """Fit models to recordings, jointly where there are several.

    Writes fit.json (of the best model by BIC), report.html and, for several models, one
    fit_MODEL.json each and comparison.json: all of them on the data fitted and on data held out,
    the recordings of --holdout or stretches set aside in turn.  What is asked of a parameter
    concerns the models that have it; --fix to --mask may be given more than once.
    """
    if of_frequency:
        return fit_table(recordings, names, out, given, results, asked)
    from .._fit import compared, fit, options_for, with_profiles
    from .._report import write_report
    from .._report._text import file_name

    wishes = asked | {"profiled": profiled}
    taken, models = given.understood(recordings, names)
    how = given.how(taken)
    held_out = [given.read(path) for path in unseen]
    everything = {name for model in models for name in model.parameters}

    prepare_jax()
    with folder(out), stages(results.quiet) as progress:
        fits = []
        for model in models:
            told = options_for(wishes, model.parameters.keys(), everything)
            wanted = told.pop("profiled")
            found = fit(model, taken, progress=progress, **how, **told)
            fits.append(with_profiles(found, wanted, progress))
            if len(models) > 1:
                results.save(fits[-1].save, out / f"fit_{file_name(model.name)}.json")
        comparison = None
        if len(models) > 1 or held_out:
            comparison = compared(fits, holdout=held_out, progress=progress)
        best = list(comparison.fits) if comparison else fits
        progress("writing the report")
        results.save(best[0].save, out / "fit.json")
        if comparison:
            results.save(comparison.save, out / "comparison.json")
        result = comparison or fits[0]
        results.save(lambda path: write_report(result, path), out / "report.html")
    results.tell(result.to_dict, lambda: _summary(best, comparison, taken))
    return status_of(fits, out)


def _summary(
    fits: Sequence[Fit], comparison: Comparison | None, recordings: Sequence[Recording]
) -> Summary:
    """Of the fits, the best first, of their comparison if there was one, and of the recordings."""
    from .._fit import analyse_residuals
    from .._report._text import fit_sentence, key_figures

    notes = [note for found in fits for note in (*_profile_notes(found), *doubts(found))]
    notes.append("; ".join(analyse_residuals(fits[0])[0].findings) + ".")
    told = (warning for r in recordings for warning in (*r.warnings, *r.checks()))
    notes += [f"Warning: {warning}" for warning in dict.fromkeys(told)]
    figures = key_figures(comparison or fits)
    return Summary(fit_sentence(fits), figures, notes, parameter_figures(fits[0]))


def _profile_notes(found: Fit) -> list[str]:
    """The intervals of the profiles that were asked for."""
    from .._report._text import figure, pretty_unit

    notes = []
    for profile in found.profiles:
        low, high = ("open" if end is None else figure(end, 5) for end in profile.interval_95)
        unit = pretty_unit(profile.unit)
        notes.append(f"Profile of {profile.name}: 95 % from {low} to {high} {unit}".strip() + ".")
    return notes
