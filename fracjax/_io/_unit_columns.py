"""Columns of units: a unit, or its prefix, beside each value."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fracjax._io._table import Column, Stated, Table, column_label
from fracjax._io._units import is_spelled_unit, readable, titled
from fracjax._recording import conversion

_MOST = 12
"""Most different units of a column of them."""
_PREFIXES = {"p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6}
"""What a column of prefixes may hold beside nothing."""


def with_units_of_rows(table: Table) -> Table:
    """A table whose columns know the units that stand beside each of their values.

    A column of units is that of the column whose name it begins with, else of the one to its left
    that has no unit yet, else of the one to its right. Values in several units are brought to the
    one that most have.
    """
    columns = list(table.columns)
    for at, column in enumerate(table.columns):
        words = _words(column)
        if words is None:
            continue
        owner = _owner(table, at, all(word in _PREFIXES or not word for word in words))
        if owner is None:
            continue
        place = column_label(table.names, at)
        columns[owner] = _with_units(columns[owner], column, words, place)
        columns[at] = replace(column, fault=f"the unit of {column_label(table.names, owner)}")
    return replace(table, columns=tuple(columns))


def _words(column: Column) -> list[str] | None:
    """The different cells of a column of units or of prefixes; None of any other."""
    if column.texts is None or not column.length:
        return None
    words = _different(column.texts())
    filled = [word for word in words if word]
    if not filled or len(words) > _MOST:
        return None
    units = all(map(is_spelled_unit, filled)) and len(filled) == len(words)
    return words if units or (len(words) > 1 and _PREFIXES.keys() >= set(filled)) else None


def _different(cells: Sequence[str]) -> list[str]:
    if hasattr(cells, "unique"):  # Arrow's, of which a million take no time
        return [f"{cell or ''}" for cell in cells.unique().to_pylist()]  # type: ignore[attr-defined]
    return [cell.strip() for cell in dict.fromkeys(cells)]


def _owner(table: Table, at: int, are_prefixes: bool) -> int | None:
    """The column whose units, or prefixes, the column `at` holds."""
    free = [c for c, each in enumerate(table.columns) if not each.fault and not each.stamps]
    title = table.columns[at].title.casefold()
    own = [(len(name), c) for c in free if (name := table.columns[c].title.casefold())]
    named = [each for each in own if title.startswith(table.columns[each[1]].title.casefold())]
    if named:
        return max(named)[1]
    bare = [
        c for c in free if not table.columns[c].unit and not titled(table.columns[c].title).unit
    ]
    before, after = [c for c in bare if c < at], [c for c in bare if c > at]
    if at - 1 in before:
        return at - 1
    if at + 1 in after:
        return at + 1
    if before:
        return before[-1]
    # A unit that its name states already: the two must agree.
    return at - 1 if at - 1 in free and not are_prefixes else None


def _with_units(column: Column, beside: Column, words: list[str], place: str) -> Column:
    """A column whose values are brought to one unit."""
    if len(words) == 1:
        return replace(column, units=(Stated(words[0], place), *column.units))
    assert beside.texts is not None
    cells = np.array([f"{cell or ''}".strip() for cell in _listed(beside.texts())])
    counts = {word: np.count_nonzero(cells == word) for word in words}
    most = max(counts, key=counts.__getitem__)
    prefixes = all(not word or word in _PREFIXES for word in words) and "" in words
    if prefixes:
        scales = {word: _PREFIXES.get(word, 1.0) for word in words}
    else:
        scales = {word: conversion(readable(word) or "", readable(most) or "") for word in words}
    if None in scales.values():
        row = int((cells != most).argmax())
        fault = f"units of different kinds beside its values, {most} and {cells[row]}"
        return replace(column, fault=fault)
    factors = np.ones(len(cells))
    for word, scale in scales.items():
        factors[cells == word] = scale
    stated = () if prefixes else (Stated(most, place),)
    listed = ", ".join(f"{word or 'none'} in {count} rows" for word, count in counts.items())
    return replace(
        column,
        read=lambda: column.read() * factors,
        units=(*stated, *column.units),
        exact=None,
        note=f"{column.note} {place}: it states the {'prefix' if prefixes else 'unit'} of each "
        f"value, {listed}; they were brought to {'one' if prefixes else most}.".strip(),
    )


def _listed(cells: Sequence[str]) -> Sequence[str]:
    return cells.to_pylist() if hasattr(cells, "to_pylist") else cells  # type: ignore[attr-defined]
