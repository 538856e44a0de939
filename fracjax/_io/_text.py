"""Text tables, of any separator, below any preamble."""

import csv
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import islice
from os import PathLike, fspath
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow

from fracjax._io._decoding import Text, text_of
from fracjax._io._exact import exact_of_text
from fracjax._io._files import EXPORT, text_signature, whole
from fracjax._io._header import Header, header_of
from fracjax._io._layout import Layout, cells_of, is_comment, layout_of
from fracjax._io._numbers import numbers_of
from fracjax._io._rows import is_text, rows_of
from fracjax._io._stamps import seconds_of
from fracjax._io._table import NO_HINTS, Column, Hints, Stated, Table, column_label
from fracjax._io._unit_columns import with_units_of_rows
from fracjax._recording import InputError

_LONGEST_LINE = 100_000
_PIECE = 64_000_000
"""Bytes of text that are handed to Arrow at a time, at most, and more than any line has."""
_HEADS = (60_000, 2_000_000, None)
_SHORT_HEADS = (
    (600, frozenset(("number",))),
    (2_000, frozenset(("number", "stamp", "text", "empty"))),
)
"""Bytes of heads that suffice where every line after them is read as their last ones are, and what
their columns may hold: what is no number in a few lines may yet become one."""
_TEXT_FAULT = {"text": "text", "empty": "next to no numbers"}


def read_text(path: str | PathLike[str], hints: Hints = NO_HINTS) -> Table:
    """The table in a text file: the longest run of rows of numbers, its names and units above it.

    Raises InputError for a file that cannot be read, is no text, holds no such rows, or has
    a row of another width among them.
    """
    source = fspath(path)
    text = text_of(source)
    lines, layout, quick = _laid_out(source, text, hints)
    header = header_of(source, lines, layout, hints, _below(text, layout))
    if quick is not None:
        parsed = [_Parsed() if each is None else each for each in quick]
        count = len(next(each.values for each in parsed if each.values is not None))
        numbers, breaks, beyond = None, (), ()
    else:
        rows = rows_of(source, text.decoded().split("\n"), layout, header.repeated)
        count, numbers, breaks, beyond = len(rows.cells), rows.lines, rows.breaks, rows.beyond
        parsed = [_parsed(rows.cells, at, layout) for at in range(layout.width)]

    def line_of(row: int) -> int:
        """The line in the file, from 1, of a row."""
        if numbers is not None:
            return numbers[row]
        filled = (
            at
            for at, line in enumerate(text.raw.split(b"\n"))
            if at >= layout.start and line.strip()
        )
        return next(islice(filled, row, None)) + 1

    columns = tuple(
        _column(source, text, header, layout, at, count, parsed[at], line_of)
        for at in range(layout.width)
    )
    unused = (*header.unused, *beyond)
    return with_units_of_rows(Table(source, header.names, columns, breaks, unused))


_TAIL = 4_000
"""Bytes at the end of a file in which lines of text below its table are looked for."""


def _below(text: Text, layout: Layout) -> list[tuple[int, str]]:
    """The lines of text at the end of a file, with their numbers in it, from 1."""
    if text.encoding not in ("utf-8", "ascii", "cp1252"):
        return []
    tail = text.raw[-_TAIL:].decode(text.encoding, "replace").split("\n")
    said = []
    for at, line in enumerate(reversed(tail[1:])):
        if not is_comment(line) and not is_text(line, layout):
            break
        if line.strip():
            said.append((at, line))
    # Of a long file the lines are counted only where there is something to say of them.
    number = text.raw.count(b"\n") + 1 if said else 0
    return [(number - at, line) for at, line in reversed(said)]


def _column(
    source: str,
    text: Text,
    header: Header,
    layout: Layout,
    at: int,
    count: int,
    parsed: "_Parsed",
    line_of: Callable[[int], int],
) -> Column:
    """A column of the table; one of days alone is no time."""
    kind, values = layout.kinds[at], parsed.values
    is_stamp = kind == "stamp"
    fault = _TEXT_FAULT.get(kind, "")
    if is_stamp and values is not None and len(values) > 1 and not np.any(np.diff(values)):
        fault = "the same date in every row"

    def shown(row: int) -> str:
        line = text.decoded().split("\n")[line_of(row) - 1]
        return f'"{cells_of(line, layout.separator)[at][:40]}"'

    cells = parsed.cells
    behind = (Stated(parsed.unit, "its cells"),) if parsed.unit else ()
    return Column(
        length=count,
        read=lambda: np.full(count, np.nan) if values is None else values,
        place=lambda row: f"{source}, line {line_of(row)}, {column_label(header.names, at)}",
        shown=shown,
        title=header.names[at] if header.names else "",
        units=(Stated("s", "its dates"),) if is_stamp else (*behind, *header.units[at]),
        scales=header.scales[at],
        clocks=header.clocks[at],
        start=parsed.start,
        stamps=is_stamp,
        fault=fault,
        texts=cells if kind in ("text", "empty") else None,
        exact=(lambda: exact_of_text(cells(), layout.decimal))
        if kind == "number" and cells and not behind
        else None,
    )


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


class _Parsed(NamedTuple):
    """What the cells of a column are."""

    values: np.ndarray | None = None
    """(N,), of stamps in seconds; None of text."""
    start: int | None = None
    """Of stamps, when their zero is [ns since 1970]."""
    unit: str = ""
    """That which stands behind each number."""
    cells: Callable[[], Sequence[str]] | None = None
    """As they are written."""


def _laid_out(
    source: str, text: Text, hints: Hints
) -> tuple[list[str], Layout, list[_Parsed | None] | None]:
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


def _quick(text: Text, layout: Layout) -> list[_Parsed | None] | None:
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
    parsed: list[_Parsed | None] = [None] * layout.width
    for at, kind in enumerate(kinds):
        cells = partial(_cells, text, layout, start, at)
        if kind == "stamp":
            values, zero = seconds_of(columns[at].tolist())
            parsed[at] = _Parsed(values, zero)
        elif kind == "number":
            # Codes for beyond range are read one by one.
            if not (np.abs(columns[at]) < 9e37).all():
                return None
            parsed[at] = _Parsed(columns[at], cells=cells)
        else:
            parsed[at] = _Parsed(cells=cells)
    return parsed


def _cells(text: Text, layout: Layout, start: int, at: int) -> Sequence[str]:
    """The cells of a column as they are written."""
    from pyarrow.compute import call_function

    if layout.separator == " ":
        lines = text.raw[start:].decode(text.encoding, "replace").split("\n")
        return [line.split()[at] for line in lines if line.strip()]
    name = f"{at}"
    chunks = [
        chunk
        for piece in _pieces(text, start)
        for chunk in arrow.open_csv(
            piece,
            arrow.ReadOptions(
                use_threads=False,
                column_names=[f"{each}" for each in range(layout.width)],
                encoding=text.encoding,
            ),
            arrow.ParseOptions(delimiter=layout.separator, quote_char=False),
            arrow.ConvertOptions(column_types={name: pa.string()}, include_columns=[name]),
        )
        .read_all()
        .column(0)
        .chunks
    ]
    return call_function("utf8_trim_whitespace", [pa.chunked_array(chunks, pa.string())])


def _pieces(text: Text, start: int) -> Iterator[pa.Buffer]:
    """The text from byte `start` on, in whole lines, in memory that is Arrow's own: its threads may
    let go of a piece when the interpreter has ended, whose memory they could not return."""
    raw = text.raw
    while start < len(raw):
        stop = len(raw)
        if start + _PIECE < stop:
            stop = raw.rfind(b"\n", start, start + _PIECE) + 1
        piece = pa.allocate_buffer(stop - start)
        np.frombuffer(piece, np.uint8)[:] = np.frombuffer(raw, np.uint8, stop - start, start)
        yield piece
        start = stop


def _by_arrow(
    text: Text, layout: Layout, start: int, read: list[int]
) -> dict[int, np.ndarray] | None:
    """The columns to read from byte `start` on, each with its numbers; None where Arrow, which
    takes half of pandas' time, refuses them; as a stream, since a reader of the whole starts a
    thread for each file."""
    if layout.separator == " " or "stamp" in layout.kinds:
        return None
    names = [str(at) for at in range(layout.width)]
    # As many rows as there are lines, or fewer: batches are copied into columns of that length, so
    # that no more than one stands in memory twice.
    columns = {at: np.empty(text.raw.count(b"\n", start) + 1) for at in read}
    count = 0
    options = (
        arrow.ReadOptions(use_threads=False, column_names=names),
        arrow.ParseOptions(delimiter=layout.separator, quote_char=False),
        arrow.ConvertOptions(
            column_types={names[at]: pa.float64() for at in read},
            include_columns=[names[at] for at in read],
            null_values=[],
            decimal_point=layout.decimal,
        ),
    )
    try:
        for piece in _pieces(text, start):
            with arrow.open_csv(piece, *options) as batches:
                for batch in batches:
                    for at, part in zip(read, batch.columns, strict=True):
                        # `to_numpy` would import pandas, which takes longer than all else.
                        columns[at][count : count + len(part)] = np.from_dlpack(part)
                    count += len(batch)
    except pa.ArrowInvalid:
        return None
    return {at: column[:count] for at, column in columns.items()}


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


def _parsed(rows: Sequence[Sequence[str]], at: int, layout: Layout) -> _Parsed:
    """A column of cells as numbers or seconds, and the unit that stands behind each."""
    cells = [row[at] for row in rows]
    if layout.kinds[at] == "stamp":
        return _Parsed(*seconds_of(cells))
    if layout.kinds[at] != "number":
        return _Parsed(cells=lambda: cells)
    numbers = numbers_of(cells, layout.decimal)
    return _Parsed(numbers.values, None, numbers.unit, lambda: cells)
