"""Text tables: comma, semicolon, tab or blank separated, with or without a line of names."""

import codecs
import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path

import numpy as np
import pandas as pd

from fracjax._io._files import EXPORT, opened, signature, whole
from fracjax._io._table import Column, column_label
from fracjax._recording import LARGEST, InputError

_COMMENTS = ("#", "%")
_SEPARATORS = (";", "\t", ",", " ")
"""In order of preference; the blank stands for any run of blanks and tabs."""
_LONGEST_LINE = 100_000
_NUMBER = re.compile(
    r"[-+]?((\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?|nan|inf|infinity)", re.IGNORECASE | re.ASCII
)
_NO_TEXT = re.compile(r"[\x00-\x08\x0b-\x1f\x7f]")


@dataclass(frozen=True)
class TextTable:
    """The lines of a text file that hold samples, all of one width."""

    source: str
    names: tuple[str, ...]
    width: int
    rows: Sequence[str]
    lines: Sequence[int]
    """Line in the file, from 1, of each row."""
    separator: str
    decimal: str

    def about(self, column: int) -> Column:
        """What is known of column `column`: its name says the rest."""
        return Column(len(self.rows))

    def numbers(self, column: int) -> np.ndarray:
        """Column `column`, shape (N,), float64; `InputError` where a cell is no finite number."""
        # Beside a column of text the others are read one by one.
        values = self._parsed([column]) if self._all is None else self._all[:, [column]]
        if values is None or not (np.abs(values) < LARGEST).all():
            return self._cell_by_cell(column)
        return values[:, 0]

    @cached_property
    def _all(self) -> np.ndarray | None:
        """All columns (N, width) at once."""
        return self._parsed(list(range(self.width)))

    def _parsed(self, columns: list[int]) -> np.ndarray | None:
        """Columns (N, …); None where there are quotes or a cell is text."""
        text = "\n".join(self.rows)
        if '"' in text:
            return None
        try:
            frame = pd.read_csv(
                io.StringIO(text),
                sep=r"\s+" if self.separator == " " else self.separator,
                decimal=self.decimal,
                header=None,
                index_col=False,
                usecols=columns,
                dtype=np.float64,
                quoting=csv.QUOTE_NONE,
                na_filter=False,
            )
        except ValueError:
            return None
        return frame.to_numpy()

    def place(self, row: int, column: int) -> str:
        """Where a cell stands, such as `loop.csv, line 17, column "voltage_V"`."""
        return f"{self.source}, line {self.lines[row]}, {column_label(self.names, column)}"

    def _cell_by_cell(self, column: int) -> np.ndarray:
        """The same as `numbers`, slowly: it knows quotes, and the place of the first bad cell."""
        foreign = "." if self.decimal == "," else ","
        values = np.empty(len(self.rows))
        for row, line in enumerate(self.rows):
            cell = _cells(line, self.separator)[column]
            number = _NUMBER.fullmatch(cell) and foreign not in cell
            values[row] = float(cell.replace(self.decimal, ".")) if number else np.nan
            if not abs(values[row]) < LARGEST:
                kind = "a number with a decimal comma" if self.decimal == "," else "a number"
                kind = "a finite number" if number else kind
                raise InputError.at(
                    self.place(row, column), kind, f'"{cell[:40]}"', "correct or delete that line"
                )
        return values


def read_text(path: str | PathLike[str]) -> TextTable:
    """The table in a text file: UTF-8, UTF-16 with its mark, or Latin-1; `#` and `%` comment.

    **Raises:** `InputError` for a file that cannot be read, is no text, holds no rows, or whose
    rows differ in length.
    """
    source = fspath(path)
    lines, rows, comment = [], [], ""
    for number, line in enumerate(_text(source).split("\n"), 1):
        said = line.strip()
        if said.startswith(_COMMENTS):
            comment = comment if rows else said.lstrip("#% \t")
        elif said:
            lines.append(number)
            rows.append(line)
    longest = max(map(len, rows), default=0)
    if longest > _LONGEST_LINE:
        raise InputError.at(
            source, "one sample per line", f"a line of {longest} characters", EXPORT
        )
    if not rows:
        raise InputError.at(source, "rows of numbers", "an empty file", EXPORT)
    separator = _separator(rows[1:21] or rows)
    names = _names(rows[0], separator)
    if names and len(rows) == 1:
        raise InputError.at(source, "rows of numbers", "only a line of names", EXPORT)
    width = len(_cells(rows[1 if names else 0], separator))
    if names and len(names) != width:
        raise InputError.at(
            f"{source}, line {lines[0]}",
            f"{width} column name(s)",
            f"{len(names)}",
            "correct that line or mark it with #",
        )
    if names:
        del rows[0], lines[0]
    elif len(_names(comment, separator)) == width:
        names = _names(comment, separator)
    for number, row in zip(lines, rows, strict=True):
        # A million lines are counted in a tenth of the time that it takes to cut them.
        plain = separator != " " and '"' not in row
        count = row.count(separator) + 1 if plain else len(_cells(row, separator))
        if count != width:
            raise InputError.at(
                f"{source}, line {number}",
                f"{width} column(s)",
                f"{count}",
                "correct or delete that line",
            )
    comma = separator != "," and any(re.search(r"\d,\d", row) for row in rows)
    return TextTable(source, names, width, rows, lines, separator, "," if comma else ".")


def write_text(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), as CSV, or tab-separated where the suffix is .tsv.

    It reads back to the same numbers. The file appears whole or not at all, also when the run is
    killed.

    **Raises:** `InputError` where it cannot be written.
    """
    separator = "\t" if Path(path).suffix.lower() == ".tsv" else ","
    with whole(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, delimiter=separator, lineterminator="\n")
        table.writerow(columns)
        values = (np.asarray(column).tolist() for column in columns.values())
        table.writerows(zip(*values, strict=True))


def _text(source: str) -> str:
    """The text of a file, its lines ended by a newline."""
    with opened(source):
        raw = Path(source).read_bytes()
    marked = raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    for encoding in ("utf-16",) if marked else ("utf-8-sig", "latin-1"):
        try:
            text = raw.decode(encoding).replace("\r\n", "\n").replace("\r", "\n")
        except UnicodeDecodeError:
            continue
        if not _NO_TEXT.search(text):
            return text
    kind, remedy = signature(raw) or ("", EXPORT)
    found = f"binary data ({kind})" if kind else "binary data"
    raise InputError.at(source, "text", found, remedy)


def _cells(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes and blanks around them."""
    if separator == " ":
        return [cell.strip('"') for cell in re.split(r"[ \t]+", line.strip(" \t"))]
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
    return [cell.strip() for cell in line.split(separator)]


def _separator(rows: Sequence[str]) -> str:
    """The separator that cuts these rows into the most numbers and the least of anything else."""

    def score(separator: str) -> int:
        cells = [cell for row in rows for cell in _cells(row, separator)]
        return sum(1 if _NUMBER.fullmatch(cell) else -1 for cell in cells)

    return max(_SEPARATORS, key=score)


def _names(line: str, separator: str) -> tuple[str, ...]:
    """The column names in a line, none where any of its cells is a number."""
    if separator == " ":
        line = re.sub(r"\s+(?=[\[(])", "", line)
    cells = _cells(line, separator)
    return () if any(map(_NUMBER.fullmatch, cells)) else tuple(cells)
