"""The rows of a table in lines of text, one by one: what is passed over, and what is refused."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from fracjax._io._layout import Layout, cells_of, is_comment, kind_of
from fracjax._io._table import Stated
from fracjax._recording import MINIMUM_SAMPLES, InputError

_VALUES = frozenset(("number", "stamp", "quantity"))


class Rows(NamedTuple):
    """The rows of a table."""

    cells: list[list[str]]
    lines: list[int]
    """The line in the file, from 1, of each."""
    breaks: tuple[int, ...]
    """The rows with which a new block begins."""
    beyond: tuple[Stated, ...] = ()
    """The names of another table, with which what is read no more begins."""


def rows_of(source: str, lines: Sequence[str], layout: Layout, repeated: Sequence[str]) -> Rows:
    """The rows of a table from its first line on.

    Comments and blank lines are passed over, and text behind the last row.  Where the names
    `repeated` stand again, or text that is followed by as many rows as a recording needs, a new
    block begins; blank lines part blocks where each is as long as that.

    Raises InputError for a line that is no row.
    """
    cells: list[list[str]] = []
    numbers: list[int] = []
    breaks: list[int] = []
    blanks: list[int] = []
    beyond: tuple[Stated, ...] = ()
    at = layout.start
    while at < len(lines):
        row = _row(lines[at], layout)
        if row is not None and row != repeated:
            cells.append(row)
            numbers.append(at + 1)
        elif not lines[at].strip():
            blanks.append(len(cells))
        elif not is_comment(lines[at]):
            after = _next_block(lines, at, layout, repeated)
            if after is None and _is_end(lines, at, layout):
                break
            if after is None and _is_another(lines, at, layout):
                beyond = (Stated(f"another table, {lines[at].strip()}", f"line {at + 1}"),)
                break
            if after is None:
                raise _refusal(source, lines, at, layout)
            breaks.append(len(cells))
            at = after
            continue
        at += 1
    while cells and not any(cells[-1]):
        cells.pop()
        numbers.pop()
    breaks += _long_blocks(blanks, len(cells), len(breaks) > 0)
    sound = sorted(row for row in set(breaks) if 0 < row < len(cells))
    return Rows(cells, numbers, tuple(sound), beyond)


def _row(line: str, layout: Layout) -> list[str] | None:
    """The cells of a row of the table; None of a line that is none."""
    if not line.strip() or is_comment(line):
        return None
    cells = cells_of(line, layout.separator)
    if len(cells) == layout.width + 1 and kind_of(cells[-1]) in ("text", "empty"):
        # A remark on one sample.
        cells = cells[: layout.width]
    if len(cells) != layout.width:
        return None
    if not any(cells):
        return cells
    # A key and its value in the head of another segment.
    if layout.kinds[0] == "number" and kind_of(cells[0]) == "text":
        return None
    kinds = [
        kind_of(cells[at]) for at, kind in enumerate(layout.kinds) if kind in ("number", "stamp")
    ]
    return cells if any(kind in _VALUES or kind == "code" for kind in kinds) else None


def _next_block(
    lines: Sequence[str], at: int, layout: Layout, repeated: Sequence[str]
) -> int | None:
    """The line where rows go on behind a repeated header or other text; None where none do."""
    named = False
    for start in range(at, len(lines)):
        named = named or (
            bool(repeated) and cells_of(lines[start], layout.separator) == list(repeated)
        )
        if _row(lines[start], layout) is None or not _goes_on(lines, start, layout):
            continue
        text_only = all(is_text(line, layout) for line in lines[at:start])
        return start if named or text_only else None
    return None


def _goes_on(lines: Sequence[str], start: int, layout: Layout) -> bool:
    """Whether as many rows follow as a recording needs."""
    rows = (_row(line, layout) is not None for line in lines[start : start + MINIMUM_SAMPLES])
    return start + MINIMUM_SAMPLES <= len(lines) and all(rows)


def is_text(line: str, layout: Layout) -> bool:
    """Whether no cell of a line holds a value."""
    cells = cells_of(line, layout.separator)
    return not any(kind_of(cell) in _VALUES for cell in cells)


def _is_end(lines: Sequence[str], at: int, layout: Layout) -> bool:
    """Whether only words follow, such as "End of data", and none in place of a number.

    Where blanks part cells, words may be as many as columns.
    """
    width = len(cells_of(lines[at], layout.separator))
    apart = layout.separator == " " or width != layout.width
    return apart and all(is_text(line, layout) for line in lines[at:])


def _is_another(lines: Sequence[str], at: int, layout: Layout) -> bool:
    """Whether behind a blank line another table begins, of another width and with names, after
    which no row of this one follows."""
    width = len(cells_of(lines[at], layout.separator))
    named = not lines[at - 1].strip() and width != layout.width and is_text(lines[at], layout)
    return named and all(_row(line, layout) is None for line in lines[at:])


def _long_blocks(blanks: Sequence[int], count: int, stated: bool) -> list[int]:
    """The rows behind blank lines, where these part blocks long enough for a recording."""
    if stated or not blanks:
        return []
    edges = sorted({0, *blanks, count})
    lengths = [stop - start for start, stop in pairwise(edges)]
    return edges[1:-1] if min(lengths, default=0) >= MINIMUM_SAMPLES else []


def _refusal(source: str, lines: Sequence[str], at: int, layout: Layout) -> InputError:
    """The refusal of a line that is no row of the table."""
    cells = cells_of(lines[at], layout.separator)
    place = f"{source}, line {at + 1}"
    if len(cells) == layout.width:
        beginning = f'"{lines[at].strip()[:40]}"'
        return InputError.at(
            place, "a row of numbers", beginning, "correct that line, or cut the file there"
        )
    remedy = "complete that line, or give --skip-rows where the table begins below it"
    if not any(line.strip() for line in lines[at + 1 :]):
        remedy = "delete that last line, which seems cut short"
    return InputError.at(place, f"{layout.width} column(s)", f"{len(cells)}", remedy)
