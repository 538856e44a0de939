"""Text tables, of any separator, below any preamble."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow

from fracjax._io._decoding import Text, text_of
from fracjax._io._files import EXPORT, text_signature, whole
from fracjax._io._header import Header, header_of
from fracjax._io._layout import Layout, cells_of, layout_of
from fracjax._io._numbers import numbers_of
from fracjax._io._rows import rows_of
from fracjax._io._stamps import seconds_of
from fracjax._io._table import NO_HINTS, Column, Hints, column_label
from fracjax._recording import InputError

_LONGEST_LINE = 100_000
_HEADS = (60_000, 2_000_000, None)
_SHORT_HEADS = (
    (600, frozenset(("number",))),
    (2_000, frozenset(("number", "stamp", "text", "empty"))),
)
"""Bytes of heads that suffice where every line after them is read as their last ones are, and what
their columns may hold: what is no number in a few lines may yet become one."""
_TEXT_FAULT = {"text": "text", "empty": "next to no numbers"}


@dataclass(frozen=True)
class TextTable:
    """The table in a text file."""

    source: str
    names: tuple[str, ...]
    breaks: tuple[int, ...]
    columns: tuple[Column, ...]
    values: tuple[np.ndarray | None, ...]
    """By column, seconds for stamps; None of text."""
    text: Text
    layout: Layout
    lines: Sequence[int] | None
    """The line in the file, from 1, of each row; None where every line from the first is one."""

    @property
    def width(self) -> int:
        """How many columns there are."""
        return len(self.columns)

    def about(self, column: int) -> Column:
        """What the file says of column `column`."""
        return self.columns[column]

    def numbers(self, column: int) -> np.ndarray:
        """Column `column`, shape (N,), float64: NaN where there is no number, ±∞ beyond range."""
        values = self.values[column]
        return np.full(self.columns[column].length, np.nan) if values is None else values

    def place(self, row: int, column: int) -> str:
        """Where a cell stands, such as `loop.csv, line 17, column "voltage_V"`."""
        return f"{self.source}, line {self._line(row)}, {column_label(self.names, column)}"

    def shown(self, row: int, column: int) -> str:
        """A cell as it is written, in quotes."""
        line = self.text.decoded().split("\n")[self._line(row) - 1]
        return f'"{cells_of(line, self.layout.separator)[column][:40]}"'

    def _line(self, row: int) -> int:
        if self.lines is not None:
            return self.lines[row]
        raw, remaining = self.text.raw, row
        for number, line in enumerate(raw.split(b"\n")):
            if number >= self.layout.start and line.strip():
                if remaining == 0:
                    return number + 1
                remaining -= 1
        raise IndexError(row)


def read_text(path: str | PathLike[str], hints: Hints = NO_HINTS) -> TextTable:
    """The table in a text file: the longest run of rows of numbers, its names and units above it.

    Raises InputError for a file that cannot be read, is no text, holds no such rows, or has
    a row of another width among them.
    """
    source = fspath(path)
    text = text_of(source)
    lines, layout, quick = _laid_out(source, text, hints)
    header = header_of(source, lines, layout, hints)
    if quick is not None:
        values, count, numbers, breaks = (
            quick,
            len(next(v[0] for v in quick if v is not None)),
            None,
            (),
        )
        units = [""] * layout.width
    else:
        whole_text = text.decoded().split("\n")
        rows = rows_of(source, whole_text, layout, header.repeated)
        count, numbers, breaks = len(rows.cells), rows.lines, rows.breaks
        parsed = [_parsed(rows.cells, at, layout) for at in range(layout.width)]
        values, units = [each[0] for each in parsed], [each[1] for each in parsed]
    columns = tuple(
        _about(header, layout, at, count, values[at], units[at]) for at in range(layout.width)
    )
    kept = tuple(None if each is None else each[0] for each in values)
    return TextTable(source, header.names, breaks, columns, kept, text, layout, numbers)


def write_text(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), as CSV, or tab-separated where the suffix is .tsv.

    It reads back to the same numbers. The file appears whole or not at all, also when the run is
    killed.

    Raises InputError where it cannot be written.
    """
    separator = "\t" if Path(path).suffix.lower() == ".tsv" else ","
    with whole(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, delimiter=separator, lineterminator="\n")
        table.writerow(columns)
        values = (np.asarray(column).tolist() for column in columns.values())
        table.writerows(zip(*values, strict=True))


_Values = tuple[np.ndarray, int | None]
"""A column's numbers, and of stamps when their zero is."""


def _laid_out(
    source: str, text: Text, hints: Hints
) -> tuple[list[str], Layout, list[_Values | None] | None]:
    """The head's lines, the layout, and the columns as a compiled reader gives them, which takes
    less than a second for a million rows; None where it refuses them, so that they are read row by
    row.
    """
    if signature := text_signature(text.raw[: _HEADS[0]]):
        raise InputError.at(source, "rows of numbers", *signature)
    # The layout of a long head takes most of the time: short ones are tried first.
    for size, kinds in _SHORT_HEADS if hints == NO_HINTS else ():
        located = _located(source, text, hints, (size,)) if b"\n" in text.raw[:size] else None
        if located is None or not (located[1].is_plain and kinds.issuperset(located[1].kinds)):
            continue
        if (quick := _quick(text, located[1])) is not None:
            return *located, quick
    located = _located(source, text, hints, _HEADS)
    assert located is not None  # the last head is all of the text
    return *located, _quick(text, located[1]) if located[1].is_plain else None


def _located(
    source: str, text: Text, hints: Hints, heads: Sequence[int | None]
) -> tuple[list[str], Layout] | None:
    """The lines down to where the table has begun, and its layout, from the first head that shows
    it.
    """
    for size in heads:
        lines = text.decoded(size).split("\n")
        if max(map(len, lines)) > _LONGEST_LINE:
            raise _no_table(source, lines)
        # Lines that the call skips stay, so that lines keep their numbers.
        skip = min(hints.skip_rows, len(lines))
        stated = (hints.names_row, hints.units_row)
        lines[:skip] = [line if at + 1 in stated else "" for at, line in enumerate(lines[:skip])]
        layout = layout_of(lines, skip)
        complete = size is None or size >= len(text.raw)
        if layout is not None and (complete or layout.stop >= len(lines) - 2):
            return lines, layout
        if complete:
            raise _no_table(source, lines)
    return None


def _no_table(source: str, lines: list[str]) -> InputError:
    """Why there is no table in a text."""
    wanted = "rows of numbers"
    longest = max(map(len, lines))
    if longest > _LONGEST_LINE:
        wanted = "one sample per line"
        return InputError.at(source, wanted, f"a line of {longest} characters", EXPORT)
    filled = [line for line in lines if line.strip()]
    said = [line for line in filled if not line.lstrip().startswith(("#", "%"))]
    if not said:
        return InputError.at(source, wanted, "an empty file", EXPORT)
    if len(said) == 1:
        return InputError.at(source, wanted, "only a line of names", EXPORT)
    return InputError.at(source, wanted, f"{len(said)} lines of text", EXPORT)


def _quick(text: Text, layout: Layout) -> list[_Values | None] | None:
    """The columns where every line from the first is a row of plain numbers and stamps; else
    None."""
    kinds = layout.kinds
    read = [at for at, kind in enumerate(kinds) if kind in ("number", "stamp")]
    if not any(kinds[at] == "number" for at in read) or text.encoding in (
        "gb18030",
        "shift_jis",
        "big5",
    ):
        return None
    start = 0
    for _ in range(layout.start):
        start = text.raw.index(b"\n", start) + 1
    columns = _by_arrow(text, layout, start, read) or _by_pandas(text, layout, start, read)
    if columns is None:
        return None
    values: list[_Values | None] = [None] * layout.width
    for at in read:
        if kinds[at] == "stamp":
            values[at] = seconds_of(columns[at].tolist())
            continue
        numbers = columns[at]
        # Codes for beyond range are read one by one.
        if not (np.abs(numbers) < 9e37).all():
            return None
        values[at] = numbers, None
    return values


def _by_arrow(
    text: Text, layout: Layout, start: int, read: list[int]
) -> dict[int, np.ndarray] | None:
    """The columns to read from byte `start` on, each with its numbers; None where Arrow, which
    takes half of pandas' time, refuses them; as a stream, since a reader of the whole starts a
    thread for each file."""
    if layout.separator == " " or "stamp" in layout.kinds:
        return None
    names = [str(at) for at in range(layout.width)]
    try:
        table = arrow.open_csv(
            pa.py_buffer(text.raw)[start:],
            arrow.ReadOptions(use_threads=False, column_names=names),
            arrow.ParseOptions(delimiter=layout.separator, quote_char=False),
            arrow.ConvertOptions(
                column_types={names[at]: pa.float64() for at in read},
                include_columns=[names[at] for at in read],
                null_values=[],
                decimal_point=layout.decimal,
            ),
        ).read_all()
    except pa.ArrowInvalid:
        return None
    return {at: column.to_numpy() for at, column in zip(read, table.columns, strict=True)}


def _by_pandas(
    text: Text, layout: Layout, start: int, read: list[int]
) -> dict[int, np.ndarray] | None:
    """The columns to read from byte `start` on, stamps as text; None where pandas refuses them."""
    if layout.separator == " " and len(read) < layout.width:
        return None
    import pandas as pd  # most files do without, and it takes long to import

    body = io.BytesIO(text.raw)
    body.seek(start)
    try:
        frame = pd.read_csv(
            body,
            sep=r"\s+" if layout.separator == " " else layout.separator,
            decimal=layout.decimal,
            header=None,
            names=range(layout.width),
            index_col=False,
            usecols=read,
            dtype={at: np.float64 if layout.kinds[at] == "number" else "str" for at in read},
            quoting=csv.QUOTE_NONE,
            na_filter=False,
            encoding=text.encoding,
        )
    except ValueError:
        return None
    # Pandas completes rows that are too short, and cuts those that are too long.
    ends = len(frame) * (layout.width - 1)
    if layout.separator != " " and text.raw.count(layout.separator.encode(), start) != ends:
        return None
    return {at: frame[at].to_numpy() for at in read}


def _parsed(rows: Sequence[Sequence[str]], at: int, layout: Layout) -> tuple[_Values | None, str]:
    """A column of cells as numbers or seconds, and the unit that stands behind each."""
    cells = [row[at] for row in rows]
    if layout.kinds[at] == "stamp":
        return seconds_of(cells), ""
    if layout.kinds[at] != "number":
        return None, ""
    parsed = numbers_of(cells, layout.decimal)
    return (parsed.values, None), parsed.unit


def _about(
    header: Header, layout: Layout, at: int, count: int, values: _Values | None, unit: str
) -> Column:
    """Unit and faults of a column; one of days alone is no time."""
    title = header.names[at] if header.names else ""
    fault = _TEXT_FAULT.get(layout.kinds[at], "")
    is_stamp = layout.kinds[at] == "stamp"
    if is_stamp and values is not None and not fault:
        seconds = values[0]
        if len(seconds) > 1 and not np.any(np.diff(seconds)):
            fault = "the same date in every row"
    stated = "s" if is_stamp else unit or header.units[at]
    return Column(
        count,
        title,
        stated,
        header.clocks[at],
        values[1] if values is not None else None,
        is_stamp,
        fault,
    )
