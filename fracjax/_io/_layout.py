"""Where the table in a text stands: its separator, width and first row, and what columns hold."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from fracjax._io._numbers import NUMBER, decimal_of, kind_of_cell
from fracjax._io._stamps import is_stamp
from fracjax._io._units import is_spelled_unit
from fracjax._recording import MINIMUM_SAMPLES

SEPARATORS = (";", "\t", ",", "|", " ")
"""In order of preference; the blank stands for any run of blanks and tabs."""
COMMENTS = ("#", "%")
_SEP_LINE = re.compile(r'\s*"?sep=(.|\\t)"?[;,\s]*', re.IGNORECASE)
_SAMPLE = 200
_BESIDE = 60
_STRAY = 2
"""Rows of numbers above the names of a table that are taken for a preamble."""


class _Row(NamedTuple):
    """A line that may be a row of a table: its index, its cells and what each holds."""

    at: int
    cells: list[str]
    kinds: list[str]


class _Run(NamedTuple):
    """Rows of one width: one for each number less one for each text, lines, width, and rows."""

    score: int
    start: int
    stop: int
    width: int
    rows: list[_Row]


@dataclass(frozen=True)
class Layout:
    """The shape of a table in lines of text."""

    separator: str
    width: int
    start: int
    """The index of its first row among the lines."""
    kinds: tuple[str, ...]
    """What each column holds: "number", "stamp", "text" or "empty"."""
    decimal: str
    is_plain: bool
    """Whether the rows that were looked at hold no quotes."""
    stop: int
    """The index of the line at which its first run ends."""

    @property
    def data(self) -> tuple[int, ...]:
        """The columns of numbers."""
        return tuple(at for at, kind in enumerate(self.kinds) if kind == "number")


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes and blanks around them."""
    if separator == " ":
        if '"' in line:
            return [c.strip() for c in next(csv.reader([" ".join(line.split())], delimiter=" "))]
        return line.split()
    if '"' in line:
        return [
            cell.strip() for cell in next(csv.reader([line.strip(" ")], delimiter=separator), [""])
        ]
    return [cell.strip() for cell in line.split(separator)]


@lru_cache(maxsize=1024)
def kind_of(cell: str) -> str:
    """What a cell holds: a kind of `kind_of_cell`, or "stamp"; kept because several steps ask."""
    kind = kind_of_cell(cell)
    return "stamp" if kind == "text" and is_stamp(cell) else kind


def is_comment(line: str) -> bool:
    """Whether a line says of itself that it is none of the table."""
    return line.lstrip().startswith(COMMENTS)


def stated_separator(lines: Sequence[str]) -> tuple[str, int] | None:
    """The separator of a first line such as `sep=;`, and that line's index."""
    for at, line in enumerate(lines[:3]):
        if sep_line := _SEP_LINE.fullmatch(line):
            return {"\\t": "\t"}.get(sep_line[1], sep_line[1]), at
        if line.strip():
            break
    return None


def layout_of(
    lines: Sequence[str], skip: int = 0, separators: Sequence[str] = SEPARATORS
) -> Layout | None:
    """The table in lines: of all ways to cut them, the run of rows of one width with the most
    numbers and the least of anything else.  None where there is no row of numbers.

    `skip`: how many lines are none of it.
    """
    stated = stated_separator(lines)
    best: _Run | None = None
    separator = ""
    for candidate in [stated[0]] if stated else _that_differ(lines, separators):
        # Where the separator is absent each line is one cell, which is no more numbers than these.
        if best is not None and best.score >= len(lines) and not _separates(candidate, lines):
            continue
        runs = _runs(lines, candidate, max(skip, stated[1] + 1 if stated else 0))
        top = max(runs, key=lambda run: run.score, default=None)
        if top is not None and top.score > (best.score if best else 0):
            best, separator = _first_of_table(runs, top, lines, candidate), candidate
    if best is None:
        return None
    rows = best.rows
    # The last line may have been cut where the head of the file ends.
    skipped = _BESIDE if len(rows) > 2 * _BESIDE else len(rows) // 3
    sample = rows[skipped:][:_SAMPLE]
    kinds = tuple(map(_kind_of_column, zip(*(row.kinds for row in sample), strict=True)))
    return Layout(
        separator,
        best.width,
        _first_row(rows, kinds),
        kinds,
        _decimal(sample, kinds),
        '"' not in "\n".join(lines[best.start : best.stop]),
        best.stop,
    )


def _that_differ(lines: Sequence[str], separators: Sequence[str]) -> list[str]:
    """The separators that stand in the lines, and at last one that does not: all others cut
    alike."""
    present = [separator for separator in separators if _separates(separator, lines)]
    return present + [separator for separator in separators if separator not in present][:1]


def _separates(separator: str, lines: Sequence[str]) -> bool:
    """Whether a separator stands in any of the lines."""
    if separator.isspace() and separator != "\t":
        return any(len(line.split()) > 1 for line in lines)
    return separator in "\n".join(lines)


def _runs(lines: Sequence[str], separator: str, skip: int) -> list[_Run]:
    """The runs of rows of one width with numbers in them."""
    is_number = NUMBER.fullmatch
    runs: list[_Run] = []
    rows: list[_Row] = []
    score, start, width = 0, -1, -1
    for at in range(skip, len(lines) + 1):
        # Names in a comment end a run, as the last line does.
        cells: list[str] = []
        if at < len(lines):
            line = lines[at]
            if is_comment(line):
                if not _are_names(line, separator, width):
                    continue
            elif line.strip():
                cells = cells_of(line, separator)
            else:
                continue
        kinds = ["number" if is_number(cell) else kind_of(cell) for cell in cells]
        codes, texts, empty = kinds.count("code"), kinds.count("text"), kinds.count("empty")
        numbers = len(kinds) - codes - texts - empty
        if texts:  # A column of units is no sign of another separator.
            texts -= sum(
                k == "text" and is_spelled_unit(c) for k, c in zip(kinds, cells, strict=True)
            )
        if len(cells) != width or not (numbers or not any(cells)):
            if width > 0:
                runs.append(_Run(score, start, at, width, rows))
            score, rows = 0, []
            start, width = (at, len(cells)) if numbers else (-1, -1)
        if width > 0:
            score += numbers + codes - texts
            rows.append(_Row(at, cells, kinds))
    return runs


def _first_of_table(runs: Sequence[_Run], top: _Run, lines: Sequence[str], separator: str) -> _Run:
    """The run in which the table of the best run begins: the first as wide that is long enough for
    a recording, or of numbers alone with nothing or its names above it.

    What parts it from the best is a fault of the file, or the head of another segment.
    """

    def is_named(run: _Run) -> bool:
        above = [line for line in lines[: run.start] if line.strip()]
        return bool(above) and _are_names(above[-1], separator, run.width)

    top_is_named = is_named(top)
    for run in runs:
        if run.width != top.width or run.start >= top.start:
            continue
        if len(run.rows) >= MINIMUM_SAMPLES:
            return run
        rows = [cells_of(line, separator) for line in lines[run.start : run.stop] if line.strip()]
        pure = all(kind_of(cell) not in ("text", "empty") for cells in rows for cell in cells)
        if pure and (is_named(run) or len(run.rows) > _STRAY or not top_is_named):
            return run
    return top


def _are_names(line: str, separator: str, width: int) -> bool:
    """Whether a line, commented or not, is as wide as a table and nothing but text."""
    cells = cells_of(line.strip().lstrip("#%").strip(" "), separator)
    return len(cells) == width and all(kind_of(cell) == "text" for cell in cells)


def _kind_of_column(kinds: Sequence[str]) -> str:
    count = {
        kind: kinds.count(kind) for kind in ("number", "stamp", "quantity", "code", "text", "empty")
    }
    numbers = count["number"] + count["quantity"]
    if numbers and numbers + count["code"] >= max(count["text"] + count["stamp"], len(kinds) / 10):
        # An entry now and then is no signal, but of a slow channel the column ends in empty cells.
        return "number" if numbers + count["code"] > 0.1 * len(kinds) else "empty"
    if count["stamp"] > max(count["text"], len(kinds) / 2):
        return "stamp"
    return "text" if count["text"] > count["empty"] else "empty"


def _first_row(rows: Sequence[_Row], kinds: Sequence[str]) -> int:
    """The first line of a run that belongs to the table: lines such as `Sample Interval,0.002`
    above one of two columns do not."""
    first = 0
    for row in rows[:_BESIDE]:
        if kinds[0] != "number" or row.kinds[0] != "text":
            break
        first += 1
    return rows[first if first < len(rows) else 0].at


def _decimal(sample: Sequence[_Row], kinds: Sequence[str]) -> str:
    numbers = [at for at, kind in enumerate(kinds) if kind == "number"]
    return decimal_of([row.cells[at] for row in sample for at in numbers])
