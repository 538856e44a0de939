"""The standard loop, and how tests write it in the layouts of files."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pyarrow
import pytest
from nptdms import ChannelObject, TdmsWriter
from pyarrow import parquet
from scipy.io import savemat

from fracjax._io import read, write
from fracjax._recording import InputError, Recording

COUNT = 64
TIME = np.arange(COUNT) * 0.005
DRIVE = np.round(1.8 + 1.8 * np.sin(np.arange(COUNT) / 3), 9)
RESPONSE = np.round(-100 + 20 * np.cos(np.arange(COUNT) / 3), 9)
LOOP = {"time_s": TIME, "voltage_V": DRIVE, "displacement_um": RESPONSE}
SIGNALS = {"voltage_V": DRIVE, "displacement_um": RESPONSE}
BINARY = [".h5", ".mat", ".npy", ".npz", ".parquet", ".tdms", ".xlsx"]


def is_the_loop(recording: Recording) -> None:
    """Assert that it is the standard loop, to the last digit."""
    np.testing.assert_array_equal(recording.drive, DRIVE)
    np.testing.assert_array_equal(recording.response, RESPONSE)
    assert recording.dt == pytest.approx(0.005, rel=1e-12)


def matlab_73(path: Path, columns: dict[str, np.ndarray]) -> Path:
    """Columns as MATLAB saves them with -v7.3: HDF5 behind a head of its own, transposed."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns.items():
            data = file.create_dataset(name, data=np.atleast_2d(values))
            data.attrs["MATLAB_class"] = np.bytes_("double")
    content = bytearray(path.read_bytes())
    content[:128] = b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM"
    path.write_bytes(content)
    return path


def tdms(path: Path, *objects: object) -> Path:
    with path.open("wb") as file, TdmsWriter(file) as content:
        content.write_segment(list(objects))
    return path


def workbook(path: Path, sheets: Mapping[str, Sequence[list]]) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def rows_of(columns: dict[str, np.ndarray]) -> list[list]:
    """Names and numbers as the rows of a sheet."""
    return [list(columns), *map(list, zip(*(v.tolist() for v in columns.values()), strict=True))]


def refused(path: Path, capfd, **options) -> str:
    """The one sentence that refuses a file, nothing else being said nor left behind."""
    before = sorted(os.listdir(path.parent))
    with pytest.raises(InputError) as refusal:
        read(path, **options)
    sentence = str(refusal.value)
    assert sentence.startswith(str(path))
    assert sentence.endswith(".")
    assert sentence.isprintable()
    assert ": expected " in sentence
    assert ", found " in sentence
    assert "; " in sentence.rpartition(", found ")[2]
    assert sorted(os.listdir(path.parent)) == before
    assert capfd.readouterr() == ("", "")
    return sentence


def put_arrays(suffix: str) -> Callable[[Path, dict], Path]:
    """How to save what `write` does not."""

    def put(path: Path, columns: dict) -> Path:
        if suffix == ".npz":
            np.savez(path, **columns)
        elif suffix == ".mat":
            savemat(path, columns)
        elif suffix == ".tdms":
            tdms(path, *(ChannelObject("g", name, v) for name, v in columns.items()))
        elif suffix == ".parquet":
            parquet.write_table(pyarrow.table(columns), path)
        else:
            with h5py.File(path, "w") as file:
                for name, values in columns.items():
                    file[name] = values.tolist() if values.dtype.kind == "U" else values
        return path

    return put


def with_value(column: np.ndarray, value: float) -> np.ndarray:
    changed = column.copy()
    changed[16] = value
    return changed


def timed(path: Path, times: np.ndarray, frequency: float = 1.0) -> Path:
    """A sine and its quarter-period lead over any times [s]."""
    phase = 2 * np.pi * frequency * times
    write(path, {"time_s": times, "voltage_V": np.sin(phase), "displacement_um": np.cos(phase)})
    return path
