"""Parquet: each column of numbers, by PyArrow."""

from collections.abc import Mapping
from os import PathLike, fspath

import numpy as np

from fracjax._io._arrays import Array, ArrayTable, array_table
from fracjax._io._files import reading, writing

_KIND = "a Parquet file"


def read_parquet(path: str | PathLike[str]) -> ArrayTable:
    """The columns of a Parquet file; an absent number reads as no number.

    Raises InputError for a file that is no whole Parquet file, or without PyArrow.
    """
    source = fspath(path)
    with reading(source, _KIND):
        from pyarrow import parquet

        with open(source, "rb") as file:
            content = parquet.read_table(file)
        arrays = {
            name: Array((len(column),), _dtype(column.type), column.to_numpy)
            for name, column in zip(content.column_names, content.columns, strict=True)
        }
    return array_table(source, arrays, {})


def write_parquet(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), that read back to the same numbers.

    Raises InputError where the file cannot be written, or without PyArrow.
    """
    with writing(path, _KIND) as part:
        import pyarrow
        from pyarrow import parquet

        parquet.write_table(pyarrow.table(dict(columns)), part)


def _dtype(kind) -> np.dtype:
    """NumPy's type for one of Arrow's, that of objects where there is none."""
    try:
        return np.dtype(kind.to_pandas_dtype())
    except (NotImplementedError, TypeError):
        return np.dtype(object)
