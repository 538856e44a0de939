"""What a column is called, and in which units its file says that it is."""

import re

import numpy as np

from fracjax._io._table import Stated, Table
from fracjax._io._units import readable, titled
from fracjax._recording import conversion

_FINE = re.compile(r"(?<![a-z])(n|u|m|nano|micro|milli)s?(ec)?(s|onds?)?(?![a-z])", re.IGNORECASE)
"""The name of a column of parts of a second."""


def title_of(table: Table, column: int) -> str:
    """A column's own name."""
    return table.about(column).title or (table.names[column] if table.names else "")


def declared_units(table: Table, column: int) -> list[Stated]:
    """All units that the file states of a column, the nearest first."""
    own = titled(title_of(table, column)).unit
    return [*table.about(column).units, *([Stated(own, "its name")] if own else [])]


def written_unit(table: Table, column: int) -> str:
    """The unit that is stated nearest; empty where none is."""
    return next((stated.text for stated in declared_units(table, column)), "")


def finer_column(table: Table, time: int) -> int | None:
    """The column of parts of a second beside one of whole seconds, or of dates: it begins anew
    wherever the other goes on."""
    about, coarse = table.about(time), _second_of(table, time) or 1.0
    for at, each in enumerate(table.columns):
        second = _second_of(table, at)
        if at == time or each.fault or each.stamps or each.length != about.length:
            continue
        if second is None or second >= coarse or not _FINE.search(each.title):
            continue
        parts = each.numbers * second
        back = np.diff(parts) < 0
        ahead = np.diff(about.numbers) > 0
        if parts.min() >= 0 and parts.max() < 1 and back.any() and np.array_equal(back, ahead):
            return at
    return None


def _second_of(table: Table, column: int) -> float | None:
    """The unit of a column of times in seconds; None of any other column."""
    if table.about(column).stamps:
        return 1.0
    read = readable(written_unit(table, column) or "-")
    return conversion(read, "s") if read else None
