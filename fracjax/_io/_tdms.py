"""TDMS, the format of LabVIEW and DIAdem, by npTDMS."""

import struct
from collections.abc import Mapping
from os import PathLike, fspath
from typing import BinaryIO

import numpy as np

from fracjax._io._arrays import Array, array_table
from fracjax._io._files import reading, writing
from fracjax._io._table import Table

_KIND = "a TDMS file"
_GROUP = "recording"
_BIG_ENDIAN = 1 << 6


def read_tdms(path: str | PathLike[str]) -> Table:
    """The channels of a TDMS file as `group/channel`, with unit and step from their properties.

    Raises InputError for a file that is no whole TDMS file, or without npTDMS.
    """
    source = fspath(path)
    arrays: dict[str, Array] = {}
    with reading(source, _KIND):
        from nptdms import TdmsFile

        # An open file, for beside a path an outdated index would be read.
        with open(source, "rb") as file, TdmsFile.open(_checked(file)) as content:
            facts = dict(content.properties)
            for group in content.groups():
                facts |= {f"{group.name}/{key}": value for key, value in group.properties.items()}
                for channel in group.channels():
                    path = f"{group.name}/{channel.name}"
                    facts |= {f"{path}/{key}": value for key, value in channel.properties.items()}
                    arrays[path] = _channel(source, group.name, channel)
    return array_table(source, arrays, facts)


def write_tdms(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), as channels of the group "recording".

    Raises InputError where the file cannot be written, or without npTDMS.
    """
    with writing(path, _KIND) as part:
        from nptdms import ChannelObject, TdmsWriter

        with part.open("wb") as file, TdmsWriter(file) as content:
            content.write_segment(
                [ChannelObject(_GROUP, name, values) for name, values in columns.items()]
            )


def _checked(file: BinaryIO) -> BinaryIO:
    """The file, checked to end where its segments do; npTDMS drops what is cut short.

    Each begins with 28 bytes: mark, flags, version, length of the rest, and of its description.
    """
    end = file.seek(0, 2)
    at = 0
    while at < end:
        file.seek(at)
        head = file.read(28)
        order = ">" if head[4] & _BIG_ENDIAN else "<"
        at += 28 + struct.unpack_from(f"{order}Q", head, 12)[0]
    if at != end:
        raise EOFError(f"segments of {at} bytes in a file of {end}")
    file.seek(0)
    return file


def _channel(source: str, group: str, channel) -> Array:
    name = channel.name

    def load() -> np.ndarray:
        with reading(source, _KIND):
            from nptdms import TdmsFile

            with open(source, "rb") as file, TdmsFile.open(file) as content:
                return np.asarray(content[group][name][:])

    return Array((len(channel),), np.dtype(channel.dtype), load)
