"""What every reader hands over: columns, named or not, and what the file says of them."""

from typing import NamedTuple, Protocol

import numpy as np


class Fact(NamedTuple):
    """A step or a rate that a file states beside its columns."""

    name: str
    """What the file calls it, such as "run1/fs"."""
    value: str
    """As written, such as "0.005" or "200 Hz"."""
    unit: str
    """That of a plain number: "s" for a step, "Hz" for a rate."""


class Column(NamedTuple):
    """What a file says of a column besides its numbers."""

    length: int
    title: str = ""
    """Its own name, without the path to it."""
    unit: str = ""
    """As an attribute or a row of units states it; empty where only the name can tell."""
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


class Hints(NamedTuple):
    """Where a call says that the names, the units and the numbers stand."""

    skip_rows: int = 0
    names_row: int | None = None
    """Its number in the file, from 1; likewise of the units."""
    units_row: int | None = None


NO_HINTS = Hints()


class Table(Protocol):
    """What the reader of a format hands over."""

    @property
    def source(self) -> str:
        """The file, as messages name it."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """The column names, empty where the file has none."""
        ...

    @property
    def width(self) -> int:
        """How many columns there are."""
        ...

    @property
    def breaks(self) -> tuple[int, ...]:
        """The rows with which a new block begins, after names or text stood between."""
        ...

    def about(self, column: int) -> Column:
        """What the file says of column `column`."""
        ...

    def numbers(self, column: int) -> np.ndarray:
        """Column `column`, shape (N,), float64: NaN where there is no number, ±∞ beyond range."""
        ...

    def place(self, row: int, column: int) -> str:
        """Where a cell stands, such as `loop.csv, line 17, column "voltage_V"`."""
        ...

    def shown(self, row: int, column: int) -> str:
        """A cell as it is written, such as `"abc"` or `an empty cell`."""
        ...


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
