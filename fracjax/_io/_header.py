"""Names, units, steps and rates from what stands above a table, and beside it."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from fracjax._io._facts import Said, beside, fact, kind_of, said_in, speaks, with_columns
from fracjax._io._layout import Layout, cells_of, is_comment
from fracjax._io._layout import kind_of as kind_of_cell
from fracjax._io._table import Fact, Hints, Stated
from fracjax._io._units import is_spelled_unit, is_unit, stripped, titled
from fracjax._io._words import quantity, role_of
from fracjax._recording import InputError

_REMARKS = frozenset(("comment", "comments", "remark", "remarks", "notes", "bemerkung"))
_MOST_ROWS = 5
_BESIDE = 60


class Header(NamedTuple):
    """Names, units and facts of a table's columns."""

    names: tuple[str, ...]
    """By column, or none at all."""
    units: tuple[tuple[Stated, ...], ...]
    """By column, none where none is stated beside the name."""
    scales: tuple[tuple[Stated, ...], ...]
    clocks: tuple[tuple[Fact, ...], ...]
    unused: tuple[Stated, ...]
    """Lines with a unit or a number with one that were not understood."""
    repeated: tuple[str, ...]
    """The cells of the row of names, by which it is known where it stands again."""


class _Row(NamedTuple):
    """A row of text above the table."""

    line: int
    cells: list[str]


def header_of(
    source: str,
    lines: Sequence[str],
    layout: Layout,
    hints: Hints,
    below: Sequence[tuple[int, str]] = (),
) -> Header:
    """The header of a table in lines of text.

    The rows next above the table that are as wide as it are its names, its units, and remarks; all
    lines above, those `below` it with their numbers, and all text beside it may state units, names,
    steps and rates.

    Raises InputError where a row of names has too few or too many.
    """
    width = layout.width
    names_row, units_row = _stated_rows(source, lines, layout, hints)
    above = _rows_above(lines, layout)
    if hints.names_row is None and hints.units_row is None:
        names_row, units_row = _parts(above, layout)
    if names_row is None and hints.names_row is None:
        _check_width(source, lines, layout, above, units_row)
    if not above and hints.names_row is None:
        _check_units(source, lines, layout)
    names = _names(names_row, layout)
    behind = [
        each
        for number, line in below
        for each in said_in(line, _cells(line, layout), f"line {number}")
    ]
    said = with_columns([*_said(lines, layout, names_row, units_row), *behind])
    facts = beside(said, [*layout.data], names, layout.decimal)
    extra = _beyond(names_row, units_row, layout)
    if not names and facts.names:
        names = tuple(facts.names.get(at, f"column {at}") for at in range(width))
    units = [list[Stated]() for _ in range(width)]
    if units_row:
        for at, cell in enumerate(_padded(units_row.cells, width)):
            if unit := _unit_cell(cell):
                units[at].append(Stated(unit, f"line {units_row.line + 1}"))
    shared = (*facts.clocks.get(-1, ()), *extra)
    unused = dict.fromkeys(
        Stated(each.text, each.place)
        for each in said
        if each.place not in facts.used and speaks(each.text)
    )
    return Header(
        names,
        tuple((*own, *facts.units.get(at, ())) for at, own in enumerate(units)),
        tuple(tuple(facts.scales.get(at, ())) for at in range(width)),
        tuple((*facts.clocks.get(at, ()), *shared) for at in range(width)),
        tuple(unused),
        tuple(names_row.cells) if names_row else (),
    )


def _rows_above(lines: Sequence[str], layout: Layout) -> list[_Row]:
    """The rows of text next above the table, from below upwards: as wide, and not of numbers."""
    rows: list[_Row] = []
    for at in range(layout.start - 1, -1, -1):
        line = lines[at]
        # A line of dashes parts the names from the table, and is none of them.
        if not line.strip(' \t"-=_+:' + layout.separator) or _is_of_keys(line, layout):
            continue
        row = _row(at, line, layout)
        if row is None or len(rows) == _MOST_ROWS:
            break
        rows.append(row)
    return rows


def _is_of_keys(line: str, layout: Layout) -> bool:
    """Whether each cell of a line is a key with its value, such as `Rate: 200 Hz`."""
    cells = [cell for cell in cells_of(line, layout.separator) if cell]
    keys = [cell.partition(":")[0] for cell in cells if ":" in cell]
    return len(keys) == len(cells) > 1 and any(kind_of(key) for key in keys)


def _row(at: int, line: str, layout: Layout) -> _Row | None:
    """A line as a row of text of the table's width, cut as its names would have to be."""
    bare = (
        line.strip().lstrip("#%!/*>").strip(" ")
        if is_comment(line) or line.lstrip()[:1] in "!/*>"
        else line
    )
    for cells in _cuts(bare, layout):
        # A key and its value are no names, nor are the values of one.
        keys = [cell.endswith((":", "=")) for cell in cells]
        stated = kind_of(re.split("[:=]", cells[0])[0]) if re.search("[:=].", cells[0]) else None
        if not _wide_enough(cells, layout) or (any(keys) and not all(keys)) or stated == "unit":
            continue
        kinds = [kind_of_cell(cell) for cell in cells]
        # Channels may be called 1 and 2, in a row with some text.
        ordinal = all(
            kind != "number" or cell.isdigit()
            for kind, cell, column in zip(kinds, cells, layout.kinds, strict=False)
            if column in ("number", "stamp")
        )
        if "stamp" in kinds or not ordinal or not kinds.count("text") + kinds.count("code"):
            continue
        return _Row(at, cells)
    return None


def _cuts(line: str, layout: Layout) -> list[list[str]]:
    """A line cut by the table's separator; blanks part names only where that gives enough."""
    if layout.separator != " ":
        cuts = [cells_of(line, layout.separator)]
        if is_comment(line) or len(cuts[0]) == 1:
            cuts.append(line.split())
        return cuts
    joined = _joined_units(line.strip())
    parted = [part.strip() for part in line.replace("\t", "  ").strip().split("  ") if part.strip()]
    return [
        cells_of(joined, " "),
        parted,
        cells_of(line, " "),
        cells_of(line, ","),
        cells_of(line, ";"),
    ]


def _joined_units(line: str) -> str:
    """A line whose units in brackets are joined to the names before them."""
    return re.sub(r"\s+(?=[\[(])|(?<=[\[(])\s+|\s+(?=[\])])", "", line)


def _wide_enough(cells: Sequence[str], layout: Layout) -> bool:
    """Whether a row of text fits the table: as wide, but for a separator or a remark at the end."""
    while len(cells) > layout.width and not cells[-1]:
        cells = cells[:-1]
    if len(cells) == layout.width:
        return True
    last = layout.width - 1
    if len(cells) == last and layout.kinds[last] == "empty":
        return True
    if len(cells) > layout.width:
        rest = cells[layout.width :]
        return all(
            cell.casefold() in (*_REMARKS, "start")
            or kind_of(cell) in ("step", "start")
            or kind_of_cell(cell) == "number"
            for cell in rest
        )
    return False


def _parts(above: Sequence[_Row], layout: Layout) -> tuple[_Row | None, _Row | None]:
    """The row of names and that of units among the rows above the table, from below upwards."""
    above = [row for row in above if any(kind_of_cell(cell) != "code" for cell in row.cells)]
    units = next(
        (row for row in above if _is_of_units(row, layout) and not _repeats(row, above)), None
    )
    if units is None:
        units = _unknown_units(above)
    if units is None:
        # A row with a number among the names is one of the table with a cell that is none.
        pure = [row for row in above if all(kind_of_cell(c) != "number" for c in row.cells)]
        mixed_first = above and above[0] not in pure
        if mixed_first and len(pure) and not _has_words(above[0]):
            return None, None
        best = max(filter(_has_words, above[:2]), key=_words, default=None)
        return best or next(iter(above), None), None
    at = above.index(units)
    if at + 1 < len(above):
        return above[at + 1], units
    rest = above[:at]
    if rest:
        return next((row for row in rest if _has_words(row)), rest[-1]), units
    return units, units


def _repeats(row: _Row, above: Sequence[_Row]) -> bool:
    """Whether a row has a cell of another: a sentence such as "time in ms" above the names."""
    others = {cell.casefold() for other in above if other is not row for cell in other.cells}
    return any(cell.casefold() in others and not is_spelled_unit(cell) for cell in row.cells)


def _words(row: _Row) -> int:
    """How many cells speak of a role."""
    return sum(role_of(titled(cell).name) is not None for cell in row.cells)


def _has_words(row: _Row) -> bool:
    return _words(row) > 0


def _is_of_units(row: _Row, layout: Layout) -> bool:
    """Whether a row is one of units: each is one, and some is no name as well."""
    cells = [
        row.cells[at]
        for at in range(min(layout.width, len(row.cells)))
        if layout.kinds[at] in ("number", "stamp")
    ]
    filled = [cell for cell in cells if stripped(cell)]
    counted = [c for c in filled if not _says_none(stripped(c))]
    # A row of names alone is not asked of pint, which takes long to load.
    if not any(is_spelled_unit(stripped(cell)) for cell in counted):
        return False
    if not all(is_unit(cell) for cell in counted):
        return False
    if len(counted) < len(filled) - 2:
        return False
    return any(
        len(stripped(cell)) > 1 or cell in ("s", "V", "A", "m", "N", "C") for cell in counted
    ) and not all(cell in ("t", "u", "y", "x") for cell in counted)


def _says_none(cell: str) -> bool:
    """Whether a word such as "Sequence" or "Time" stands where a unit would."""
    return (
        len(cell) > 2
        and quantity(cell) in ("counter", "time", "remark")
        and not is_spelled_unit(cell)
    )


def _unknown_units(above: Sequence[_Row]) -> _Row | None:
    """A lower row that must be one of units, though not all are understood: under a row of names,
    some are units, or all are in brackets."""
    if len(above) < 2 or not _has_words(above[1]):
        return None
    cells = [cell for cell in above[0].cells if stripped(cell)]
    if not cells:
        return None
    bracketed = all(cell[0] in "[(（【" for cell in cells)
    # A cell such as "u / kV" is a name with its unit.
    plain = not _has_words(above[0]) and not any(titled(cell).unit for cell in cells)
    some = plain and any(is_spelled_unit(stripped(cell)) for cell in cells)
    return above[0] if bracketed or some else None


def _names(names_row: _Row | None, layout: Layout) -> tuple[str, ...]:
    if names_row is None:
        return ()
    first, *others = names_row.cells[: layout.width]
    key, _, behind = first.partition(":")
    # A comment such as "# columns: t x y" says what it lists.
    first = behind.strip() if behind.strip() and kind_of(key) == "name" else first
    return tuple(_padded([first, *others], layout.width))


def _unit_cell(cell: str) -> str:
    """A cell of the row of units; nothing of a word such as Time, which stands there for none."""
    bare = stripped(cell)
    return "" if _says_none(bare) and quantity(bare) != "counter" else bare


def _padded(cells: Sequence[str], width: int) -> list[str]:
    return [*cells[:width], *[""] * (width - len(cells))]


def _said(
    lines: Sequence[str], layout: Layout, names_row: _Row | None, units_row: _Row | None
) -> list[Said]:
    """What all lines above the table say, and the text left of its columns."""
    taken = {row.line for row in (names_row, units_row) if row}
    statements = []
    for at, line in enumerate(lines[: layout.start]):
        if at not in taken and line.strip():
            statements += said_in(line, _cells(line, layout), f"line {at + 1}")
    first_column = min(layout.data, default=0)
    for at in range(layout.start, layout.start + _BESIDE) if first_column > 0 else ():
        cells = cells_of(lines[at], layout.separator)[:first_column] if at < len(lines) else []
        if cells and cells[0] and "stamp" not in layout.kinds[:first_column]:
            statements += said_in(" ".join(cells), cells, f"line {at + 1}")
    return statements


def _cells(line: str, layout: Layout) -> list[str]:
    """The cells of a line; blanks within a key part none."""
    return [] if layout.separator == " " else cells_of(line, layout.separator)


def _beyond(names_row: _Row | None, units_row: _Row | None, layout: Layout) -> tuple[Fact, ...]:
    """A step that stands in the row of units below its name, right of the columns."""
    if names_row is None or units_row is None or names_row is units_row:
        return ()
    clocks = []
    for name, value in list(zip(names_row.cells, units_row.cells, strict=False)):
        if (kind := kind_of(name)) in ("step", "rate") and kind_of_cell(value) == "number":
            clocks.append(fact(name, value, kind, layout.decimal))
    return tuple(each for each in clocks if each)


def _stated_rows(
    source: str, lines: Sequence[str], layout: Layout, hints: Hints
) -> tuple[_Row | None, _Row | None]:
    """The rows of names and of units that the call names by line."""
    rows: list[_Row | None] = []
    for name, number in (("names", hints.names_row), ("units", hints.units_row)):
        if number is None:
            rows.append(None)
            continue
        if not 1 <= number <= layout.start:
            raise InputError.at(
                f"{source}, --{name}-row",
                f"a line above the numbers, from 1 to {layout.start}",
                f"{number}",
                "correct it",
            )
        cuts = _cuts(lines[number - 1].strip().lstrip("#%!/*>").strip(" "), layout)
        fitting = [cells for cells in cuts if _wide_enough(cells, layout)]
        if not fitting:
            raise InputError.at(
                f"{source}, line {number}",
                f"{layout.width} {name}, one for each column",
                f"{len(cuts[0])}",
                f"give another line as --{name}-row",
            )
        rows.append(_Row(number - 1, fitting[0]))
    return rows[0], rows[1]


def _check_units(source: str, lines: Sequence[str], layout: Layout) -> None:
    """Raise `InputError` where the line next above the table holds units, too few or too many."""
    at = layout.start - 1
    while at >= 0 and not lines[at].strip():
        at -= 1
    words = (
        lines[at].strip().lstrip("#%!/*>").replace(layout.separator, " ").split() if at >= 0 else []
    )
    given = [stripped(word.strip('"')) for word in words]
    if 0 < len(given) != layout.width and all(map(is_spelled_unit, given)):
        raise InputError.at(
            f"{source}, line {at + 1}",
            f"{layout.width} units, one for each column",
            f"{len(given)}",
            f"complete that line, or give --skip-rows {at + 1}, --unit drive=V "
            "and --unit response=um",
        )


def _check_width(
    source: str, lines: Sequence[str], layout: Layout, above: Sequence[_Row], units: _Row | None
) -> None:
    """Raise `InputError` where the line next above the table looks like names, too few or many."""
    at = layout.start - 1
    while at >= 0 and not lines[at].strip():
        at -= 1
    if at < 0 or is_comment(lines[at]) or above or units:
        return
    cells = cells_of(lines[at], layout.separator)
    kinds = [kind_of_cell(cell) for cell in cells]
    over = cells_of(lines[at - 1], layout.separator) if at > 0 else []
    if (
        set(kinds) == {"number"}
        and len(over) == layout.width
        and _row(at - 1, lines[at - 1], layout)
    ):
        raise InputError.at(
            f"{source}, line {at + 1}",
            f"{layout.width} column(s)",
            f"{len(cells)}",
            "complete that line, or delete it",
        )
    if len(cells) < 2 or any(kind != "text" for kind in kinds):
        return
    spoken = any(role_of(titled(cell).name) for cell in cells)
    if spoken or len(lines[: at + 1]) == 1:
        raise InputError.at(
            f"{source}, line {at + 1}",
            f"{layout.width} column name(s)",
            f"{len(cells)}",
            "correct that line, or give --input, --output and --time by index and --skip-rows "
            f"{at + 1}",
        )
