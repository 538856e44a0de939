"""Parquet, Feather and lines of JSON, by PyArrow."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from os import PathLike, fspath
from typing import Any

import numpy as np

from fracjax._io._arrays import Array, array_table
from fracjax._io._files import reading, writing
from fracjax._io._table import Table

_BATCH = 1_000_000
"""Rows of a Parquet file that are read at a time."""
_PARQUET, _FEATHER, _JSON = "a Parquet file", "a Feather file", "lines of JSON"


def read_parquet(path: str | PathLike[str]) -> Table:
    """The columns of a Parquet file, with what the metadata of the file and of its fields say.

    Raises InputError for a file that is no whole Parquet file.
    """
    source = fspath(path)
    with reading(source, _PARQUET):
        from pyarrow import parquet

        file = parquet.ParquetFile(source, pre_buffer=False)

        def column(at: int):
            """The pieces of a column, read when needed: a file may be larger than two of them."""
            with reading(source, _PARQUET):
                # Arrow's threads may still run when the process ends, which aborts it.
                for batch in file.iter_batches(_BATCH, columns=[names[at]], use_threads=False):
                    yield batch.column(0)

        names = file.schema_arrow.names
        return _table(source, file.schema_arrow, file.metadata.num_rows, column)


def read_feather(path: str | PathLike[str]) -> Table:
    """The columns of a Feather file, likewise.

    Raises InputError for a file that is no whole Feather file.
    """
    source = fspath(path)
    with reading(source, _FEATHER):
        from pyarrow import feather

        content = feather.read_table(source, memory_map=False, use_threads=False)
        return _table(source, content.schema, len(content), lambda at: content.column(at).chunks)


def read_json_lines(path: str | PathLike[str]) -> Table:
    """The columns of a file with one object of JSON a line.

    Raises InputError for a file that holds anything else.
    """
    source = fspath(path)
    with reading(source, _JSON):
        from pyarrow import json

        options = json.ReadOptions(use_threads=False)
        content = json.read_json(source, options).flatten()
        return _table(source, content.schema, len(content), lambda at: content.column(at).chunks)


def write_parquet(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), that read back to the same numbers.

    Raises InputError where the file cannot be written.
    """
    with writing(path, _PARQUET) as part:
        import pyarrow
        from pyarrow import parquet

        parquet.write_table(pyarrow.table(dict(columns)), part)


def write_feather(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), likewise.

    Raises InputError where the file cannot be written.
    """
    with writing(path, _FEATHER) as part:
        import pyarrow
        from pyarrow import feather

        feather.write_feather(pyarrow.table(dict(columns)), str(part), compression="uncompressed")


def _table(source: str, schema, rows: int, column_of: Callable[[int], Iterable[Any]]) -> Table:
    """The columns of a table of Arrow's; an absent number reads as no number."""
    facts: dict[str, object] = {
        key.decode("utf-8", "replace"): value
        for key, value in (schema.metadata or {}).items()
        if key not in (b"ARROW:schema", b"pandas")
    }
    described = schema.pandas_metadata or {}
    facts |= {f"pandas/{key}": each for key, each in (described.get("attributes") or {}).items()}
    index = [name for name in described.get("index_columns", ()) if isinstance(name, str)]
    arrays = {}
    for at, field in enumerate(schema):
        nameless = field.name in index and field.name.startswith("__")
        # Of whole numbers an index counts, of others it is a time.
        name = ("index" if "int" in f"{field.type}" else "time index") if nameless else field.name
        arrays[name] = _array(field.type, rows, partial(column_of, at))
        for key, value in (field.metadata or {}).items():
            facts[f"{name}/{key.decode('utf-8', 'replace')}"] = value
    return array_table(source, arrays, facts)


def _array(kind, rows: int, column: Callable[[], Iterable[Any]]) -> Array:
    """A column as NumPy's type that holds it: moments without their zone, decimals as numbers."""
    import pyarrow
    from pyarrow import types

    steps = []
    if types.is_timestamp(kind) or types.is_date(kind):
        steps = [pyarrow.timestamp("ns")]
    elif types.is_time(kind):
        steps = [pyarrow.time64("ns"), pyarrow.int64(), pyarrow.duration("ns")]
    elif types.is_decimal(kind):
        steps = [pyarrow.float64()]
    elif types.is_dictionary(kind):
        steps = [kind.value_type]
    try:
        dtype = np.dtype([kind, *steps][-1].to_pandas_dtype())
    except (NotImplementedError, TypeError):
        dtype = np.dtype(object)

    def load() -> np.ndarray:
        values = np.empty(rows, dtype)
        end = 0
        for piece in column():
            for step in steps:
                piece = piece.cast(step)
            part = piece.to_numpy(zero_copy_only=False)
            if part.dtype.kind == "f" and dtype.kind in "iu":
                values = values.astype(part.dtype)  # whole numbers, some of them absent
            values[end : end + len(part)] = part
            end += len(part)
        pyarrow.default_memory_pool().release_unused()
        return values

    return Array((rows,), dtype, load, is_fresh=True)
