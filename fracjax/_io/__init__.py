"""Recordings from and to files: one module per format, one line here for each."""

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from fracjax._io._columns import Table, recording
from fracjax._io._text import read_text, write_text
from fracjax._recording import Recording

__all__ = ["read", "write_text"]

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
    reader = _READERS.get(Path(path).suffix.lower(), read_text)
    return recording(
        reader(path),
        {"time": time, "input": input, "output": output},
        rate=rate,
        units={"input": input_unit, "output": output_unit},
    )
