"""Formats beside text: what goes out comes back, and the one sentence that refuses the rest."""

import os
import pickle
import re
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pyarrow
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from pyarrow import parquet
from scipy.io import savemat

import fracjax
from fracjax._cli import run
from fracjax._io import _FORMATS, read, read_drive, write
from fracjax._io._clocks import is_time
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


# Out and back -------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", _FORMATS)
@settings(max_examples=12)
@given(st.lists(st.floats(-1e99, 1e99), min_size=64, max_size=64))
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


LETTERS = st.text("aZ_9 .,;:'\"[]()=+#%éµΩ文", max_size=12)


@pytest.mark.parametrize("suffix", [s for s in _FORMATS if s != ".mat"])
@settings(max_examples=15)
@given(st.lists(LETTERS.map("x{}|".format), min_size=2, max_size=2, unique=True))
def test_names_come_back(suffix, names):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"loop{suffix}"
        write(path, dict(zip(names, (DRIVE, RESPONSE), strict=True)))
        units = {"input_unit": "V", "output_unit": "um"}
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


# What is in containers ----------------------------------------------------------------------------


def test_hdf5_groups_attributes_and_records(tmp_path):
    path = tmp_path / "loop.hdf5"
    with h5py.File(path, "w") as file:
        run1 = file.create_group("input/run 1")
        run1["drive"], run1["position"] = DRIVE, RESPONSE.astype(np.float32)[:, None]
        run1["drive"].attrs["units"] = "kV"
        run1["position"].attrs["unit"] = np.bytes_("nm")
        run1.attrs["fs"] = 6400
        file["dt"] = 1.0
        file["link"] = h5py.SoftLink("/input/run 1/drive")
        file["lost"] = h5py.ExternalLink("absent.h5", "/x")
        file["note"] = "made by me"
        records = np.zeros(COUNT, [("t", "f8"), ("w", "f4", (2,))])
        records["t"] = 1000 * TIME
        file["log"] = records
    recording = read(path)
    np.testing.assert_array_equal(recording.drive, DRIVE)
    np.testing.assert_array_equal(recording.response, RESPONSE.astype(np.float32))
    assert (recording.drive_unit, recording.response_unit) == ("kV", "nm")
    assert recording.dt == pytest.approx(5.0)
    told = read(path, time="log/t", input="drive", output="input/run 1/position", input_unit="V")
    assert 'V was used as told, though the file says "kV".' in told.warnings[1]


def test_hdf5_rate_of_the_nearest_scope(tmp_path):
    path = tmp_path / "loop.h5"
    with h5py.File(path, "w") as file:
        for name, rate in (("a", "0.2 kHz"), ("b", 100)):
            group = file.create_group(name)
            group["u_V"], group["y_um"] = DRIVE, RESPONSE
            group["Fs"] = rate
        file["a/u_V"].attrs["dt"] = 5
        file.attrs["rate"] = 1
    a = read(path, input="a/u_V", output="b/y_um", rate=200)
    assert a.warnings == ()
    (note,) = read(path, input="b/u_V", output="b/y_um").warnings
    assert '100 Hz was taken as the rate, from "b/Fs" of 100.' in note
    with pytest.raises(InputError, match=r'one rate, found "a/u_V/dt" of 5 and "a/Fs" of 0.2 kHz;'):
        read(path, input="a/u_V", output="a/y_um")


@pytest.mark.parametrize("fact", [{"dt": 0.005}, {"Ts": 0.005}, {"fs": 200}, {"Fs": 200.0}])
@pytest.mark.parametrize("save", [savemat, matlab_73, lambda path, c: np.savez(path, **c)])
def test_step_or_rate_beside_the_signals(tmp_path, save, fact):
    path = tmp_path / ("loop.mat" if save in (savemat, matlab_73) else "loop.npz")
    save(path, SIGNALS | {name: np.array([[value]]) for name, value in fact.items()})
    recording = read(path)
    is_the_loop(recording)
    (note,) = recording.warnings
    ((name, value),) = fact.items()
    assert f'{path}: 200 Hz was taken as the rate, from "{name}" of {value}' in note
    assert read(path, rate=100).warnings == ()
    save(path, SIGNALS | {name: np.array([[-1.0]]) for name in fact})
    with pytest.raises(InputError, match=rf'"{name}": expected a positive .*; give '):
        read(path)
    samples, step, unit = read_drive(path, rate="200Hz")
    np.testing.assert_array_equal(samples, DRIVE)
    assert (step, unit) == (0.005, "V")


@pytest.mark.parametrize("compress", [False, True])
def test_mat_structures_and_cells(tmp_path, compress):
    cells = np.empty(3, object)
    cells[:] = DRIVE, "text", RESPONSE
    run1 = {"time_s": TIME, "volt": DRIVE, "x": np.c_[RESPONSE, TIME], "note": "text"}
    path = tmp_path / "loop.mat"
    savemat(path, {"run1": run1, "cells": cells, "empty": []}, do_compression=compress)
    is_the_loop(read(path, output="x.0"))
    is_the_loop(read(path, input="cells/0", output="cells/2", rate=200))
    with pytest.raises(InputError, match=r'one column for output, found "run1/x\.0", "run1/x\.1"'):
        read(path)


def test_mat_73_is_read_in_the_order_of_names(tmp_path):
    names = ["q", "b", "time", "a", "zz", "k", "h"]
    path = matlab_73(
        tmp_path / "loop.mat", dict.fromkeys(names, TIME) | {"a": DRIVE, "k": RESPONSE}
    )
    is_the_loop(read(path, time="time", input=0, output=3))


def test_arrays_of_many_axes(tmp_path):
    cube = np.zeros((3, COUNT, 2))
    cube[1, :, 0], cube[2, :, 1] = DRIVE, RESPONSE
    path = tmp_path / "loop.npz"
    np.savez(
        path,
        u_V=cube,
        y_um=cube[:, :, 1].T,
        one=cube[1:2, :, :1],
        wide=np.zeros((4200, 4200), np.int8),
    )
    recording = read(path, input="u_V.1.0", output="y_um.2", rate=200)
    is_the_loop(recording)
    (note,) = recording.warnings
    assert '"u_V.1.0": the samples were taken to run along the longest axis of the shape' in note
    assert "(3, 64, 2)" in note
    is_the_loop(read(path, input="one", output=8, rate=200))
    with pytest.raises(InputError, match=r'"wide": expected real numbers, found an array of shape'):
        read(path, input="wide", output="one")


@pytest.mark.parametrize("transposed", [False, True])
def test_a_matrix_of_numpy_has_no_names(tmp_path, transposed):
    path = tmp_path / "loop.npy"
    matrix = np.c_[TIME, DRIVE, RESPONSE]
    np.save(path, matrix.T if transposed else matrix)
    recording = read(path)
    is_the_loop(recording)
    turned = [
        note for note in recording.warnings if "the longest axis of the shape (3, 64)" in note
    ]
    assert len(turned) == 3 * transposed
    np.save(path, DRIVE)
    assert read_drive(path, rate=200)[1] == 0.005
    with pytest.raises(InputError, match=r"1 column.*; put input and output into one file"):
        read(path, rate=200)


def test_mirror_in_one_file(data_folder, tmp_path):
    folder = data_folder / "fsm_cubespec"
    u, y = (np.load(folder / f"{name}_100mV_test.npy") for name in "uy")
    path = tmp_path / "mirror.npz"
    np.savez(path, u=u, y=y, fs=6400)
    recording = read(path, input="u.1.2.0", output="y.0.2.0", output_unit="m")
    np.testing.assert_array_equal(recording.drive, u[:, 1, 2, 0])
    np.testing.assert_array_equal(recording.response, y[:, 0, 2, 0])
    assert (recording.rate, recording.response_unit) == (6400, "m")
    samples, step, _ = read_drive(folder / "u_100mV_test.npy", input="1.2.0", rate="6.4kHz")
    np.testing.assert_array_equal(samples, u[:, 1, 2, 0])
    assert step == 1 / 6400
    np.testing.assert_array_equal(
        read_drive(folder / "u_100mV_test.npy", input=(1 * 3 + 2) * 2, rate=6400)[0], samples
    )


DAMPER = {"input": "dist", "output": "forc", "input_unit": "mm", "output_unit": "N"}


@pytest.mark.parametrize("name", ["ensaio.A.1", "ensaio.A.3", "ensaio1.2", "ensaio5.2"])
def test_damper(data_folder, name):
    path = data_folder / "mr_damper" / f"{name}.mat"
    recording = read(path, **DAMPER)
    assert recording.dt == 0.01
    assert recording.warnings == (f'{path}: 100 Hz was taken as the rate, from "Ts" of 0.01.',)
    timed = read(path, time="Tout", **DAMPER)
    assert timed.dt == pytest.approx(0.01, rel=1e-12)
    np.testing.assert_array_equal(recording.drive, timed.drive)
    column = read(path, input="x_F.0", output="x_F.2")
    assert 3 < np.ptp(column.drive) < 30
    assert len(column) == len(recording) in (1501, 3001)


def test_damper_with_a_variable_of_another_length(data_folder):
    path = data_folder / "mr_damper" / "ensaio5.2.mat"
    with pytest.raises(InputError, match='found 57 of column "tt" and 3001 of column "forc"'):
        read(path, input="tt", output="forc")


@pytest.mark.parametrize("save", [savemat, matlab_73, lambda path, c: np.savez(path, **c)])
def test_columns_of_unequal_length(tmp_path, save):
    path = tmp_path / ("loop.mat" if save in (savemat, matlab_73) else "loop.npz")
    save(path, {"u_V": DRIVE, "y_um": RESPONSE, "x_um": RESPONSE[:40], "t": TIME[:40]})
    is_the_loop(read(path, rate=200))
    assert len(read(path, input="u_V", output="y_um", rate=200)) == COUNT
    with pytest.raises(InputError, match=r"found 64 of column .u_V. and 40 of column .x_um.;"):
        read(path, output="x_um", input="u_V")
    with pytest.raises(InputError, match=r'"u_V" of 64, .*"x_um" of 40, .*; give --input'):
        read(path, output="x_um")


def test_tdms_channels_units_and_waveforms(tmp_path):
    def channel(name: str, values: np.ndarray, unit: str, **properties) -> ChannelObject:
        return ChannelObject("Position loop", name, values, {"unit_string": unit, **properties})

    path = tmp_path / "loop.tdms"
    voltage = channel("Voltage", DRIVE, "V", wf_increment=0.005)
    group = GroupObject("Position loop", {"fs": 1.0})
    tdms(path, RootObject({"rate": 7}), group, voltage, channel("Position", RESPONSE, "nm"))
    with pytest.raises(InputError, match=r'one rate, found ".*Voltage/wf_increment" of 0.005 and '):
        read(path)
    tdms(path, group, voltage, channel("Position", RESPONSE, "nm", wf_increment=0.005))
    recording = read(path)
    is_the_loop(recording)
    assert (recording.drive_unit, recording.response_unit) == ("V", "nm")
    (note,) = recording.warnings
    assert '200 Hz was taken as the rate, from "Position loop/Voltage/wf_increment" of' in note
    tdms(path, voltage, channel("Position", RESPONSE, "wumpus"), channel("Time", TIME, ""))
    with pytest.raises(InputError, match=r'loop/Position": .*found "wumpus"; give --output-unit'):
        read(path)
    is_the_loop(read(path, output_unit="um", output="Position"))


def test_a_tdms_file_beside_an_outdated_index(tmp_path):
    write(tmp_path / "loop.tdms", LOOP)
    (tmp_path / "loop.tdms_index").write_bytes(b"TDSh and nothing of use")
    is_the_loop(read(tmp_path / "loop.tdms"))


def test_sheets_of_a_workbook(tmp_path):
    table = rows_of(LOOP)
    path = workbook(tmp_path / "loop.xlsx", {"Run 1": [["made by me"], [], *table]})
    is_the_loop(read(path))
    names = [["Time\n[s]", "Voltage (V)", None, "Displacement [um]"]]
    spread = [[*row[:2], None, row[2], "good"] for row in table[1:]]
    is_the_loop(read(workbook(path, {"notes": [["none"]], "Run 1": [*names, *spread]})))
    is_the_loop(read(workbook(path, {"Run 1": table[1:]})))
    is_the_loop(read(workbook(path, {"Run 1": table[1:]}), time=0, input=1, output=2))
    other = [[1.0, 2.0] for _ in range(40)]
    two = workbook(path, {"Run 1": [["t_s", "u_V", "y_um"], *table[1:]], "Run 2": other})
    is_the_loop(read(two))
    is_the_loop(read(two, time="t_s", input="Run 1/u_V", output=2))
    with pytest.raises(InputError, match='"Run 2/B" of 40'):
        read(two, input="absent")


def test_a_sheet_with_a_wrong_extent(tmp_path):
    path = workbook(tmp_path / "loop.xlsx", {"a": rows_of(LOOP)})
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content.replace(b'ref="A1:C65"', b'ref="A1"'))
    is_the_loop(read(path))


def test_parquet_with_all_kinds_of_columns(tmp_path):
    path = tmp_path / "loop.parquet"
    table = {
        "remark": ["good"] * COUNT,
        "when": pyarrow.array(range(COUNT), pyarrow.timestamp("ms")),
        "pair": [{"a": 1}] * COUNT,
        "u.1": DRIVE,
        "y": RESPONSE.astype(np.float32),
        "code": pyarrow.array(range(COUNT), pyarrow.int16()),
    }
    parquet.write_table(pyarrow.table(table), path)
    recording = read(path, rate=200)
    np.testing.assert_array_equal(recording.drive, DRIVE)
    np.testing.assert_array_equal(recording.response, RESPONSE.astype(np.float32))
    for name, fault in (("remark", "text or objects"), ("when", "dates"), ("pair", "text or obj")):
        with pytest.raises(InputError, match=f'"{name}": expected real numbers, found {fault}'):
            read(path, input=name, output="y", rate=200)


# What is refused ----------------------------------------------------------------------------------


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


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> dict[str, bytes]:
    """The standard loop in each binary format."""
    folder = tmp_path_factory.mktemp("sound")
    for suffix in BINARY:
        write(folder / f"loop{suffix}", LOOP)
    savemat(folder / "zipped.mat", {"run": LOOP}, do_compression=True)
    matlab_73(folder / "new.mat", LOOP)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


SOUND = [*(f"loop{suffix}" for suffix in BINARY), "zipped.mat", "new.mat"]


@pytest.mark.parametrize("name", SOUND)
@pytest.mark.parametrize("part", range(12))
def test_files_cut_short(tmp_path, sound, capfd, name, part):
    content = sound[name]
    path = tmp_path / name
    path.write_bytes(content[: max(1, len(content) * part // 12)])
    sentence = refused(path, capfd)
    assert "damaged or cut short" in sentence or part == 0


@pytest.mark.parametrize("name", SOUND)
@pytest.mark.parametrize("seed", range(6))
def test_files_of_junk_behind_a_sound_beginning(tmp_path, sound, capfd, name, seed):
    content = sound[name]
    kept = (0, 16, 128, 300, 600, 900)[seed]
    path = tmp_path / name
    path.write_bytes(content[:kept] + np.random.default_rng(seed).bytes(len(content) - kept))
    refused(path, capfd)


@pytest.mark.parametrize(
    ("at", "byte"),
    [
        (145, 0x08),  # complex, without an imaginary part
        (144, 5),  # sparse, without indices
        (184, 14),  # a matrix for numbers
        (185, 180),  # a type that does not exist
        (128, 9),  # numbers for a variable
        (132, 0),  # an empty variable
    ],
)
def test_mat_files_that_scipy_may_not_survive(tmp_path, sound, capfd, at, byte):
    content = bytearray(sound["loop.mat"])
    content[at] = byte
    (tmp_path / "loop.mat").write_bytes(content)
    assert "damaged or cut short" in refused(tmp_path / "loop.mat", capfd)


@pytest.mark.parametrize("name", SOUND)
@pytest.mark.parametrize("suffix", [".csv", *BINARY])
def test_files_of_a_wrong_suffix(tmp_path, sound, capfd, name, suffix):
    if name.endswith(suffix) or (name, suffix) == ("new.mat", ".h5"):
        return
    path = tmp_path / f"loop{suffix}"
    path.write_bytes(sound[name])
    right = Path(name).suffix
    assert refused(path, capfd).endswith((f"rename it to {right}.", f"name it {right}."))


@pytest.mark.parametrize("suffix", BINARY)
@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "found an empty file; export the recording as CSV"),
        (b"time_s,voltage_V\n0,1\n", "found text; rename it to .txt"),
        (bytes(3000), "export"),
        (b"\x1f\x8b\x08" + bytes(100), "found a gzip archive; unpack it"),
        (b"PK\x03\x04" + bytes(100), "found a ZIP archive; unpack it"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "Excel file of before 2007; save it as .xlsx"),
        (
            b"PK\x03\x04" + bytes(26) + b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet",
            "found an OpenDocument file; save it as .xlsx",
        ),
        (pickle.dumps(LOOP), "export"),
    ],
)
def test_files_of_something_else(tmp_path, capfd, suffix, content, sentence):
    path = tmp_path / f"loop{suffix}"
    path.write_bytes(content)
    assert sentence in refused(path, capfd)


@pytest.mark.parametrize("suffix", _FORMATS)
def test_no_files_at_all(tmp_path, capfd, suffix):
    (tmp_path / f"folder{suffix}").mkdir()
    assert "is a directory; check the path" in refused(tmp_path / f"folder{suffix}", capfd)
    assert "no such file" in refused(tmp_path / f"absent{suffix}", capfd)


def test_spreadsheets_of_other_programs(data_folder, capfd):
    path = data_folder / "mr_damper" / "Ensaios.ods"
    assert "an OpenDocument file); save it as .xlsx" in refused(path, capfd)


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


UNUSABLE = {
    "nan": ({**LOOP, "voltage_V": with_value(DRIVE, np.nan)}, 'voltage_V", sample 16: .* nan;'),
    "inf": ({**LOOP, "displacement_um": with_value(RESPONSE, -np.inf)}, "sample 16: .* -inf;"),
    "overload": ({**LOOP, "voltage_V": with_value(DRIVE, 1e300)}, "sample 16: .* 1e.300;"),
    "time repeated": ({**LOOP, "time_s": with_value(TIME, TIME[15])}, "time to increase, .*0.075"),
    "time backwards": ({**LOOP, "time_s": TIME[::-1].copy()}, "sample 1: .*time to increase"),
    "time with a gap": (
        {**LOOP, "time_s": TIME + 0.3 * (TIME > 0.1)},
        "sample 21: expected a step of 0.005 s, found 0.405 after 0.1; give --resample 200Hz",
    ),
    "time all the same": ({**LOOP, "time_s": 0 * TIME}, "time to increase, found 0 after 0;"),
    "constant": ({**LOOP, "displacement_um": 0 * DRIVE}, "response: expected a signal that varies"),
    "too short": ({n: v[:20] for n, v in LOOP.items()}, "at least 32 samples, found 20;"),
    "no time": (SIGNALS, "a time column or a rate"),
    "one signal": ({"time_s": TIME, "voltage_V": DRIVE}, 'for output, found 2 .*"g?/?time_s"'),
}


@pytest.mark.parametrize("suffix", [".h5", ".mat", ".npz", ".tdms", ".parquet", ".npy", ".xlsx"])
@pytest.mark.parametrize("case", UNUSABLE)
def test_columns_that_cannot_be_used(tmp_path, capfd, suffix, case):
    columns, sentence = UNUSABLE[case]
    path = tmp_path / f"loop{suffix}"
    if suffix == ".xlsx":
        workbook(path, {"a": rows_of(columns)})
        sentence = sentence.replace("sample 21", "cell A23").replace("sample 1:", "cell A3:")
        sentence = sentence.replace('voltage_V", sample 16: .* nan', "cell B18: .* an empty cell")
        sentence = sentence.replace("sample 16: .* -inf", "cell C18: .* found an empty cell")
        sentence = sentence.replace("sample 16: ", "cell B18: ").replace("1e.300", '"1e.300"')
    elif suffix == ".npy":
        write(path, columns)
    else:
        put_arrays(suffix)(path, columns)
    assert re.search(sentence, refused(path, capfd))


FAULTY = {
    "complex": (DRIVE + 1j, "complex numbers"),
    "text": (np.array(["1.0"] * COUNT), "text"),
    "true or false": (DRIVE > 1, "true or false"),
}


@pytest.mark.parametrize("case", FAULTY)
@pytest.mark.parametrize("suffix", [".npz", ".h5", ".parquet", ".tdms"])
def test_columns_of_no_numbers(tmp_path, capfd, suffix, case):
    if (suffix, case) == (".parquet", "complex"):
        return
    values, fault = FAULTY[case]
    path = put_arrays(suffix)(tmp_path / f"loop{suffix}", {**LOOP, "voltage_V": values})
    sentence = refused(path, capfd)
    assert "columns for input, found 3" in sentence
    assert f'voltage_V" ({fault}' in sentence
    sentence = refused(path, capfd, input="voltage_V")
    assert f'voltage_V": expected real numbers, found {fault}' in sentence
    assert sentence.endswith("; give another column as --input.")


@pytest.mark.parametrize("width", [1, 2, 3])
@pytest.mark.parametrize("case", FAULTY)
def test_a_matrix_of_no_numbers(tmp_path, capfd, case, width):
    values, fault = FAULTY[case]
    np.save(tmp_path / "loop.npy", np.column_stack([values] * width))
    sentence = refused(tmp_path / "loop.npy", capfd, rate=200)
    assert fault in sentence or width != 2
    sentence = refused(tmp_path / "loop.npy", capfd, input=0, output=0)
    assert f"column 0: expected real numbers, found {fault}; give another" in sentence


class Trap:
    """What says so when it is unpickled."""

    def __reduce__(self):
        return print, ("unpickled",)


def test_nothing_is_unpickled(tmp_path, capfd):
    pickled = np.array([Trap()] * COUNT, object)
    np.savez(tmp_path / "a.npz", u=pickled, y=RESPONSE, t=TIME)
    assert '"u" of 0 (text or objects)' in refused(tmp_path / "a.npz", capfd)
    np.savez(tmp_path / "b.npz", meta=pickled, **LOOP)
    is_the_loop(read(tmp_path / "b.npz"))
    np.save(tmp_path / "c.npy", pickled)
    assert "text or objects" in refused(tmp_path / "c.npy", capfd, input=0, output=0)
    assert "found 1 column(s)" in refused(tmp_path / "c.npy", capfd, rate=1)


BAD_CELLS = [
    (None, "an empty cell"),
    ("abc", '"abc"'),
    ("1,5", '"1,5"'),
    (True, '"True"'),
    ("#DIV/0!", '"#DIV/0!"'),
    ("two\nlines", '"two lines"'),
    (1e250, '"1e+250"'),
]


@pytest.mark.parametrize(("value", "found"), BAD_CELLS)
def test_the_cell_that_is_no_number(tmp_path, capfd, value, found):
    rows = rows_of(LOOP)
    rows[16][1] = value
    path = workbook(tmp_path / "loop.xlsx", {"Run 1": [[], *rows]})
    sentence = refused(path, capfd)
    assert f'{path}, sheet "Run 1", cell B18: expected a finite number, found {found}; ' in sentence


def test_workbooks_without_a_table(tmp_path, capfd):
    path = tmp_path / "loop.xlsx"
    assert "no number in any sheet" in refused(workbook(path, {"a": [["x"]], "b": []}), capfd)
    short = rows_of(LOOP)
    for row in short[50:]:
        row[2] = None
    assert '"displacement_um" of 49' in refused(workbook(path, {"a": short}), capfd)


@pytest.mark.parametrize("suffix", [".h5", ".mat", ".npz", ".tdms", ".npy"])
def test_files_without_arrays(tmp_path, capfd, suffix):
    path = tmp_path / f"loop{suffix}"
    if suffix == ".npy":
        np.save(path, 1.0)
    else:
        put_arrays(suffix)(path, {"dt": np.array([1.0])})
    assert "expected arrays of samples, found none" in refused(path, capfd)


def test_empty_columns(tmp_path, capfd):
    for suffix in (".h5", ".npz", ".tdms", ".parquet", ".mat"):
        path = tmp_path / f"loop{suffix}"
        put_arrays(suffix)(path, {name: np.zeros(0) for name in LOOP})
        sentence = refused(path, capfd)
        assert "at least 32 samples, found 0" in sentence


def test_names_of_a_hostile_file_stay_on_one_line(tmp_path, capfd):
    path = tmp_path / "loop.h5"
    with h5py.File(path, "w") as file:
        file["u\n\x1b[31mV"] = DRIVE
        file[b"\xff\xfe"] = DRIVE
        file["n" * 500] = DRIVE
        for number in range(40):
            file[f"channel {number}"] = DRIVE
    sentence = refused(path, capfd)
    assert "and 31 more; give" in sentence
    assert len(sentence) < 800


@pytest.mark.parametrize(
    ("suffix", "module"),
    [(".h5", "h5py"), (".parquet", "pyarrow"), (".tdms", "nptdms"), (".xlsx", "openpyxl")],
)
def test_missing_libraries(tmp_path, monkeypatch, suffix, module):
    path = tmp_path / f"loop{suffix}"
    write(path, LOOP)
    monkeypatch.setitem(sys.modules, module, None)
    remedy = rf'no {module}; run pip install "fracjax\[io\]"\.$'
    with pytest.raises(InputError, match=rf"{path}: expected a library that reads .*{remedy}"):
        read(path)
    with pytest.raises(InputError, match=rf"{path}: expected a library that writes .*{remedy}"):
        write(path, LOOP)
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.parametrize(("save", "module"), [(savemat, "pymatreader"), (matlab_73, "h5py")])
def test_missing_libraries_for_mat(tmp_path, monkeypatch, save, module):
    save(tmp_path / "loop.mat", LOOP)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=r'; run pip install "fracjax\[io\]"\.$'):
        read(tmp_path / "loop.mat")


def test_text_needs_no_further_library(tmp_path, monkeypatch):
    for module in ("h5py", "pyarrow", "nptdms", "openpyxl", "pymatreader"):
        monkeypatch.setitem(sys.modules, module, None)
    for suffix in (".csv", ".npz", ".npy"):
        write(tmp_path / f"loop{suffix}", LOOP)
        is_the_loop(read(tmp_path / f"loop{suffix}"))


@settings(max_examples=150)
@given(st.sampled_from(SOUND), st.data())
def test_damaged_files(sound, name, data):
    content = bytearray(sound[name])
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(content) - 1))
        junk = data.draw(st.binary(min_size=1, max_size=8) | st.just(bytes(64)))
        content[at : at + data.draw(st.sampled_from([0, len(junk)]))] = junk
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        try:
            recording = read(path)
        except InputError as error:
            assert str(error).isprintable()
            assert str(error).endswith(".")
        else:
            recording.checks()


# Times --------------------------------------------------------------------------------------------


def timed(path: Path, times: np.ndarray, frequency: float = 1.0) -> Path:
    """A sine and its quarter-period lead over any times [s]."""
    phase = 2 * np.pi * frequency * times
    write(path, {"time_s": times, "voltage_V": np.sin(phase), "displacement_um": np.cos(phase)})
    return path


def test_resampling_follows_the_signal(tmp_path):
    jitter = np.random.default_rng(0).uniform(-0.2, 0.2, 2000)
    times = (np.arange(2000) + jitter) / 200 + 17
    recording = read(timed(tmp_path / "loop.csv", times), resample="200Hz")
    assert recording.rate == 200
    expected = times[0] + recording.times
    assert times[-1] - expected[-1] < 1 / 200
    bound = (2 * np.pi * np.diff(times).max()) ** 2 / 8
    for samples, wave in ((recording.drive, np.sin), (recording.response, np.cos)):
        error = np.abs(samples - wave(2 * np.pi * expected))
        assert error.max() < bound
        assert np.sqrt(np.mean(error**2)) < bound / 8
    (note,) = recording.warnings
    assert "resampled to 200 Hz by monotone cubics; the largest gap bridged is 0.00" in note
    assert "folds down" not in note
    (note,) = read(tmp_path / "loop.csv", resample=50).warnings
    assert "The file has about 200 Hz: what is faster than 25 Hz folds down" in note


def test_resampling_bridges_a_gap_aloud(tmp_path):
    times = np.arange(400) / 200
    path = timed(tmp_path / "loop.h5", times[(times <= 0.5) | (times > 0.8)])
    with pytest.raises(
        InputError, match=r"sample 101: .* 0\.805 after 0\.5; give --resample 200Hz"
    ):
        read(path)
    recording = read(path, resample=200)
    assert len(recording) == 400
    assert (
        "the largest gap bridged is 0.305 s, 0.5 s after the first sample." in recording.warnings[0]
    )
    kept = (times <= 0.5) | (times > 0.81)
    np.testing.assert_allclose(recording.drive[kept], np.sin(2 * np.pi * times[kept]), atol=1e-9)
    inside = recording.drive[101:161]
    assert (np.diff(inside) < 0).all()
    samples, step, _ = read_drive(path, resample="0.2 kHz")
    np.testing.assert_array_equal(samples, recording.drive)
    assert step == 1 / 200


def test_resampling_of_uniform_samples(tmp_path):
    write(tmp_path / "loop.csv", LOOP)
    same = read(tmp_path / "loop.csv", resample=200)
    np.testing.assert_allclose(same.drive, DRIVE, rtol=0, atol=1e-12)
    write(tmp_path / "loop.npz", SIGNALS)
    finer = read(tmp_path / "loop.npz", rate=200, resample=400)
    np.testing.assert_allclose(finer.drive[::2], DRIVE, rtol=0, atol=1e-12)
    assert len(finer) == 2 * COUNT - 1


@settings(max_examples=60)
@given(
    st.lists(st.floats(-1e6, 1e6), min_size=40, max_size=40),
    st.lists(st.floats(1e-6, 1e3), min_size=39, max_size=39),
    st.floats(0.5, 50),
)
def test_resampling_invents_no_swing(values, steps, factor):
    values[0], values[1] = 0.0, 1.0
    times = np.concatenate([[0.0], np.cumsum(steps)])
    rate = factor * 40 / times[-1]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "loop.npz"
        write(path, {"t_s": times, "u_V": np.array(values), "y_um": times})
        try:
            recording = read(path, resample=rate)
        except InputError as error:
            assert "a rate from" in str(error)
            return
    at = np.minimum(recording.times, times[-1])
    np.testing.assert_allclose(recording.response, at, rtol=1e-9, atol=1e-9)
    left = np.clip(np.searchsorted(times, at, side="right") - 1, 0, 38)
    pair = np.sort(np.c_[np.array(values)[left], np.array(values)[left + 1]], axis=1)
    slack = 1e-9 * np.ptp(values)
    assert (recording.drive >= pair[:, 0] - slack).all()
    assert (recording.drive <= pair[:, 1] + slack).all()


@pytest.mark.parametrize(
    ("times", "resample", "sentence"),
    [
        (with_value(TIME, TIME[15]), 200, "expected time to increase, found 0.075 after 0.075;"),
        (TIME[::-1].copy(), 200, "expected time to increase, found 0.31 after 0.315;"),
        (TIME**2, "5um", "--resample: expected a value in Hz"),
        (TIME**2, 0, "--resample: expected a positive rate"),
        (TIME**2, 100, r"--resample: expected a rate from 322 to 6.45e\+04 Hz, found 100 Hz;"),
        (TIME + 3600 * (TIME > 0.1), 200, r"; split the file at its gap of 3600 s\."),
        (TIME**2, 1e9, r"--resample: expected a rate from .*; give one such as 6..\..Hz"),
    ],
)
def test_resampling_refuses(tmp_path, capfd, times, resample, sentence):
    path = tmp_path / "loop.npz"
    write(path, {**LOOP, "time_s": times})
    assert re.search(sentence, refused(path, capfd, resample=resample))


@pytest.mark.parametrize("form", ["{:.4f}", "{:.5g}", "{:.4e}"])
@pytest.mark.parametrize("suffix", _FORMATS)
def test_stamps_that_were_rounded(tmp_path, form, suffix):
    times = np.array([float(form.format(count / 300)) for count in range(2000)])
    path = timed(tmp_path / f"loop{suffix}", times)
    recording = read(path)
    assert recording.dt == pytest.approx(1 / 300, rel=1e-5)
    (note,) = recording.warnings
    assert "its stamps are rounded; a step of 0.00333333" in note
    gap = timed(path, times + (times > 3.001) / 300)
    with pytest.raises(
        InputError, match=r"expected a step of 0\.00333.* s, .*; give --resample 300Hz"
    ):
        read(gap)


def test_stamps_as_text_with_their_zeros(tmp_path):
    path = tmp_path / "loop.csv"
    rows = (f"{n / 300:.4f},{np.sin(n / 9)},{np.cos(n / 9)}" for n in range(900))
    path.write_text("time_s,voltage_V,displacement_um\n" + "\n".join(rows))
    assert read(path).dt == pytest.approx(1 / 300, rel=1e-5)


@pytest.mark.parametrize("start", [0, 40, 3000])
def test_stamps_in_single_precision(tmp_path, start):
    times = (start + np.arange(4000) / 1000).astype(np.float32)
    signal = np.sin(np.arange(4000) / 9)
    path = tmp_path / "loop.npz"
    np.savez(path, t=times, u=signal, y=signal)
    assert read(path).dt == pytest.approx(1e-3, rel=1e-4)


def test_stamps_since_1970(tmp_path):
    times = 1.7e9 + np.arange(4000) / 1e5
    signal = np.sin(np.arange(4000) / 9)
    write(tmp_path / "loop.npz", {"t": times, "u": signal, "y": signal})
    assert read(tmp_path / "loop.npz").dt == pytest.approx(1e-5, rel=1e-3)


@pytest.mark.parametrize("times", [np.arange(64) % 2, np.arange(64) > 62, np.arange(64) > 31])
def test_stamps_that_no_clock_shows(tmp_path, times):
    write(tmp_path / "loop.csv", {**LOOP, "time_s": times.astype(float)})
    for rate in (None, 0.1):
        with pytest.raises(InputError, match=r"expected (time to increase|a step of)"):
            read(tmp_path / "loop.csv", rate=rate)


def test_stamps_rounded_until_they_repeat(tmp_path):
    path = timed(tmp_path / "loop.csv", np.round(np.arange(1000) / 300, 2))
    with pytest.raises(InputError, match=r"line 3,.* 0 after 0; if .*, give --rate 300Hz"):
        read(path)
    assert read(path, rate="300Hz").dt == 1 / 300
    with pytest.raises(InputError, match=r"a step of 0\.01 s by --rate, found 0\.0033"):
        read(path, rate="100Hz")


@settings(max_examples=200)
@given(
    st.floats(0.3, 100),
    st.floats(-500, 500),
    st.integers(32, 300),
    st.integers(0, 6),
    st.integers(1, 298),
)
def test_rounding_explains_what_it_can_and_no_more(step, start, count, places, at):
    """Stamps of any step, in units of their last digit, pass; with one off by two digits, not."""
    digits = np.round(start + step * np.arange(count))
    if (np.diff(digits) <= 0).any():
        return
    times = np.array([float(f"{int(digit)}e-{places}") for digit in digits])
    assert is_time(times)
    digits[at % (count - 2) + 1] += 2
    off = np.array([float(f"{int(digit)}e-{places}") for digit in digits])
    assert is_time(off) == bool(
        (np.abs(np.diff(digits) / np.median(np.diff(digits)) - 1) < 1e-3).all()
    )


# The command line ---------------------------------------------------------------------------------


def test_info_of_a_resampled_recording(tmp_path, capsys):
    path = timed(tmp_path / "loop.tdms", np.cumsum(np.linspace(0.004, 0.006, 1000)))
    assert run(["info", str(path)]) == 2
    assert capsys.readouterr().err.endswith("give --resample 200Hz.\n")
    assert run(["info", str(path), "--resample", "200Hz"]) == 0
    out = capsys.readouterr().out
    assert "1000 at 200 Hz" in out
    assert "Warning: " in out


def test_simulate_knows_the_suffixes(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "")
    write(tmp_path / "loop.npz", LOOP)
    call = ["simulate", str(tmp_path / "loop.npz"), "--model", "creep"]
    assert run([*call, "--out", str(tmp_path / "loop.ods")]) == 2
    assert ": expected one of the suffixes .csv" in capsys.readouterr().err
    assert os.listdir(tmp_path) == ["loop.npz"]


@pytest.mark.parametrize("suffix", [".mat", ".parquet"])
def test_simulate_writes_what_the_suffix_tells(tmp_path, monkeypatch, suffix):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "")
    drive = timed(tmp_path / "loop.h5", np.cumsum(np.linspace(0.004, 0.006, 200)))
    out = tmp_path / f"simulated{suffix}"
    call = ["simulate", str(drive), "--resample", "200Hz", "--model", "creep", "--out", str(out)]
    assert run([*call, "--quiet"]) == 0
    simulated = read(out)
    np.testing.assert_array_equal(simulated.drive, read(drive, resample=200).drive)
    assert (simulated.drive_unit, simulated.response_unit) == ("V", "um")
