"""HDF5, MAT and NumPy: arrays by path, and what stands beside them."""

from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from fracjax._io import read, read_drive
from fracjax._recording import InputError
from tests.io.layouts import (
    COUNT,
    DRIVE,
    RESPONSE,
    SIGNALS,
    TIME,
    is_the_loop,
    matlab_73,
)


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
    recording = read(path, time_unit="s")
    np.testing.assert_array_equal(recording.drive, DRIVE)
    np.testing.assert_array_equal(recording.response, RESPONSE.astype(np.float32))
    assert (recording.drive_unit, recording.response_unit) == ("kV", "nm")
    assert recording.dt == pytest.approx(5.0)
    columns: dict[str, Any] = {"time": "log/t", "input": "drive", "output": "input/run 1/position"}
    with pytest.raises(InputError, match=r'a step of 1 s, as "dt" says, found 5 in a unit that is'):
        read(path, **columns)
    told = read(path, **columns, input_unit="V", time_unit="s")
    np.testing.assert_allclose(told.drive, 1000 * DRIVE)
    assert any("converted from kV to V as given." in warning for warning in told.warnings)


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
    with pytest.raises(
        InputError, match=r"one rate, found the drive at 0.2 Hz and the response at"
    ):
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
    with pytest.raises(
        InputError, match=r'one column for output, found "run1/x\.0" .*, "run1/x\.1"'
    ):
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


DAMPER: dict[str, Any] = {"input": "dist", "output": "forc", "input_unit": "mm", "output_unit": "N"}


@pytest.mark.parametrize("name", ["ensaio.A.1", "ensaio.A.3", "ensaio1.2", "ensaio5.2"])
def test_damper(data_folder, name):
    path = data_folder / "mr_damper" / f"{name}.mat"
    recording = read(path, **DAMPER)
    assert recording.dt == 0.01
    assert recording.warnings == ()
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
