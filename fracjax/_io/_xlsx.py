"""XLSX, by openpyxl: the table of each sheet."""

import csv
import io
import re
from collections.abc import Mapping, Sequence
from datetime import date, datetime
from functools import partial
from itertools import groupby
from os import PathLike, fspath
from typing import NamedTuple
from zipfile import ZipFile

import numpy as np

from fracjax._io._facts import speaks
from fracjax._io._files import plain, reading, writing
from fracjax._io._header import header_of
from fracjax._io._layout import layout_of
from fracjax._io._numbers import Parsed, numbers_of
from fracjax._io._stamps import seconds_of
from fracjax._io._table import NO_HINTS, Column, Fact, Hints, Stated, Table, column_label
from fracjax._io._unit_columns import with_units_of_rows
from fracjax._io._units import is_unit
from fracjax._recording import LARGEST, InputError

_KIND = "an XLSX file"
_HEAD = 400
"""Rows in which the table of a sheet has begun."""
_ROWS = 1_048_575
"""What a sheet holds below its line of names."""


class _Cells(NamedTuple):
    """A column of a sheet from its first number on."""

    sheet: str
    letter: str
    name: str
    first: int
    """Row in the sheet, from 1, of the first value."""
    values: Sequence[object]
    decimal: str
    kind: str
    """As `Layout.kinds` has it."""
    units: tuple[Stated, ...]
    scales: tuple[Stated, ...]
    clocks: tuple[Fact, ...]

    @property
    def holds_text(self) -> bool:
        """Whether numbers are stored as text."""
        return self.kind == "number" and any(isinstance(value, str) for value in self.values[:50])

    def parsed(self) -> Parsed:
        """The values as numbers, with the unit that stands behind each."""
        if all(map(_is_number, self.values)):
            values = np.array(self.values, dtype=np.float64)
            values[np.abs(values) >= LARGEST] *= np.inf
            return Parsed(values, "")
        decimal = self.decimal if self.holds_text else "."
        return numbers_of([_as_text(value) for value in self.values], decimal)

    def column(self, source: str, label: str) -> Column:
        """The column of a table; a column without a name is called by its letter."""
        is_stamp = self.kind == "stamp"
        fault = {"text": "text", "empty": "next to no numbers"}.get(self.kind, "")
        texts = [_as_text(value) for value in self.values]
        start, (numbers, unit) = None, self.parsed()
        behind = (Stated(unit, "its cells"),) if unit else ()
        if is_stamp:
            numbers, start = seconds_of(texts)
            fault = "" if np.any(np.diff(numbers)) else "the same date in every row"

        def shown(row: int) -> str:
            value = self.values[row]
            return "an empty cell" if value is None else f'"{plain(str(value))[:40]}"'

        place = f'{source}, sheet "{self.sheet}", cell {self.letter}'
        return Column(
            len(self.values),
            partial(np.copy, numbers),
            place=lambda row: f"{place}{self.first + row}",
            shown=shown,
            title=self.name,
            units=(Stated("s", "its dates"),) if is_stamp else (*behind, *self.units),
            scales=self.scales,
            clocks=self.clocks,
            start=start,
            stamps=is_stamp,
            fault=fault,
            note=f"{label}: its numbers are stored as text." if self.holds_text else "",
            texts=(lambda: texts) if self.kind in ("text", "empty") else None,
        )


def read_xlsx(path: str | PathLike[str], hints: Hints = NO_HINTS) -> Table:
    """The columns of all sheets of a workbook; of formulas the values last computed.

    Raises InputError for a file that is no whole XLSX file, or without openpyxl.
    """
    source = fspath(path)
    with reading(source, _KIND):
        from openpyxl import load_workbook
        from openpyxl.utils import get_column_letter

        book = load_workbook(source, read_only=True, data_only=True)
        columns, unused = list[_Cells](), list[Stated]()
        try:
            for sheet in book.worksheets:
                # Some programs write the extent of a sheet wrongly.
                sheet.reset_dimensions()
                rows = list(sheet.iter_rows(values_only=True))
                cells, beside = _columns(source, plain(sheet.title), rows, get_column_letter, hints)
                cells = _with_formats(cells, sheet)
                columns, unused = columns + cells, unused + beside
        finally:
            book.close()
        unused += _remarks(source)
    if not columns:
        raise InputError.at(
            source, "rows of numbers", "no number in any sheet", "export the recording as CSV"
        )
    several = len({cells.sheet for cells in columns}) > 1
    names = tuple(
        (f"{cells.sheet}/" if several else "") + (cells.name or cells.letter) for cells in columns
    )
    nameless = not several and not any(cells.name for cells in columns)
    names = () if nameless else names
    read = tuple(
        cells.column(source, f"{source}, {column_label(names, at)}")
        for at, cells in enumerate(columns)
    )
    return with_units_of_rows(Table(source, names, read, unused=tuple(unused)))


def write_xlsx(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), below their names on one sheet.

    Raises InputError for what a sheet cannot hold, where the file cannot be written, or
    without openpyxl.
    """
    values = np.column_stack(list(columns.values()))
    if len(values) > _ROWS or not np.isfinite(values).all():
        excess = f"{len(values)}" if len(values) > _ROWS else "some that are not finite"
        raise InputError.at(fspath(path), f"at most {_ROWS} finite rows", excess, "write a .csv")
    with writing(path, _KIND) as part, part.open("wb") as file:
        from openpyxl import Workbook
        from openpyxl.cell import WriteOnlyCell

        book = Workbook(write_only=True)
        sheet = book.create_sheet("recording")

        def cell(value: float) -> object:
            # Of a number openpyxl writes 16 digits; 17 tell it from its neighbours.
            written = WriteOnlyCell(sheet, repr(value))
            written.data_type = "n"
            return written

        sheet.append(list(columns))
        for row in values.tolist():
            sheet.append([cell(value) for value in row])
        book.save(file)


def _columns(
    source: str, sheet: str, rows: Sequence[Sequence[object]], letter_of, hints: Hints
) -> tuple[list[_Cells], list[Stated]]:
    """The columns of a sheet, none where it holds no number, and what was not understood."""
    widest = max((len(row) for row in rows), default=0)
    # As text the head of a sheet is understood by the same rules; its numbers stay what they are.
    skip = min(hints.skip_rows, len(rows))
    lines = ["" if at < skip else _as_line(row, widest) for at, row in enumerate(rows[:_HEAD])]
    layout = layout_of(lines, skip, ("\t",)) if widest else None
    if layout is None:
        said = [(at, text) for at, line in enumerate(lines, 1) if speaks(text := plain(line))]
        return [], [Stated(text, f'sheet "{sheet}", row {at}') for at, text in said]
    header = header_of(source, lines, layout, hints)
    columns = []
    body = rows[layout.start :]
    while body and not any(value is not None for value in body[-1]):
        body = body[:-1]
    for at, kind in enumerate(layout.kinds):
        name = plain(header.names[at]) if header.names else ""
        values = [row[at] if at < len(row) else None for row in body]
        while values and values[-1] is None:
            values.pop()
        if name or (values and kind != "empty"):
            columns.append(
                _Cells(
                    sheet=sheet,
                    letter=letter_of(at + 1),
                    name=name,
                    first=layout.start + 1,
                    values=values,
                    decimal=layout.decimal,
                    kind=kind,
                    units=header.units[at],
                    scales=header.scales[at],
                    clocks=header.clocks[at],
                )
            )
    return columns, [*header.unused]


def _remarks(source: str) -> list[Stated]:
    """The comments on cells that speak of units, factors or rates."""
    said = []
    with ZipFile(source) as parts:
        for name in parts.namelist():
            if re.match(r"xl/.*comment", name, re.IGNORECASE) and name.endswith(".xml"):
                texts = re.findall(r"<(?:t|text)\b[^>]*>([^<]+)<", parts.read(name).decode("utf-8"))
                said += [Stated(text, "a comment on a cell") for text in texts if speaks(text)]
    return said


_OF_FORMAT = re.compile(r'"\s*([^"]+?)\s*"')


def _with_formats(columns: list[_Cells], sheet) -> list[_Cells]:
    """The columns with the units that stand in the formats of their first numbers, `0.00" mV"`."""
    from openpyxl.utils import column_index_from_string

    formatted = []
    for first, group in groupby(columns, lambda cells: cells.first):
        row = next(sheet.iter_rows(min_row=first, max_row=first), ())
        for cells in group:
            at = column_index_from_string(cells.letter) - 1
            written = _OF_FORMAT.search(row[at].number_format or "") if at < len(row) else None
            if written and is_unit(written[1]) and getattr(row[at], "value", None) is not None:
                stated = Stated(written[1], f"the format of {cells.letter}{first}")
                cells = cells._replace(units=(*cells.units, stated))
            formatted.append(cells)
    return formatted


def _as_line(row: Sequence[object], width: int) -> str:
    """A row of a sheet as a line of text."""
    cells = [" ".join(_as_text(value).split()) for value in row] + [""] * (width - len(row))
    line = io.StringIO()
    csv.writer(line, delimiter="\t", lineterminator="").writerow(cells)
    return line.getvalue()


def _as_text(value: object) -> str:
    """A value of a cell as it would stand in a file of text."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, datetime | date):
        return value.isoformat(" ") if isinstance(value, datetime) else value.isoformat()
    return str(value).strip()


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
