"""Binary waves of Igor Pro, by igor2."""

from os import PathLike, fspath

import numpy as np

from fracjax._io._arrays import Array, array_table
from fracjax._io._files import reading
from fracjax._io._table import Table

_KIND = "an Igor binary wave"


def read_ibw(path: str | PathLike[str]) -> Table:
    """The wave in an .ibw file, a column for each index across its samples, with the step and the
    units of its header.

    Raises InputError for a file that is no whole wave, or without igor2.
    """
    source = fspath(path)
    with reading(source, _KIND):
        from igor2 import binarywave

        wave = binarywave.load(source)["wave"]
        header, values = wave["wave_header"], np.asarray(wave["wData"])
        name = _text(header["bname"]) or "wave"
        # Headers of version 5 hold a step, an origin and units by axis, older ones a single one.
        step, units = np.ravel(header.get("sfA", header.get("hsA")))[0], _units(header)
        facts: dict[str, object] = {f"{name}/unit": units[0], f"{name}/note": _text(wave["note"])}
        # A wave that was never given a step has one of 1 without a unit.
        if units[1] or float(step) != 1.0:
            facts |= {f"{name}/xincrement": float(step), f"{name}/xincrement/unit": units[1]}
        arrays = {name: Array(values.shape, values.dtype, values.view)}
    return array_table(source, arrays, facts)


def _units(header) -> tuple[str, str]:
    """The units of the values and of the first axis."""
    data, axes = header.get("dataUnits", b""), header.get("dimUnits", header.get("xUnits", b""))
    return _text(data), _text(axes[0] if np.ndim(axes) > 1 else axes)


def _text(value: object) -> str:
    """Bytes, or an array of single ones, as text."""
    if isinstance(value, np.ndarray | list):
        value = b"".join(bytes(each) for each in np.ravel(value))
    text = value.decode("latin-1") if isinstance(value, bytes) else f"{value}"
    return text.strip("\0 ")
