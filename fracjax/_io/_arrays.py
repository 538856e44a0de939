"""Columns of the containers that hold named arrays: MAT, HDF5, NPZ and NPY, TDMS, Parquet."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from math import prod
from typing import NamedTuple

import numpy as np

from fracjax._io._array_facts import Facts
from fracjax._io._exact import exact_of
from fracjax._io._files import EXPORT, plain
from fracjax._io._stamps import relative
from fracjax._io._table import Column, Stated, Table, column_label
from fracjax._io._unit_columns import with_units_of_rows
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
_FEW = 16
"""Most words or numbers of an array that states something of others."""


class Array(NamedTuple):
    """An array in a file, read when it is needed."""

    shape: tuple[int, ...]
    dtype: np.dtype
    load: Callable[[], np.ndarray]
    is_fresh: bool = False
    """Whether each load gives numbers that nobody else holds."""


def array_table(
    source: str,
    arrays: Mapping[str, Array],
    facts: Mapping[str, object],
    faults: Mapping[str, tuple[str, str]] | None = None,
    *,
    is_ordered: bool = True,
) -> Table:
    """The table of the arrays in a container, by path, and of what stands beside them, by path.

    `is_ordered`: whether the arrays come in the order in which they were written.

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
    names = (
        ()
        if nameless
        else tuple(".".join(map(str, (path, *at) if path else at)) for path, _, at in columns)
    )
    attributes = dict(_flat(facts.items()))
    sizes = {plain(path): max(array.shape, default=0) for path, array in arrays.items()}
    order = list(dict.fromkeys(path for path, _, _ in columns)) if is_ordered else []
    stated = Facts(source, attributes, sizes, order)
    broken = {plain(path): fault for path, fault in (faults or {}).items()}
    read = tuple(
        _column(f"{source}, {column_label(names, at)}", stated, broken.get(path), *column)
        for at, column in enumerate(columns)
        for path in (column[0],)
    )
    return with_units_of_rows(Table(source, names, read, unused=stated.unused()))


def _column(
    label: str,
    facts: Facts,
    fault: tuple[str, str] | None,
    path: str,
    array: Array,
    index: tuple[int, ...],
) -> Column:
    """Each index across the longest axis of an array, which is that of the samples: `run1/voltage`
    of a vector; `data.3` of a matrix; `u.0.2` of channel 0, realisation 2; `log/time` of a field of
    records."""
    axis = _samples_axis(array.shape)
    what, remedy = fault or (_FAULTS.get(array.dtype.kind, ""), "")
    if not what and len(index) < len(array.shape) - 1:
        what = f"an array of shape {array.shape}"
    is_stamp = array.dtype.kind in "Mm" and not what
    scale, offset = facts.scaling(path)

    def raw() -> np.ndarray:
        samples = np.moveaxis(array.load(), axis, 0)
        return samples[(slice(None), *index)]

    def numbers() -> np.ndarray:
        if array.dtype.kind == "m":
            return raw().astype("timedelta64[ns]").astype(np.int64) / 1e9
        if array.dtype.kind == "M":
            return relative(raw())[0]
        with np.errstate(over="ignore"):
            values = raw().astype(np.float64, copy=not array.is_fresh)
        if missing := facts.missing(path):
            values[np.isin(values, missing)] = np.nan
        if (scale, offset) != (1.0, 0.0):
            values = values * scale + offset
        if not (values.size and values.min() > -LARGEST and values.max() < LARGEST):
            values[np.abs(values) >= LARGEST] *= np.inf
        return values

    count = prod(array.shape) // max(array.shape[axis], 1)
    title = facts.title(path, index, count)
    return Column(
        length=array.shape[axis],
        read=numbers,
        place=lambda row: f"{label}, sample {row}",
        shown=lambda row: f"{raw()[row]:g}",
        title=title,
        units=(Stated("s", "its type"),)
        if is_stamp
        else facts.units(path, title.casefold(), index[0] if index else 0, count),
        scales=facts.scales(path),
        clocks=facts.clocks(path),
        start=relative(raw())[1] if is_stamp and array.dtype.kind == "M" else facts.start(path),
        stamps=is_stamp,
        fault=what,
        remedy=remedy,
        note=f"{label}: the samples were taken to run along the longest axis of the shape "
        f"{array.shape}."
        if axis > 0
        else "",
        texts=(lambda: [str(each) for each in raw()]) if array.dtype.kind in "OSTU" else None,
        exact=(lambda: exact_of(raw())) if array.dtype.kind in "iu" else None,
    )


def _flat(items: Iterable[tuple[str, object]]) -> Iterator[tuple[str, object]]:
    """Single values by path, and those within what is JSON; short lists of text as tuples."""
    for path, value in items:
        plain_value = _value(value)
        if isinstance(plain_value, str) and plain_value[:1] in ("{", "["):
            with suppress(ValueError):
                plain_value = json.loads(plain_value)
        if isinstance(plain_value, dict):
            yield from _flat((f"{path}/{key}", each) for key, each in plain_value.items())
        elif isinstance(plain_value, list):
            several = tuple(plain_value)
            if several and all(isinstance(each, str | int | float) for each in several):
                yield plain(path), several
            else:
                yield from _flat((f"{path}/{at}", each) for at, each in enumerate(plain_value))
        else:
            yield plain(path), plain_value


def gathered(content: object) -> tuple[dict[str, Array], dict[str, object]]:
    """The arrays of nested mappings and lists by path, and all single values by path."""
    arrays: dict[str, Array] = {}
    facts: dict[str, object] = {}
    for path, value in _leaves("", content):
        few = isinstance(value, np.ndarray) and value.dtype.kind in "SU" and value.size <= _FEW
        if isinstance(value, np.ndarray) and value.size != 1 and not few:
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
    return Array(shape, array.dtype, lambda: array.load().reshape(shape), array.is_fresh)


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
    """A single value, or a few, as plain Python, text where it is bytes."""
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype.kind == "M" and value.size == 1:
            return int(np.asarray(value).astype("datetime64[ns]").astype(np.int64).item())
        if value.dtype.kind in "OSTUifu" and 1 < value.size <= _FEW:
            return [_value(each) for each in np.ravel(value).tolist()]
        value = value.item() if value.size == 1 else ""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return plain(value) if isinstance(value, str) else value
