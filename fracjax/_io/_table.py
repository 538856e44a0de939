"""What every reader hands over: columns, named or not, what is known of them, where they stand."""

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
    """What a file says of a column besides its name and its numbers."""

    length: int
    unit: str = ""
    """As an attribute states it; empty where only the name can tell."""
    clocks: tuple[Fact, ...] = ()
    """Steps and rates that hold for it."""
    fault: str = ""
    """Why it can be no signal, such as "complex numbers"."""
    note: str = ""
    """What the reader had to assume."""


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

    def about(self, column: int) -> Column:
        """What is known of column `column` without reading it."""
        ...

    def numbers(self, column: int) -> np.ndarray:
        """Column `column`, shape (N,), float64; `InputError` where a cell is no finite number."""
        ...

    def place(self, row: int, column: int) -> str:
        """Where a cell stands, such as `loop.csv, line 17, column "voltage_V"`."""
        ...


def column_label(names: tuple[str, ...], column: int) -> str:
    """What messages call a column: its name, or its index from 0 where it has none."""
    return f"column {quoted(names[column])}" if names else f"column {column}"


def quoted(name: str) -> str:
    """A name in quotes, the middle of a long one left out."""
    return f'"{name}"' if len(name) <= 60 else f'"{name[:40]}...{name[-15:]}"'
