"""MDF, the format of measurement systems in cars (ASAM), by asammdf."""

from os import PathLike, fspath

import numpy as np

from fracjax._io._arrays import Array, array_table
from fracjax._io._files import reading
from fracjax._io._table import Table

_KIND = "an MDF file"
_MARKS = (b"MDF     ", b"UnFinMF ")


def read_mdf(path: str | PathLike[str]) -> Table:
    """The channels of an MDF file, version 3 or 4, in physical values; with several groups, each
    with a time of its own, as `group/channel`.

    Raises InputError for a file that is no whole MDF file, or without asammdf.
    """
    source = fspath(path)
    arrays: dict[str, Array] = {}
    facts: dict[str, object] = {}
    with reading(source, _KIND):
        with open(source, "rb") as file:
            if file.read(8) not in _MARKS:
                # Of what is none, asammdf would complain on stderr as well, when it is collected.
                raise ValueError("no mark of MDF")
        from asammdf import MDF

        with MDF(source) as content:
            for group, channels in enumerate(content.groups):
                prefix = f"{group}/" if len(content.groups) > 1 else ""
                for index, channel in enumerate(channels.channels):
                    signal = content.get(group=group, index=index)
                    name = f"{prefix}{channel.name}"
                    values = np.asarray(signal.samples)
                    arrays[name] = Array(values.shape, values.dtype, values.view)
                    facts[f"{name}/unit"] = signal.unit
    return array_table(source, arrays, facts)
