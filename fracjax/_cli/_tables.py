"""Printed tables and JSON, and notes about fits."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .._fit import Fit
    from .._frequency import FrequencyFit

Figures = tuple[list[str], list[list[str]]]  # the headers of the columns, and the rows


def print_json(data: object) -> None:
    """Print plain data as JSON."""
    print(json.dumps(data, indent=1))


def print_text(text: str, style: str | None = None) -> None:
    """Print a sentence: on a terminal in lines that end at words, else in one line."""
    from rich.console import Console

    console = Console(markup=False, emoji=False, highlight=False)
    console.print(text, style=style, soft_wrap=not console.is_terminal)


def print_table(headers: list[str], rows: list[list[str]]) -> None:
    """Print a table, as wide as the terminal or 120 columns; without headers a list of facts."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, show_header=bool(headers), show_edge=False, pad_edge=False)
    for header in headers or rows[0]:
        table.add_column(header)
    for row in rows:
        table.add_row(*row)
    width = None if sys.stdout.isatty() else 120
    Console(markup=False, emoji=False, highlight=False, width=width).print(table)


def fit_notes(fit: Fit | FrequencyFit) -> list[str]:
    """The warnings of a fit, and the parameters that the data do not determine."""
    from .._fit import Fit

    shown = fit.shown_estimates if isinstance(fit, Fit) else fit.estimates
    unidentified = [e.name for e in shown if not e.identified]
    at_bound = [e.name for e in fit.estimates if e.at_bound]
    return [f"Warning: {warning}" for warning in fit.warnings] + [
        f"{fit.model.name}: {text}."
        for text, names in (
            (f"this recording does not identify {', '.join(unidentified)}", unidentified),
            (f"ended on its bound: {', '.join(at_bound)}", at_bound),
            (f"strongly correlated: {'; '.join(fit.correlated)}", fit.correlated),
        )
        if names
    ]


def parameter_figures(fit: Fit | FrequencyFit) -> Figures:
    """The parameters of a fit, and the combinations that the data determine."""
    from .._report import parameter_rows

    headers = [fit.model.name, "value", "95 % interval", "unit", "remark"]
    return headers, [list(row.values()) for row in parameter_rows(fit)]
