"""What goes out comes back, in every format."""

import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import fracjax
from fracjax._io import _FORMATS, read, write, write_text
from fracjax._io._numbers import _OVERLOADS
from fracjax._recording import InputError
from tests.io.layouts import (
    BINARY,
    DRIVE,
    LOOP,
    RESPONSE,
    SIGNALS,
    TIME,
    is_the_loop,
)


@pytest.mark.parametrize("suffix", _FORMATS)
@settings(max_examples=12)
@given(
    st.lists(
        st.floats(-1e99, 1e99).filter(lambda value: abs(value) not in _OVERLOADS),
        min_size=64,
        max_size=64,
    )
)
@example([5e-324, -0.0, 0.1 + 0.2, 1 / 3, 2.0**53 + 2, 9.999999999999999e98, 1e-310, 7.0] * 8)
def test_round_trip_loses_nothing(suffix, values):
    drive, response = np.array(values).reshape(2, 32)
    drive[:2] = response[:2] = 0.1, -0.7
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"loop{suffix}"
        write(path, {"time_s": TIME[:32], "drive_mV": drive, "position_nm": response})
        assert os.listdir(folder) == [path.name]
        recording = read(path)
    for back, values in ((recording.drive, drive), (recording.response, response)):
        np.testing.assert_array_equal(back.view(np.int64), values.view(np.int64))
    assert (recording.drive_unit, recording.response_unit) == ("mV", "nm")
    assert recording.warnings == ()
    assert recording.dt == pytest.approx(0.005, rel=1e-12)


LETTERS = st.text("aZ_9 .,;:'\"=+#%éµΩ文", max_size=12)


@pytest.mark.parametrize("suffix", [s for s in _FORMATS if s != ".mat"])
@settings(max_examples=15)
@given(st.lists(LETTERS.map("x{}|".format), min_size=2, max_size=2, unique=True))
def test_names_come_back(suffix, names):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"loop{suffix}"
        write(path, dict(zip(names, (DRIVE, RESPONSE), strict=True)))
        units: dict[str, Any] = {"input_unit": "V", "output_unit": "um"}
        is_the_loop(read(path, input=names[0], output=names[1], rate="200Hz", **units))


def test_matlab_names_only(tmp_path):
    for name in ("drive [V]", "displacement_µm", "u.v", "x" * 64):
        with pytest.raises(InputError, match=r"names of MATLAB variables, found .*; rename it or"):
            write(tmp_path / "loop.mat", {name: DRIVE})
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("suffix", _FORMATS)
def test_the_recording_of_a_piezo_in_every_format(data_folder, tmp_path, suffix):
    original = read(data_folder / "piezo_dbo" / "Model_Vi_Do.dat", input=0, output=4, rate=200)
    path = tmp_path / f"loop{suffix}"
    columns = {"voltage_V": original.drive, "displacement_um": original.response}
    fracjax.write(path, {"time_s": original.times, **columns})
    copy = read(path)
    np.testing.assert_array_equal(copy.drive, original.drive)
    np.testing.assert_array_equal(copy.response, original.response)
    assert copy.dt == pytest.approx(original.dt, rel=1e-12)
    assert copy.drive_period() == original.drive_period()


@pytest.mark.parametrize("suffix", _FORMATS)
@pytest.mark.parametrize("name", ["absent/loop", "file/loop", "folder"])
def test_places_that_cannot_be_written(tmp_path, name, suffix):
    (tmp_path / "file").touch()
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(InputError, match=r"expected a file that can be written, .*; choose"):
        write(tmp_path / f"{name}{suffix}", LOOP)
    assert sorted(os.listdir(tmp_path)) == ["file", f"folder{suffix}"]


@pytest.mark.parametrize("suffix", _FORMATS)
def test_writing_is_all_or_nothing(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"loop{suffix}"
    write(path, SIGNALS)
    before = path.read_bytes()

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(InputError, match="no space left on device"):
        write(path, LOOP)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == [path.name]


NOT_WRITTEN = {
    "no columns": ({}, "columns to write, found none"),
    "unequal": ({"u": DRIVE, "y": RESPONSE[:-1]}, 'column "y": expected 64 numbers.*found 63'),
    "ragged": ({"u": [[1, 2], [3]]}, 'column "u": expected real numbers along one axis'),
    "matrix": ({"u": np.eye(3)}, r"found float64 values of shape \(3, 3\)"),
    "complex": ({"u": DRIVE + 0j}, "found complex128 values"),
    "text": ({"u": ["a"] * 64}, "column .u.: expected real numbers"),
    "number for a name": ({"5": DRIVE}, "names that begin with a letter, .*found '5'"),
    "nan for a name": ({"NaN": DRIVE}, "names that begin with a letter"),
    "formula for a name": ({"=A1": DRIVE}, "names that begin with a letter"),
    "comment for a name": ({"# u": DRIVE}, "names that begin with a letter"),
    "two lines for a name": ({"u\nv": DRIVE}, "on one line"),
    "no name": ({"": DRIVE}, "names that begin with a letter"),
}


@pytest.mark.parametrize("suffix", [".csv", *BINARY])
@pytest.mark.parametrize("case", NOT_WRITTEN)
def test_columns_that_cannot_be_written(tmp_path, suffix, case):
    columns, sentence = NOT_WRITTEN[case]
    with pytest.raises(InputError, match=rf"{sentence}.*; .*\.$"):
        write(tmp_path / f"loop{suffix}", columns)
    assert os.listdir(tmp_path) == []


def test_what_single_formats_cannot_hold(tmp_path):
    with pytest.raises(InputError, match=r"one of the suffixes \.csv .*\.xlsx, found another"):
        write(tmp_path / "loop.ods", LOOP)
    with pytest.raises(InputError, match=r"some that are not finite; write a \.csv"):
        write(tmp_path / "loop.xlsx", {"u": np.array([1, np.nan])})
    with pytest.raises(InputError, match=r"at most 1048575 finite rows, found 1048576"):
        write(tmp_path / "loop.xlsx", {"u": np.zeros(1_048_576)})
    with pytest.raises(InputError, match=r"columns for an HDF5 file, found .*; choose another"):
        write(tmp_path / "loop.h5", {"a": DRIVE, "a/b": DRIVE})
    assert os.listdir(tmp_path) == []


def test_columns_of_unequal_length_are_not_written(tmp_path):
    path = tmp_path / "loop.csv"
    path.write_text("before")
    with pytest.raises(ValueError, match="argument 2"):
        write_text(path, {"a": TIME, "b": TIME[:-1]})
    assert path.read_text() == "before"
    assert os.listdir(tmp_path) == ["loop.csv"]
