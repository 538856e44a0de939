"""What is printed: tables, JSON, and notes on fits."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .._fit import Fit
    from .._frequency import FrequencyFit

Figures = tuple[list[str], list[list[str]]]  # the heads of its columns, and its rows


def print_json(data: object) -> None:
    """Plain data on stdout."""
    print(json.dumps(data, indent=1))


def print_table(heads: list[str], rows: list[list[str]]) -> None:
    """A table on stdout, without heads a list of facts; as wide as the terminal, else 120."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, show_header=bool(heads), show_edge=False, pad_edge=False)
    for head in heads or rows[0]:
        table.add_column(head)
    for row in rows:
        table.add_row(*row)
    width = None if sys.stdout.isatty() else 120
    Console(markup=False, emoji=False, highlight=False, width=width).print(table)


def doubts(fit: Fit | FrequencyFit) -> list[str]:
    """What the data do not determine, by name, and what was held against the fit."""
    unknown = [e.name for e in fit.estimates if not e.identified]
    bound = [e.name for e in fit.estimates if e.at_bound]
    return [f"Warning: {warning}" for warning in fit.warnings] + [
        f"{fit.model.name}: {text}."
        for text, found in (
            (f"this recording does not identify {', '.join(unknown)}", unknown),
            (f"ended on its bound: {', '.join(bound)}", bound),
            (f"known only together: {'; '.join(fit.correlated)}", fit.correlated),
        )
        if found
    ]


def parameter_figures(fit: Fit | FrequencyFit) -> Figures:
    """The parameters of a fit, and what is known of them together."""
    from .._report import parameter_rows

    heads = [fit.model.name, "value", "95 % interval", "unit", "remark"]
    return heads, [list(row.values()) for row in parameter_rows(fit)]
