"""Cells of text as numbers: marks of decimals and thousands, units, codes for no number."""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fracjax._io._lexicon import WORDS
from fracjax._io._units import readable, titled
from fracjax._recording import LARGEST, conversion

_GROUP = r"[ \u00a0\u2009\u202f'’]"
_DIGITS = rf"(?:\d+|\d{{1,3}}(?:{_GROUP}\d{{3}})+|\d{{1,3}}(?:[.,]\d{{3}})+)"
_FORM = rf"[-+−]?(?:{_DIGITS}(?:[.,]\d*)?|[.,]\d+)(?:[eEdD][-+]?\d+)?"
NUMBER = re.compile(_FORM, re.ASCII)
_QUANTITY = re.compile(rf"({_FORM})\s*([^\d\s.,;+-][^\s,;]*)", re.ASCII)
_MISSING, _ABOVE, _BELOW = (frozenset(WORDS["codes"][k]) for k in ("missing", "above", "below"))
_OVERLOADS = (9.9e37, 9.91e37)
"""What instruments that follow SCPI send for beyond range and for no number (IEEE 488.2)."""


class Parsed(NamedTuple):
    """A column of cells as numbers."""

    values: np.ndarray
    """(N,), NaN where there is no number, ±∞ where it was beyond range."""
    unit: str
    """That of all cells, where it is written behind each; else empty."""


def kind_of_cell(cell: str) -> str:
    """What a cell holds: "number", "code" for none, "quantity" with its unit, "empty" or "text"."""
    if not cell:
        return "empty"
    if NUMBER.fullmatch(cell):
        return "number"
    if code_of(cell) is not None:
        return "code"
    if (parts := _QUANTITY.fullmatch(cell)) and titled(f"time_{parts[2]}").unit:
        return "quantity"
    if parts and titled(f"v_{parts[2]}").unit:
        return "quantity"
    return "text"


def code_of(cell: str) -> float | None:
    """What a cell that is no number stands for: NaN, ±∞, or nothing that is known."""
    low = cell.casefold().strip()
    if low in _MISSING:
        return np.nan
    if low in _ABOVE:
        return np.inf
    return -np.inf if low in _BELOW else None


def decimal_of(cells: Sequence[str]) -> str:
    """The decimal mark of cells of numbers: the one that stands last in any with both, or alone.

    A comma that is followed by three digits only, everywhere, could part thousands: it is decimal
    unless a point stands in any cell.
    """
    commas = [c for c in cells if "," in c and re.search(r"\d,\d|^[-+]?,\d", c)]
    if not commas:
        return "."
    points = [c for c in cells if re.search(r"\d\.|\.\d", c)]
    both = [c for c in commas if "." in c]
    if both:
        return "," if sum(c.rfind(",") > c.rfind(".") for c in both) > len(both) / 2 else "."
    if not points:
        return ","
    return "," if len(commas) >= len(points) else "."


def numbers_of(cells: Sequence[str], decimal: str) -> Parsed:
    """Cells (N,) as numbers.

    Thousands are parted by blanks or apostrophes, or by the mark that is not the decimal one where
    some cell of the column shows both; else such a mark makes a cell foreign.
    """
    other = "." if decimal == "," else ","
    grouped = re.compile(rf"[-+−]?\d{{1,3}}(?:\{other}\d{{3}})+\{decimal}\d+", re.ASCII)
    parts_thousands = any(other in cell and grouped.fullmatch(cell) for cell in cells)
    values = np.empty(len(cells))
    units: dict[int, str] = {}
    for row, cell in enumerate(cells):
        number = cell
        code = code_of(cell)
        parts = None if code is not None or NUMBER.fullmatch(cell) else _QUANTITY.fullmatch(cell)
        if parts and readable(parts[2]):
            number, units[row] = parts[1], parts[2]
        value = code if code is not None else _value(number, decimal, other, parts_thousands)
        values[row] = np.nan if value is None else value
    values[np.isin(np.abs(values), _OVERLOADS[:1])] *= np.inf
    values[np.isin(np.abs(values), _OVERLOADS[1:])] = np.nan
    with np.errstate(invalid="ignore"):
        values[np.abs(values) >= LARGEST] *= np.inf
    return _of_one_unit(values, units)


def _value(cell: str, decimal: str, other: str, parts_thousands: bool) -> float | None:
    if not NUMBER.fullmatch(cell):
        return None
    plain = re.sub(_GROUP, "", cell.replace("−", "-"))
    if other in plain:
        head = plain.partition(decimal)[0].lstrip("+-")
        if not parts_thousands or not re.fullmatch(rf"\d{{1,3}}(\{other}\d{{3}})+", head):
            return None
        plain = plain.replace(other, "")
    if plain.count(decimal) > 1:
        return None
    return float(plain.replace(decimal, ".").replace("d", "e").replace("D", "E"))


def _of_one_unit(values: np.ndarray, units: dict[int, str]) -> Parsed:
    """Numbers with units behind them, brought to that of the first."""
    if not units:
        return Parsed(values, "")
    if 2 * len(units) < len(values):
        values[list(units)] = np.nan
        return Parsed(values, "")
    first = next(iter(units.values()))
    base = readable(first)
    for written in dict.fromkeys(units.values()):
        rows = [row for row, each in units.items() if each == written]
        read = readable(written)
        if written == first:
            continue
        scale = conversion(read, base) if base and read else None
        if scale is None:
            values[rows] = np.nan
            continue
        values[rows] *= scale
    bare = [row for row in np.flatnonzero(np.isfinite(values)) if row not in units and values[row]]
    values[bare] = np.nan
    return Parsed(values, first)
