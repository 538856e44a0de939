"""HDF5, by h5py."""

from collections.abc import Mapping
from math import prod
from os import PathLike, fsdecode, fspath

import numpy as np

from fracjax._io._arrays import Array, array_table
from fracjax._io._files import reading, writing
from fracjax._io._table import Table

_KIND = "an HDF5 file"
_LARGEST_FACT = 16
"""Values of an attribute, or of a dataset of text, that states something of others."""


def read_hdf5(path: str | PathLike[str]) -> Table:
    """The datasets of an HDF5 file by path, with units and rates from attributes and scalars.

    Links, soft or to other files, are not followed: what they point to has a path of its own.

    Raises InputError for a file that is no whole HDF5 file, or without h5py.
    """
    source = fspath(path)
    arrays: dict[str, Array] = {}
    facts: dict[str, object] = {}
    with reading(source, _KIND):
        import h5py

        def visit(path: str | bytes, node) -> None:
            name = fsdecode(path)
            for key, value in node.attrs.items():
                if np.size(value) <= _LARGEST_FACT and not isinstance(value, h5py.Reference):
                    facts[f"{name}/{key}" if name else key] = value
            if not isinstance(node, h5py.Dataset) or node.shape is None:
                return
            text = h5py.check_string_dtype(node.dtype) is not None
            if node.size == 1 or (text and prod(node.shape) <= _LARGEST_FACT):
                facts[name] = node[()]
            else:
                arrays[name] = Array(node.shape, node.dtype, lambda: _dataset(source, path))

        with h5py.File(source, "r") as file:
            visit("", file)
            file.visititems(visit)
    return array_table(source, arrays, facts, is_ordered=False)


def write_hdf5(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), as datasets; a name with a slash is a path.

    Raises InputError where the file cannot be written, or without h5py.
    """
    with writing(path, _KIND) as part:
        import h5py

        with h5py.File(part, "w") as file:
            for name, values in columns.items():
                file.create_dataset(name, data=values)


def _dataset(source: str, path: str | bytes) -> np.ndarray:
    with reading(source, _KIND):
        import h5py

        with h5py.File(source, "r") as file:
            return np.asarray(file[path])
