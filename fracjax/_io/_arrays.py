"""Columns of the containers that hold named arrays: MAT, HDF5, NPZ and NPY, TDMS, Parquet."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import prod
from typing import NamedTuple

import numpy as np

from fracjax._io._files import EXPORT, plain
from fracjax._io._table import Column, Fact, column_label
from fracjax._recording import LARGEST, InputError

_STEPS = ("dt", "Ts", "wf_increment")
_RATES = ("fs", "Fs", "rate", "sampling_rate", "sample_rate")
_UNITS = ("units", "unit", "unit_string")
FACTS = frozenset((*_STEPS, *_RATES, *_UNITS))
"""Names of scalars, attributes and properties that tell a step, a rate or a unit."""
_FAULTS = {
    "b": "true or false",
    "c": "complex numbers",
    "M": "dates",
    "m": "durations",
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
    facts: Mapping[str, object]

    @property
    def width(self) -> int:
        """How many columns there are."""
        return len(self.columns)

    def about(self, column: int) -> Column:
        """What is known of column `column` without reading it."""
        path, array, index = self.columns[column]
        axis = _samples_axis(array.shape)
        fault = _FAULTS.get(array.dtype.kind, "")
        if not fault and len(index) < len(array.shape) - 1:
            fault = f"an array of shape {array.shape}"
        note = ""
        if axis > 0:
            note = (
                f"{self.source}, {column_label(self.names, column)}: the samples were taken to run "
                f"along the longest axis of the shape {array.shape}."
            )
        return Column(array.shape[axis], self._unit(path), self._clocks(path), fault, note)

    def numbers(self, column: int) -> np.ndarray:
        """Column `column`, shape (N,), float64; `InputError` where a cell is no finite number."""
        _, array, index = self.columns[column]
        samples = np.moveaxis(array.load(), _samples_axis(array.shape), 0)
        with np.errstate(over="ignore"):
            values = samples[(slice(None), *index)].astype(np.float64)
        bad = ~(np.abs(values) < LARGEST)
        if bad.any():
            row = int(bad.argmax())
            raise InputError.at(
                self.place(row, column), "a finite number", f"{values[row]:g}", "correct or cut it"
            )
        return values

    def place(self, row: int, column: int) -> str:
        """Where a number stands, such as `loop.h5, column "run1/voltage", sample 16`, from 0."""
        return f"{self.source}, {column_label(self.names, column)}, sample {row}"

    def _unit(self, path: str) -> str:
        told = (self.facts.get(f"{path}/{name}") for name in _UNITS)
        return next((unit for unit in told if isinstance(unit, str) and unit), "")

    def _clocks(self, path: str) -> tuple[Fact, ...]:
        """The steps and rates of the nearest scope that has any: the array, its group, the file."""
        scope = path
        while True:
            stem = f"{scope}/" if scope else ""
            names = [name for name in (*_STEPS, *_RATES) if stem + name in self.facts]
            if names or not scope:
                return tuple(self._fact(stem + name, name in _STEPS) for name in names)
            scope = scope.rpartition("/")[0]

    def _fact(self, path: str, is_step: bool) -> Fact:
        value, unit = str(self.facts[path]), self._unit(path)
        return Fact(path, f"{value} {unit}".strip(), "s" if is_step else "Hz")


def array_table(
    source: str, arrays: Mapping[str, Array], facts: Mapping[str, object]
) -> ArrayTable:
    """The table of the arrays in a container, by path, and of what stands beside them, by path.

    A vector or matrix at the path "", which is that of a file of one array, has no names.

    **Raises:** `InputError` where there is no array but of single values.
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
    told = {plain(path): _value(value) for path, value in facts.items()}
    return ArrayTable(source, () if nameless else tuple(names), tuple(columns), told)


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
        value = value.item() if value.size == 1 else ""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return plain(value) if isinstance(value, str) else value
