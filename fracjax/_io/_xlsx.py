"""XLSX, by openpyxl: the table of each sheet."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from typing import NamedTuple

import numpy as np

from fracjax._io._files import plain, reading, writing
from fracjax._io._table import Column
from fracjax._recording import LARGEST, InputError

_KIND = "an XLSX file"
_ROWS = 1_048_575
"""What a sheet holds below its line of names."""


class Cells(NamedTuple):
    """A column of a sheet from its first number on."""

    sheet: str
    letter: str
    name: str
    first: int
    """Row in the sheet, from 1, of the first value."""
    values: Sequence[object]


@dataclass(frozen=True)
class SheetTable:
    """The columns of a workbook.

    The numbers of a sheet begin in its first row that has any; the last row of text above names
    them, else the letters of the columns do. With several sheets a name begins with the sheet's,
    as in `Run 1/voltage_V`; one sheet without names leaves them out.
    """

    source: str
    names: tuple[str, ...]
    columns: tuple[Cells, ...]

    @property
    def width(self) -> int:
        """How many columns there are."""
        return len(self.columns)

    def about(self, column: int) -> Column:
        """What is known of column `column`: its name says the rest."""
        return Column(len(self.columns[column].values))

    def numbers(self, column: int) -> np.ndarray:
        """Column `column`, shape (N,), float64; `InputError` where a cell is no finite number."""
        values = self.columns[column].values
        for row, value in enumerate(values):
            if not _is_number(value) or not abs(value) < LARGEST:  # type: ignore[arg-type]
                found = "an empty cell" if value is None else f'"{plain(str(value))[:40]}"'
                raise InputError.at(
                    self.place(row, column), "a finite number", found, "correct or delete that row"
                )
        return np.array(values, dtype=np.float64)

    def place(self, row: int, column: int) -> str:
        """Where a cell stands, such as `loop.xlsx, sheet "Run 1", cell B17`."""
        cells = self.columns[column]
        return f'{self.source}, sheet "{cells.sheet}", cell {cells.letter}{cells.first + row}'


def read_xlsx(path: str | PathLike[str]) -> SheetTable:
    """The columns of all sheets of a workbook; of formulas the values last computed.

    **Raises:** `InputError` for a file that is no whole XLSX file, or without openpyxl.
    """
    source = fspath(path)
    with reading(source, _KIND):
        from openpyxl import load_workbook
        from openpyxl.utils import get_column_letter

        book = load_workbook(source, read_only=True, data_only=True)
        found = []
        try:
            for sheet in book.worksheets:
                # Some programs write the extent of a sheet wrongly.
                sheet.reset_dimensions()
                rows = list(sheet.iter_rows(values_only=True))
                found += _columns(plain(sheet.title), rows, get_column_letter)
        finally:
            book.close()
    if not found:
        raise InputError.at(
            source, "rows of numbers", "no number in any sheet", "export the recording as CSV"
        )
    several = len({cells.sheet for cells in found}) > 1
    names = tuple(
        (f"{cells.sheet}/" if several else "") + (cells.name or cells.letter) for cells in found
    )
    nameless = not several and not any(cells.name for cells in found)
    return SheetTable(source, () if nameless else names, tuple(found))


def write_xlsx(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), below their names on one sheet.

    **Raises:** `InputError` for what a sheet cannot hold, where the file cannot be written, or
    without openpyxl.
    """
    values = np.column_stack(list(columns.values()))
    if len(values) > _ROWS or not np.isfinite(values).all():
        found = f"{len(values)}" if len(values) > _ROWS else "some that are not finite"
        raise InputError.at(fspath(path), f"at most {_ROWS} finite rows", found, "write a .csv")
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


def _columns(sheet: str, rows: Sequence[Sequence[object]], letter_of) -> list[Cells]:
    """The columns of a sheet, none where it holds no number."""
    first = next((n for n, row in enumerate(rows) if any(map(_is_number, row))), None)
    if first is None:
        return []
    above = next((row for row in reversed(rows[:first]) if any(c is not None for c in row)), ())
    columns = []
    for at in range(max(len(above), len(rows[first]))):
        name = plain(str(above[at])) if at < len(above) and above[at] is not None else ""
        values = [row[at] if at < len(row) else None for row in rows[first:]]
        while values and values[-1] is None:
            values.pop()
        if name or values:
            columns.append(Cells(sheet, letter_of(at + 1), name, first + 1, values))
    return columns


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
