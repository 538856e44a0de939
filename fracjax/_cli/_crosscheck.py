"""`fracjax crosscheck`: one fit by several methods."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from ._files import Content, folder
from ._given import Given
from ._options import (
    bound_option,
    fix_option,
    mask_option,
    model_option,
    recordings_argument,
    takes_asked,
    takes_given,
    takes_results,
)
from ._progress import stages
from ._results import Results, Summary
from ._statuses import status_of
from ._tables import fit_notes


@click.command("crosscheck")
@recordings_argument
@model_option
@click.option(
    "--out", type=click.Path(path_type=Path), metavar="DIR", help="Folder for the results."
)
@takes_asked(fix_option, bound_option, mask_option)
@takes_given
@takes_results
def crosscheck_command(
    recordings: tuple[str, ...],
    name: str,
    out: Path | None,
    asked: dict[str, Any],
    given: Given,
    results: Results,
) -> int:
    """Fit a model by gradients, bounded L-BFGS, particle swarm and differential evolution.

    The last two (PSO and DE) run twice: with gains eliminated, as in the gradient fit, and over all
    parameters, as in the papers.  Then each gain is searched for up to 3 times the value at which
    it spans the response alone.  With --out the command writes crosscheck.json, report.html and
    fit.json (the gradient fit).
    """
    data, (model,) = given.understood(recordings, [name])
    settings = given.how(data)
    from .._crosscheck import crosscheck
    from .._report import crosscheck_figures, crosscheck_sentence

    content = Content("cross-check", [each.source for each in data], [model.name])
    place = nullcontext() if out is None else folder(out, content)
    with place, stages(results.quiet) as progress:
        checked = crosscheck(model, data, progress=progress, **settings, **asked)
        if out is not None:
            progress("writing the report")
            results.save(checked.save, out / "crosscheck.json")
            results.save(checked.fit.save, out / "fit.json")
            results.save_report(checked, out / "report.html", given.seed)
    results.show(
        checked.to_dict,
        lambda: Summary(
            crosscheck_sentence(checked), crosscheck_figures(checked), fit_notes(checked.fit)
        ),
    )
    return status_of([checked.fit], out)
