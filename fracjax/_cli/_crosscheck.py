"""`fracjax crosscheck`: one fit by four methods."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from ._files import folder
from ._given import Given
from ._jax import prepare_jax
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
from ._tables import doubts


@click.command("crosscheck")
@recordings_argument
@model_option
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="For the results.")
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
    """Fit a model by gradients, bounded L-BFGS, particle swarm and evolution, side by side.

    PSO and DE search with gains eliminated, as the gradient fit does, and over all parameters, as
    the papers do: there each gain stays within 3 times what spans the response alone.  With --out
    it writes crosscheck.json, report.html and fit.json, the gradient fit.
    """
    taken, (model,) = given.understood(recordings, [name])
    how = given.how(taken)
    from .._crosscheck import crosscheck
    from .._report import crosscheck_figures, crosscheck_sentence, write_report

    prepare_jax()
    with nullcontext() if out is None else folder(out), stages(results.quiet) as progress:
        found = crosscheck(model, taken, progress=progress, **how, **asked)
        if out is not None:
            progress("writing the report")
            results.save(found.save, out / "crosscheck.json")
            results.save(found.fit.save, out / "fit.json")
            results.save(lambda path: write_report(found, path), out / "report.html")
    results.tell(
        found.to_dict,
        lambda: Summary(crosscheck_sentence(found), crosscheck_figures(found), doubts(found.fit)),
    )
    return status_of([found.fit], out)
