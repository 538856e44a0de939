"""`fracjax batch`: one model fitted to each of many recordings."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._files import folder
from ._given import Given
from ._options import (
    bound_option,
    fix_option,
    folder_option,
    loss_option,
    mask_option,
    model_option,
    prior_option,
    takes_asked,
    takes_given,
    takes_results,
    tie_option,
)
from ._progress import bar
from ._results import Results, Summary
from ._statuses import NOT_CONVERGED, UNUSABLE, fail
from ._tables import Figures

if TYPE_CHECKING:
    import pandas as pd

_NOTES = 5
"""Most recordings whose reason is printed; the others are in the table."""


@click.command("batch")
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@model_option
@folder_option
@click.option(
    "--cluster", metavar="ADDRESS", help="Address of a dask scheduler, whose workers run the fits."
)
@takes_asked(fix_option, bound_option, prior_option, tie_option, mask_option, loss_option)
@takes_given
@takes_results
def batch_command(
    paths: tuple[str, ...],
    name: str,
    out: Path,
    cluster: str | None,
    asked: dict[str, Any],
    given: Given,
    results: Results,
) -> int:
    """Fit a model to each of many recordings: files, folders, or patterns.

    Writes fits.parquet and fits.csv, one row per recording, and report.html.  Repeat the same call
    to fit what is missing.
    """
    import logging

    from .._batch import FITS, fit_batch

    if given.pair is not None:
        raise click.UsageError("batch takes files with drive and response in each")
    # It would print a traceback when the scheduler is lost, which `fit_batch` reports itself.
    logging.getLogger("distributed.client").disabled = True
    with folder(out):
        try:
            with bar(results.quiet) as progress:
                rows = fit_batch(
                    name,
                    paths,
                    out=out,
                    cluster=cluster,
                    read_options=given.columns,
                    history=given.past,
                    settling=given.settle,
                    seed=given.seed,
                    progress=progress,
                    **asked,
                )
        finally:
            if (out / FITS).exists():
                results.saved.append(out / FITS)
    from .._report import write_batch_report

    results.save(lambda path: rows.to_csv(path, index=False), out / "fits.csv")
    report = partial(write_batch_report, rows, name, command=results.call.line, seed=given.seed)
    results.save(report, out / "report.html")
    data = _as_data(rows, name, out / FITS)
    results.show(lambda: data, lambda: _summary(rows, data))
    return _status(data)


def _as_data(rows: pd.DataFrame, name: str, table: Path) -> dict[str, Any]:
    """The statuses and their counts as plain data."""
    from .._batch import SCHEMA, STATUSES, overview

    recordings = rows.loc[:, ["source", "status", "reason"]].to_dict("records")
    statuses = [row["status"] for row in recordings]
    return {
        "schema": SCHEMA,
        "model": name,
        "table": str(table),
        "recordings": len(recordings),
        "counts": {status: statuses.count(status) for status in STATUSES},
        "fits": overview(rows),
        "unfitted": [row for row in recordings if row["status"] != "fitted"],
    }


def _summary(rows: pd.DataFrame, data: dict[str, Any]) -> Summary:
    """The counts, the spreads of the parameters, and why recordings were not fitted."""
    from .._report import batch_sentence

    notes = [*_misfits(rows), *_notes(data["unfitted"])]
    return Summary(batch_sentence(rows, data["model"]), _spreads(rows), notes)


def _misfits(rows: pd.DataFrame) -> list[str]:
    """How many fits do not describe their recording, and why the first of them does not."""
    from .._batch import at_bounds
    from .._fit import shortcomings_of

    poor = []
    for row, at_bound in zip(rows.to_dict("records"), at_bounds(rows), strict=True):
        if row["status"] != "fitted":
            continue
        clauses = shortcomings_of(row["rmse"], row["noise_sigma"], row["r_squared"], at_bound)
        if clauses:
            poor.append(f"of {row['source']} {', and '.join(clauses)}")
    if not poor:
        return []
    fitted = (rows["status"] == "fitted").sum()
    return [f"Warning: {len(poor)} of {fitted} fits do not describe their recording; {poor[0]}."]


def _spreads(rows: pd.DataFrame) -> Figures:
    """Each parameter's spread over the fitted recordings, in the unit that most of them have; a row
    more for those whose unit is of another kind."""
    from .._batch import spreads
    from .._show import figure, pretty_unit

    table = [
        [
            each.name,
            *(figure(each.quantile(share)) for share in (0.1, 0.5, 0.9)),
            pretty_unit(each.unit),
            str(int(each.outlying.sum())),
        ]
        for each in spreads(rows)
    ]
    return ["", "10 % below", "median", "10 % above", "unit", "outliers"], table


def _notes(unfitted: list[dict[str, str]]) -> list[str]:
    """Why the first few recordings were not fitted."""
    notes = [f"{row['status'].capitalize()}: {row['reason']}" for row in unfitted[:_NOTES]]
    if len(unfitted) > _NOTES:
        notes.append(f"And {len(unfitted) - _NOTES} more: see the column reason.")
    return notes


def _status(data: dict[str, Any]) -> int:
    """The exit status: 2 if no recording could be read, 3 if any fit failed, else 0."""
    counts, total = data["counts"], data["recordings"]
    if counts["unreadable"] == total:
        first = data["unfitted"][0]["reason"].rstrip(".")
        return fail(f"None of {total} recordings could be read; the first: {first}.", UNUSABLE)
    if stopped := counts["not converged"] + counts["failed"]:
        return fail(
            f"{stopped} of {total} fits did not converge; their best parameters and the reasons "
            f"were saved in {data['table']}.",
            NOT_CONVERGED,
        )
    return 0
