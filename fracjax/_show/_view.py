"""A result as a short text at the prompt, as tables in a notebook, and as a summary."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import fields
from html import escape
from typing import Any, NamedTuple

import numpy as np

_WIDTH = 100
"""Columns of a text."""
_MOST_LINES = 18
"""Most lines of a result at the prompt, before the one that says what is left out."""
_CELL = 60
"""Most characters of a value in the plain view of a result."""


class Text(str):
    """A text of several lines that is shown as it is, at the prompt and in a notebook."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


class Table(NamedTuple):
    """Headers of the columns, which may be empty, and rows; `detail` is not shown at the prompt."""

    headers: Sequence[str]
    rows: Sequence[Sequence[str]]
    detail: bool = False

    def lines(self) -> list[str]:
        """The table as lines of equal columns."""
        listed = [list(self.headers), *self.rows] if self.headers else list(self.rows)
        widths = [max(map(len, column)) for column in zip(*listed, strict=True)]
        return [
            "  " + "  ".join(f"{c:{w}}" for c, w in zip(row, widths, strict=True)).rstrip()
            for row in listed
        ]

    def html(self) -> str:
        """The table as an HTML element."""

        def row(cells: Sequence[str], tag: str) -> str:
            style = ' style="text-align:left"'
            return f"<tr>{''.join(f'<{tag}{style}>{escape(c)}</{tag}>' for c in cells)}</tr>"

        head = f"<thead>{row(self.headers, 'th')}</thead>" if self.headers else ""
        body = "".join(row(cells, "td") for cells in self.rows)
        return f"<table>{head}<tbody>{body}</tbody></table>"


class View(NamedTuple):
    """What a result shows: a sentence, tables, and notes of a line each."""

    sentence: str
    tables: Sequence[Table] = ()
    notes: Sequence[str] = ()

    def text(self) -> str:
        """All of it as text."""
        parts = [_wrapped(self.sentence)]
        parts += [["", *table.lines()] for table in self.tables if table.rows]
        lines = [line for note in self.notes for line in _wrapped(note)]
        parts += [["", *lines]] if lines else []
        return "\n".join(line for part in parts for line in part)

    def brief(self) -> str:
        """The sentence and the main tables in fewer than twenty lines."""
        lines = _wrapped(self.sentence)
        for table in self.tables:
            if table.rows and not table.detail:
                lines += table.lines()
        if len(lines) > _MOST_LINES:
            rest = len(lines) - _MOST_LINES
            lines = [*lines[:_MOST_LINES], f"  … {rest} more lines in .summary()"]
        return "\n".join(lines)

    def html(self) -> str:
        """All of it as HTML."""
        tables = "".join(table.html() for table in self.tables if table.rows)
        notes = "".join(f"<li>{escape(note)}</li>" for note in self.notes)
        listed = f"<ul>{notes}</ul>" if notes else ""
        return f"<div><p><b>{escape(self.sentence)}</b></p>{tables}{listed}</div>"


def _wrapped(text: str) -> list[str]:
    """A text as lines that end at words."""
    return textwrap.wrap(text, _WIDTH) or [""]


class Shown:
    """A result that shows itself.

    A dataclass that inherits from it is declared with repr=False, and says what it shows in
    `_view`; by default that is each of its fields, arrays by their shape.
    """

    def _view(self) -> View:
        """What the result shows."""
        rows = [[f.name, _abridged(getattr(self, f.name))] for f in fields(self)]  # type: ignore[arg-type]
        return View(type(self).__name__, [Table([], rows)])

    def summary(self) -> Text:
        """The result in full, as a text to print.

        Returns:
            The sentence, all tables and notes; values with their units.
        """
        return Text(self._view().text())

    def __repr__(self) -> str:
        return self._view().brief()

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        return self._view().html()


def view_of_tuple(named: Any) -> View:
    """What a named tuple shows, since it cannot inherit from `Shown`: as that does."""
    pairs = named._asdict().items()
    return View(type(named).__name__, [Table([], [[n, _abridged(v)] for n, v in pairs])])


def _abridged(value: Any) -> str:
    """A value in one short line."""
    if isinstance(value, np.ndarray) and value.size > 1:
        return f"array of shape {value.shape}"
    if isinstance(value, dict):
        text = ", ".join(map(str, value)) or "none"
    elif isinstance(value, tuple | list) and value and not isinstance(value[0], str | int | float):
        text = f"{len(value)} of {type(value[0]).__name__}"
    else:
        text = " ".join(str(value).split())
    return text if len(text) <= _CELL else f"{text[: _CELL - 1]}…"
