"""`fracjax fit --frequency-response`: linear models fitted to a table of a frequency response."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._files import Content, folder
from ._given import Given
from ._progress import stages
from ._results import Results, Summary
from ._statuses import status_of
from ._tables import fit_notes, parameter_figures

if TYPE_CHECKING:
    from .._frequency import FrequencyFit


def fit_table(
    paths: Sequence[str],
    names: Sequence[str],
    out: Path,
    given: Given,
    results: Results,
    asked: dict[str, Any],
    pauses: str | None,
) -> int:
    """Fit each model to the table, print the result and return the exit status."""
    from .._frequency import fit_frequency_response, read_frequency_table
    from .._models import parse_model
    from .._naming import accepted_names
    from .._prepare import options_for
    from .._report import file_name

    if len(paths) > 1 or pauses is not None or asked.keys() & {"mask", "own", "loss"}:
        raise click.UsageError(
            "--frequency-response takes one table, and neither --mask nor --own nor --loss nor "
            "--pauses",
            click.get_current_context(),
        )
    units = given.columns["input_unit"], given.columns["output_unit"]
    table = read_frequency_table(paths[0], drive_unit=units[0], response_unit=units[1])
    models = [parse_model(name, table.setting) for name in dict.fromkeys(names)]
    all_names = set().union(*(accepted_names(model.block) for model in models))
    content = Content("fit", [table.source], [model.name for model in models])
    with folder(out, content), stages(results.quiet) as progress:
        fits = []
        for model in models:
            options = options_for(asked, accepted_names(model.block), all_names)
            fits.append(
                fit_frequency_response(model, table, seed=given.seed, progress=progress, **options)
            )
        fits.sort(key=lambda fit: fit.bic)
        progress("writing the report")
        if len(fits) > 1:
            for fit in fits:
                results.save(fit.save, out / f"fit_{file_name(fit.model.name)}.json")
        results.save(fits[0].save, out / "fit.json")
        results.save_report(fits, out / "report.html", given.seed)
    results.show(lambda: _as_data(fits), lambda: _summary(fits))
    return status_of(fits, out)


def _as_data(fits: Sequence[FrequencyFit]) -> object:
    """One fit as plain data, or several as a list."""
    content = [fit.to_dict() for fit in fits]
    return content[0] if len(content) == 1 else content


def _summary(fits: Sequence[FrequencyFit]) -> Summary:
    """The summary of fits, best first."""
    from .._report import frequency_figures, frequency_sentence

    notes = [note for fit in fits for note in fit_notes(fit)]
    parameters = parameter_figures(fits[0])
    return Summary(frequency_sentence(fits), frequency_figures(fits), notes, parameters)
