"""Recordings from and to files: one module per format, one line here for each."""

from collections.abc import Callable
from os import PathLike
from pathlib import Path

import numpy as np

from fracjax._io._columns import Table, drive, recording
from fracjax._io._text import read_text, write_text
from fracjax._recording import Recording

__all__ = ["read", "read_drive", "write_text"]

_READERS: dict[str, Callable[[str | PathLike[str]], Table]] = {
    **dict.fromkeys((".csv", ".tsv", ".txt", ".dat", ".asc"), read_text),
}
"""Reader by suffix; any other suffix is tried as text."""


def read(
    path: str | PathLike[str],
    *,
    time: str | int | None = None,
    input: str | int | None = None,
    output: str | int | None = None,
    rate: str | float | None = None,
    input_unit: str | None = None,
    output_unit: str | None = None,
) -> Recording:
    """The recording in a file.

    **Arguments:** `time`, `input` and `output`: a column's name or its index from 0, where the
    names do not tell; `rate`: samples per second ("200Hz", or a number in Hz), needed without a
    time column; `input_unit` and `output_unit`: what the file leaves unsaid.

    **Returns:** drive and response in the file's own units, time in seconds; what had to be
    assumed stands in `Recording.warnings`.

    **Raises:** `InputError` with file, line and column for a file that cannot be used.
    """
    return recording(
        _table(path),
        {"time": time, "input": input, "output": output},
        rate=rate,
        units={"input": input_unit, "output": output_unit},
    )


def read_drive(
    path: str | PathLike[str],
    *,
    time: str | int | None = None,
    input: str | int | None = None,
    rate: str | float | None = None,
    input_unit: str | None = None,
) -> tuple[np.ndarray, float, str]:
    """The drive in a file, its step [s] and its unit; there need be no response.

    **Arguments** and **raises:** as `read`.
    """
    return drive(_table(path), {"time": time, "input": input}, rate=rate, unit=input_unit)


def _table(path: str | PathLike[str]) -> Table:
    return _READERS.get(Path(path).suffix.lower(), read_text)(path)
