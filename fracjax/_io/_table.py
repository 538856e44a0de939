"""What every reader hands over: columns, named or not, and what the file says of them."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np

SIGNALS = {"time": "time", "input": "drive", "output": "response"}
"""What messages and options call the roles."""


class Fact(NamedTuple):
    """A step or a rate that a file states beside its columns."""

    name: str
    """What the file calls it, such as "run1/fs"."""
    value: str
    """As written, such as "0.005" or "200 Hz"."""
    unit: str
    """That of a plain number: "s" for a step, "Hz" for a rate."""


class Stated(NamedTuple):
    """What a file states of a column: a unit, or a factor."""

    text: str
    """As written."""
    place: str
    """Where, such as "line 3" or "voltage/units"."""


class Exact(NamedTuple):
    """Stamps of more digits than a float64 holds."""

    rest: np.ndarray
    """(N,), what they are beyond the first."""
    first: Fraction


@dataclass(frozen=True, eq=False)
class Column:
    """A column of numbers, read when they are needed, and what the file says of it."""

    length: int
    read: Callable[[], np.ndarray]
    """Shape (N,), float64: NaN where there is no number, ±∞ beyond range."""
    place: Callable[[int], str]
    """Where a row stands, such as `loop.csv, line 17, column "voltage_V"`."""
    shown: Callable[[int], str]
    """The cell of a row as it is written, such as `"abc"` or `an empty cell`."""
    title: str = ""
    """Its own name, without the path to it."""
    units: tuple[Stated, ...] = ()
    """As attributes, a row of units or lines above state them, the nearest first; what the name
    says is in the title."""
    scales: tuple[Stated, ...] = ()
    """Factors beside it that are not in the numbers."""
    clocks: tuple[Fact, ...] = ()
    """Steps and rates that hold for it."""
    start: int | None = None
    """When the first sample was taken [ns since 1970]; of stamps, when their zero is."""
    stamps: bool = False
    """Whether its numbers are seconds read from dates or clock times."""
    fault: str = ""
    """Why it can be no signal, such as "complex numbers"."""
    remedy: str = ""
    """What helps against the fault, where it is not to choose another column."""
    note: str = ""
    """What the reader had to assume."""
    texts: Callable[[], Sequence[str]] | None = None
    """The cells of a column of text."""
    exact: Callable[[], Exact | None] | None = None
    """Its numbers as stamps whose differences lose no digit; None where float64 holds them."""

    @cached_property
    def numbers(self) -> np.ndarray:
        """What `read` gives, read once."""
        return self.read()

    @property
    def unit(self) -> str:
        """The unit that is stated nearest; empty where only the name can tell."""
        return self.units[0].text if self.units else ""


@dataclass(frozen=True, eq=False)
class Table:
    """What the reader of a format hands over."""

    source: str
    """The file, as messages name it."""
    names: tuple[str, ...]
    """The column names, empty where the file has none."""
    columns: tuple[Column, ...]
    breaks: tuple[int, ...] = ()
    """The rows with which a new block begins, after names or text stood between."""
    unused: tuple[Stated, ...] = ()
    """What stands beside the columns, speaks of a unit, a factor, a rate or a start, and was not
    understood."""

    @property
    def width(self) -> int:
        """How many columns there are."""
        return len(self.columns)

    def about(self, column: int) -> Column:
        """Column `column`."""
        return self.columns[column]

    def numbers(self, column: int) -> np.ndarray:
        """The numbers of column `column`, shape (N,)."""
        return self.columns[column].numbers


class Hints(NamedTuple):
    """Where a call says that the names, the units and the numbers stand."""

    skip_rows: int = 0
    names_row: int | None = None
    """Its number in the file, from 1; likewise of the units."""
    units_row: int | None = None


NO_HINTS = Hints()


def column_key(names: Sequence[str], column: int) -> str:
    """What names a column in a call: its name, or its index where others are called the same."""
    name = names[column] if names else ""
    return shlex.quote(name) if name and list(names).count(name) == 1 else f"{column}"


def column_label(names: tuple[str, ...], column: int) -> str:
    """What messages call a column: its name, or its index from 0 where it has none."""
    return f"column {quoted(names[column])}" if names else f"column {column}"


def quoted(name: str) -> str:
    """A name in quotes, the middle of a long one left out."""
    return f'"{name}"' if len(name) <= 60 else f'"{name[:40]}...{name[-15:]}"'


def enumerated(items: list[str], listed: int = 12) -> str:
    """The items, or the first of many."""
    more = f" and {len(items) - listed} more" if len(items) > listed else ""
    return ", ".join(items[:listed]) + more
