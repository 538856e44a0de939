"""The report of a batch: distributions, suspect rows, failures, and a plot that links to rows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .._batch import Spread, at_bounds, over_noise, overview, spreads
from .._fit import FAR_ABOVE_NOISE
from .._show import figure, pretty_unit
from ._batch_figures import distributions
from ._page import write_page
from ._provenance import provenance

_MOST_ROWS = 2000
"""Most recordings that are drawn and listed, suspect ones first; the table has all.  Chosen so that
a browser stays quick."""


def write_batch_report(
    rows: pd.DataFrame,
    model: str,
    path: str | Path,
    *,
    command: str | None = None,
    seed: int | None = None,
) -> None:
    """Write a batch's table as one self-contained HTML file.

    Args:
        rows: The table of `fit_batch`.
        model: The model's name.
        path: The file to write.
        command: What was called to get the table, which the report states.
        seed: The seed of its random numbers, likewise.
    """
    content = batch_content(rows, model)
    content["provenance"] = provenance([], command, seed)
    write_page("batch.html.jinja", content, path)


def batch_content(rows: pd.DataFrame, model: str) -> dict[str, Any]:
    """The template's content."""
    columns, ratios = spreads(rows), over_noise(rows)
    suspect = _remarks(rows, columns, ratios)
    order = np.argsort([not remarks for remarks in suspect], kind="stable")[:_MOST_ROWS]
    listed = np.sort(order)
    unfitted = rows.loc[rows["status"] != "fitted"]
    return {
        "title": f"Batch of {len(rows)} recordings",
        "sentence": batch_sentence(rows, model),
        "headers": ["", "10 % below", "median", "10 % above", "unit", "outliers"],
        "spreads": [
            [
                each.name,
                *(figure(each.quantile(share)) for share in (0.1, 0.5, 0.9)),
                pretty_unit(each.unit),
                str(int(each.outlying.sum())),
            ]
            for each in columns
        ],
        "figure": distributions(columns, listed),
        "names": [_heading(each, columns) for each in columns],
        "rows": [_listed(rows, at, columns, ratios, suspect[at]) for at in listed],
        "omitted": len(rows) - len(listed),
        "failures": unfitted[["source", "status", "reason"]].to_dict("records")[:_MOST_ROWS],
    }


def _heading(each: Spread, columns: list[Spread]) -> str:
    """A column's name, with its unit where there is one of the same name in another."""
    alike = sum(other.name == each.name for other in columns) > 1
    return f"{each.name} [{pretty_unit(each.unit)}]" if alike else each.name


def batch_sentence(rows: pd.DataFrame, model: str) -> str:
    """How many recordings were fitted, and how many of those fits are suspect."""
    statuses = rows["status"].value_counts()
    order = ("fitted", "not converged", "unreadable", "failed")
    counts = [f"{statuses[status]} {status}" for status in order if status in statuses]
    counted = overview(rows)
    suspects = [
        f"{counted['at a bound']} with a parameter at a bound",
        f"{counted['far above the noise']} with a residual above {FAR_ABOVE_NOISE:g} times the "
        "noise",
    ]
    if counted["of unknown noise"]:
        suspects.append(f"{counted['of unknown noise']} whose noise only the residual shows")
    return (
        f"{model}: of {len(rows)} recordings {', '.join(counts)}; of the fitted, "
        f"{', '.join(suspects)}."
    )


def _remarks(rows: pd.DataFrame, columns: list[Spread], ratios: np.ndarray) -> list[list[str]]:
    """Per recording, what is suspect about it."""
    remarks = []
    for at, (status, bounds) in enumerate(zip(rows["status"], at_bounds(rows), strict=True)):
        if status != "fitted":
            remarks.append([str(status)])
            continue
        remarks.append(
            [f"{name} at a bound" for name in bounds]
            + [f"{each.name} is an outlier" for each in columns if each.outlying[at]]
            + ([f"{ratios[at]:.2g} times the noise"] if ratios[at] > FAR_ABOVE_NOISE else [])
        )
    return remarks


def _listed(
    rows: pd.DataFrame, at: int, columns: list[Spread], ratios: np.ndarray, remarks: list[str]
) -> dict[str, Any]:
    """A recording as a row of the page."""
    return {
        "at": at,
        "source": Path(str(rows["source"].iloc[at])).name,
        "values": [_figure(each.values[at], 4) for each in columns],
        "over_noise": _figure(ratios[at], 2),
        "remarks": "; ".join(remarks),
    }


def _figure(value: float, digits: int) -> str:
    """A number, or a dash where there is none."""
    return figure(None if np.isnan(value) else float(value), digits)
