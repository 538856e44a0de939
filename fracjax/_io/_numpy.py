"""NPZ and NPY, by NumPy; what is pickled in them is never opened."""

import zipfile
from collections.abc import Mapping
from os import PathLike, fspath
from typing import IO

import numpy as np

from fracjax._io._arrays import array_table, gathered
from fracjax._io._files import reading, writing
from fracjax._io._table import Table

_NPY, _NPZ = "an NPY file", "an NPZ file"


def read_npy(path: str | PathLike[str]) -> Table:
    """The columns of one array: without names, but for those of records.

    Beyond two axes a column is called by its indices across the samples, such as `0.2`.

    Raises InputError for a file that is no whole NPY file.
    """
    source = fspath(path)
    with reading(source, _NPY), open(source, "rb") as file:
        arrays, facts = gathered({"": _array(file)})
    return array_table(source, arrays, facts)


def read_npz(path: str | PathLike[str]) -> Table:
    """The arrays of an NPZ file by name.

    Raises InputError for a file that is no whole NPZ file.
    """
    source = fspath(path)
    content = {}
    with reading(source, _NPZ), zipfile.ZipFile(source) as archive:
        for member in archive.namelist():
            with archive.open(member) as file:
                content[member.removesuffix(".npy")] = _array(file)
        arrays, facts = gathered(content)
    return array_table(source, arrays, facts)


def write_npy(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), as one array of records, which keeps their names.

    Raises InputError where the file cannot be written.
    """
    with writing(path, _NPY) as part:
        length = len(next(iter(columns.values())))
        records = np.empty(length, [(name, values.dtype) for name, values in columns.items()])
        for name, values in columns.items():
            records[name] = values
        with part.open("wb") as file:
            np.lib.format.write_array(file, records, allow_pickle=False)


def write_npz(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), as arrays by name.

    Raises InputError where the file cannot be written.
    """
    # Not np.savez, for which some names are arguments.
    with writing(path, _NPZ) as part, zipfile.ZipFile(part, "w") as archive:
        for name, values in columns.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, values, allow_pickle=False)


def _array(file: IO[bytes]) -> np.ndarray:
    """The array in an NPY stream, or an empty one of objects where they are pickled."""
    try:
        return np.lib.format.read_array(file, allow_pickle=False)
    except ValueError as error:
        if "allow_pickle" in str(error):
            return np.empty(0, object)
        raise
