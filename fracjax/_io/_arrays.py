"""Columns of the containers that hold named arrays: MAT, HDF5, NPZ and NPY, TDMS, Parquet."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import prod
from typing import NamedTuple

import numpy as np

from fracjax._io._array_facts import Facts
from fracjax._io._files import EXPORT, plain
from fracjax._io._stamps import relative
from fracjax._io._table import Column, column_label
from fracjax._recording import LARGEST, InputError

_FAULTS = {
    "b": "true or false",
    "c": "complex numbers",
    "O": "text or objects",
    "S": "text",
    "T": "text",
    "U": "text",
    "V": "raw bytes",
}
_WIDEST = 4096


class Array(NamedTuple):
    """An array in a file, read when it is needed."""

    shape: tuple[int, ...]
    dtype: np.dtype
    load: Callable[[], np.ndarray]


@dataclass(frozen=True)
class ArrayTable:
    """The columns of the arrays in a container.

    The longest axis of an array, the first of several, is that of the samples. Each index across
    it is a column: `run1/voltage` of a vector; `data.3` of a matrix; `u.0.2` of channel 0,
    realisation 2; `log/time` of a field of records. Names are paths through groups and structures.
    """

    source: str
    names: tuple[str, ...]
    columns: tuple[tuple[str, Array, tuple[int, ...]], ...]
    """Path of the array, the array, and the index across the samples."""
    facts: Facts
    faults: Mapping[str, tuple[str, str]]
    """What arrays cannot be used for, and the remedy, by path."""

    @property
    def breaks(self) -> tuple[int, ...]:
        """None: an array is one block."""
        return ()

    @property
    def width(self) -> int:
        """How many columns there are."""
        return len(self.columns)

    def about(self, column: int) -> Column:
        """What the file says of column `column`."""
        path, array, index = self.columns[column]
        axis = _samples_axis(array.shape)
        fault, remedy = self.faults.get(path) or (_FAULTS.get(array.dtype.kind, ""), "")
        if not fault and len(index) < len(array.shape) - 1:
            fault = f"an array of shape {array.shape}"
        is_stamp = array.dtype.kind in "Mm" and not fault
        label = f"{self.source}, {column_label(self.names, column)}"
        note = ""
        if axis > 0:
            note = (
                f"{label}: the samples were taken to run along the longest axis of the shape "
                f"{array.shape}."
            )
        if unapplied := self.facts.unapplied(path):
            note = f"{note} {label}: {unapplied} stands beside it and was not applied.".strip()
        return Column(
            length=array.shape[axis],
            title=self.facts.title(path) + "".join(f".{at}" for at in index),
            unit="s" if is_stamp else self.facts.unit(path),
            clocks=self.facts.clocks(path),
            start=self._seconds(column)[1] if is_stamp else self.facts.start(path),
            stamps=is_stamp,
            fault=fault,
            remedy=remedy,
            note=note,
        )

    def numbers(self, column: int) -> np.ndarray:
        """Column `column`, shape (N,), float64: NaN where there is no number, ±∞ beyond range."""
        path, array, _ = self.columns[column]
        if array.dtype.kind in "Mm":
            return self._seconds(column)[0]
        with np.errstate(over="ignore"):
            values = self._raw(column).astype(np.float64)
        values[np.isin(values, self.facts.missing(path))] = np.nan
        scale, offset = self.facts.scaling(path)
        if (scale, offset) != (1.0, 0.0):
            values = values * scale + offset
        values[np.abs(values) >= LARGEST] *= np.inf
        return values

    def _raw(self, column: int) -> np.ndarray:
        _, array, index = self.columns[column]
        samples = np.moveaxis(array.load(), _samples_axis(array.shape), 0)
        return samples[(slice(None), *index)]

    def _seconds(self, column: int) -> tuple[np.ndarray, int | None]:
        """Dates or durations in seconds, and of dates when their zero is."""
        raw = self._raw(column)
        if raw.dtype.kind == "M":
            return relative(raw)
        return raw.astype("timedelta64[ns]").astype(np.int64) / 1e9, None

    def shown(self, row: int, column: int) -> str:
        """A value as it is stored."""
        return f"{self._raw(column)[row]:g}"

    def place(self, row: int, column: int) -> str:
        """Where a number stands, such as `loop.h5, column "run1/voltage", sample 16`, from 0."""
        return f"{self.source}, {column_label(self.names, column)}, sample {row}"


def array_table(
    source: str,
    arrays: Mapping[str, Array],
    facts: Mapping[str, object],
    faults: Mapping[str, tuple[str, str]] | None = None,
) -> ArrayTable:
    """The table of the arrays in a container, by path, and of what stands beside them, by path.

    A vector or matrix at the path "", which is that of a file of one array, has no names.

    Raises InputError where there is no array but of single values.
    """
    columns = [
        (plain(path), field, index)
        for whole, array in arrays.items()
        if prod(array.shape) != 1
        for path, field in _fields(whole, _squeezed(array))
        for index in _indices(field.shape)
    ]
    if not columns:
        raise InputError.at(source, "arrays of samples", "none", EXPORT)
    nameless = all(path == "" and len(index) < 2 for path, _, index in columns)
    names = (".".join(map(str, (path, *index) if path else index)) for path, _, index in columns)
    attributes = {plain(path): _value(value) for path, value in facts.items()}
    sizes = {plain(path): max(array.shape, default=0) for path, array in arrays.items()}
    return ArrayTable(
        source,
        () if nameless else tuple(names),
        tuple(columns),
        Facts(source, attributes, sizes),
        {plain(path): fault for path, fault in (faults or {}).items()},
    )


def gathered(content: object) -> tuple[dict[str, Array], dict[str, object]]:
    """The arrays of nested mappings and lists by path, and all single values by path."""
    arrays: dict[str, Array] = {}
    facts: dict[str, object] = {}
    for path, value in _leaves("", content):
        if isinstance(value, np.ndarray) and value.size != 1:
            arrays[path] = Array(value.shape, value.dtype, value.view)
        else:
            facts[path] = value
    return arrays, facts


def _leaves(path: str, value: object) -> Iterator[tuple[str, object]]:
    if isinstance(value, dict | list | tuple):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, inner in items:
            yield from _leaves(f"{path}/{key}" if path else str(key), inner)
    else:
        yield path, value


def _squeezed(array: Array) -> Array:
    """The array without axes of length one."""
    shape = tuple(length for length in array.shape if length != 1)
    return Array(shape, array.dtype, lambda: array.load().reshape(shape))


def _fields(path: str, array: Array) -> Iterator[tuple[str, Array]]:
    """An array by its path, or the fields of an array of records by theirs."""
    if array.dtype.names is None:
        yield path, array
        return
    for name in array.dtype.names:
        dtype = array.dtype[name]
        if dtype.subdtype is None:
            field = Array(array.shape, dtype, lambda name=name: array.load()[name])
            yield from _fields(f"{path}/{name}" if path else name, field)


def _samples_axis(shape: tuple[int, ...]) -> int:
    return shape.index(max(shape))


def _indices(shape: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Every index across the samples; none of an array too wide for signals."""
    axis = _samples_axis(shape)
    across = shape[:axis] + shape[axis + 1 :]
    return iter(((),)) if prod(across) > _WIDEST else np.ndindex(across)


def _value(value: object) -> object:
    """A single value as plain Python, text where it is bytes."""
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype.kind == "M" and value.size == 1:
            return int(np.asarray(value).astype("datetime64[ns]").astype(np.int64).item())
        value = value.item() if value.size == 1 else ""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return plain(value) if isinstance(value, str) else value
