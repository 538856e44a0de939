"""Recordings from and to files: one module per format, one line here for each."""

import re
from collections.abc import Callable, Mapping
from os import PathLike, fspath
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fracjax._io._columns import drive, recording, response
from fracjax._io._hdf5 import read_hdf5, write_hdf5
from fracjax._io._mat import read_mat, write_mat
from fracjax._io._numpy import read_npy, read_npz, write_npy, write_npz
from fracjax._io._parquet import read_parquet, write_parquet
from fracjax._io._table import Table
from fracjax._io._tdms import read_tdms, write_tdms
from fracjax._io._text import read_text, write_text
from fracjax._io._xlsx import read_xlsx, write_xlsx
from fracjax._recording import InputError, Recording

__all__ = [
    "SUFFIXES",
    "column_name",
    "read",
    "read_drive",
    "read_response",
    "read_with_columns",
    "write",
    "write_text",
]


class _Format(NamedTuple):
    read: Callable[[str | PathLike[str]], Table]
    write: Callable[[str | PathLike[str], Mapping[str, np.ndarray]], None]


_TEXT = _Format(read_text, write_text)
_FORMATS: dict[str, _Format] = {
    **dict.fromkeys((".csv", ".tsv", ".txt", ".dat", ".asc"), _TEXT),
    **dict.fromkeys((".h5", ".hdf5"), _Format(read_hdf5, write_hdf5)),
    ".mat": _Format(read_mat, write_mat),
    ".npy": _Format(read_npy, write_npy),
    ".npz": _Format(read_npz, write_npz),
    ".parquet": _Format(read_parquet, write_parquet),
    ".tdms": _Format(read_tdms, write_tdms),
    ".xlsx": _Format(read_xlsx, write_xlsx),
}
"""By suffix; any other suffix is tried as text."""
SUFFIXES = tuple(_FORMATS)
_OPENINGS = {"V": "voltage", "A": "current", "m": "displacement", "N": "force"}
_NAME = re.compile(r"(?!(nan|inf|infinity)$)[^\W\d_](.*\S)?", re.IGNORECASE)


def read(
    path: str | PathLike[str],
    *,
    time: str | int | None = None,
    input: str | int | None = None,
    output: str | int | None = None,
    rate: str | float | None = None,
    input_unit: str | None = None,
    output_unit: str | None = None,
    resample: str | float | None = None,
) -> Recording:
    """The recording in a file: text, Parquet, MAT, HDF5, NPZ, NPY, TDMS or XLSX by its suffix.

    In a container, each vector of numbers is a column, called by its path, such as `run1/voltage`,
    or by the end of it; of an array with more axes, each index across its longest axis, which is
    that of the samples, such as `data.3` or `u.0.2`.

    **Arguments:** `time`, `input` and `output`: a column's name or its index from 0, where the
    names do not tell; `rate`: samples per second ("200Hz", or a number in Hz), needed without a
    time column, unless the file states `dt`, `Ts`, `fs`, `Fs`, `rate` or `sampling_rate`;
    `input_unit` and `output_unit`: what the file leaves unsaid; `resample`: the rate to interpolate
    to where the times are not uniform.

    **Returns:** drive and response in the file's own units, time in seconds; what had to be
    assumed stands in `Recording.warnings`.

    **Raises:** `InputError` with file, place and column for a file that cannot be used.
    """
    return read_with_columns(
        path,
        time=time,
        input=input,
        output=output,
        rate=rate,
        input_unit=input_unit,
        output_unit=output_unit,
        resample=resample,
    )[0]


def read_with_columns(
    path: str | PathLike[str],
    *,
    time: str | int | None = None,
    input: str | int | None = None,
    output: str | int | None = None,
    rate: str | float | None = None,
    input_unit: str | None = None,
    output_unit: str | None = None,
    resample: str | float | None = None,
) -> tuple[Recording, dict[str, str | int]]:
    """As `read`, and the columns of "time", if any, "input" and "output": name, or index from 0."""
    return recording(
        _table(path),
        {"time": time, "input": input, "output": output},
        rate=rate,
        units={"input": input_unit, "output": output_unit},
        resample=resample,
    )


def read_drive(
    path: str | PathLike[str],
    *,
    time: str | int | None = None,
    input: str | int | None = None,
    rate: str | float | None = None,
    input_unit: str | None = None,
    resample: str | float | None = None,
) -> tuple[np.ndarray, float, str]:
    """The drive in a file, its step [s] and its unit; there need be no response.

    **Arguments** and **raises:** as `read`.
    """
    return drive(
        _table(path),
        {"time": time, "input": input},
        rate=rate,
        unit=input_unit,
        resample=resample,
    )


def read_response(
    path: str | PathLike[str],
    *,
    time: str | int | None = None,
    output: str | int | None = None,
    rate: str | float | None = None,
    output_unit: str | None = None,
    resample: str | float | None = None,
) -> tuple[np.ndarray, float, str]:
    """The response in a file, its step [s] and its unit; there need be no drive.

    **Arguments** and **raises:** as `read`.
    """
    return response(
        _table(path),
        {"time": time, "output": output},
        rate=rate,
        unit=output_unit,
        resample=resample,
    )


def column_name(role: str, unit: str) -> str:
    """A column's name that says its unit: voltage_V, displacement_um, or drive [V/um]."""
    plain = re.fullmatch(r"[numkµμ]?([VAmN])", unit)
    return f"{_OPENINGS[plain[1]]}_{unit}" if plain else f"{role} [{unit}]"


def write(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns to a file of the format that its suffix tells; `read` gives the same numbers.

    The file appears whole or not at all.

    **Arguments:** `columns`, real numbers of shape (N,) by name, such as "voltage_V", which `read`
    finds by name and unit.

    **Raises:** `InputError` for columns that are no such numbers, names that do not begin with a
    letter, a suffix of no known format, or a file that cannot be written.
    """
    target = fspath(path)
    form = _FORMATS.get(Path(target).suffix.lower())
    if form is None:
        known = " ".join(_FORMATS)
        raise InputError.at(target, f"one of the suffixes {known}", "another", "choose one of them")
    form.write(target, _checked(target, columns))


def _table(path: str | PathLike[str]) -> Table:
    return _FORMATS.get(Path(path).suffix.lower(), _TEXT).read(path)


def _checked(target: str, columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The columns as float64, once any format can hold them."""
    if not columns:
        raise InputError.at(target, "columns to write", "none", "give some")
    arrays = {}
    for name, column in columns.items():
        if not (_NAME.fullmatch(name) and name.isprintable()):
            raise InputError.at(
                target, "names that begin with a letter, on one line", f"{name!r}", "rename it"
            )
        where = f'{target}, column "{name}"'
        try:
            values = np.asarray(column)
        except ValueError:
            values = np.empty(0, object)
        if values.dtype.kind not in "iuf" or values.ndim != 1:
            found = f"{values.dtype} values of shape {values.shape}"
            raise InputError.at(where, "real numbers along one axis", found, "give such")
        arrays[name] = values.astype(np.float64)
        first = next(iter(arrays.values()))
        if len(values) != len(first):
            raise InputError.at(
                where, f"{len(first)} numbers, as before", f"{len(values)}", "give as many"
            )
    return arrays
