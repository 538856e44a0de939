"""Structures that programs save: labels, units, clocks and scales beside the samples."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from scipy.io import netcdf_file, savemat

from fracjax._io import read
from fracjax._io._mat import _check
from fracjax._recording import InputError, Recording
from tests.io.layouts import COUNT, DRIVE, RESPONSE, TIME, workbook

BEGIN = np.datetime64("2024-02-13T10:21:05")


def is_the_loop(recording: Recording, units: tuple[str, str] = ("V", "um")) -> None:
    np.testing.assert_allclose(recording.drive, DRIVE, rtol=0, atol=1e-9)
    np.testing.assert_allclose(recording.response, RESPONSE, rtol=0, atol=1e-9)
    assert recording.dt == pytest.approx(0.005, rel=1e-9)
    assert (recording.drive_unit, recording.response_unit) == units


def structures(*elements: dict) -> np.ndarray:
    """An array of structures, as MATLAB has it."""
    found = np.empty(len(elements), [(name, object) for name in elements[0]])
    for at, element in enumerate(elements):
        found[at] = tuple(element.values())
    return found


LABELS = ({"values": DRIVE, "label": "Voltage [V]"}, {"values": RESPONSE, "label": "Position [um]"})
CHANNELS = (
    {"Name": '"Model Root"/"DAC_Voltage"', "Data": DRIVE, "Unit": "V"},
    {"Name": '"Model Root"/"Sensor_Position"', "Data": RESPONSE, "Unit": "um"},
)
STRUCTURES = {
    "structure with time": {"Scope": {"time": TIME, "signals": structures(*LABELS)}, "dt": 0.005},
    "X and Y": {
        "e1": {"X": {"Name": "Host", "Data": TIME, "Unit": "s"}, "Y": structures(*CHANNELS)}
    },
    "input and output data": {
        "data": {
            "InputData": DRIVE,
            "OutputData": RESPONSE,
            "InputUnit": "V",
            "OutputUnit": "um",
            "Ts": 0.005,
        }
    },
    "series with times of their own": {
        "out": {
            "voltage": {"Time": TIME, "Data": DRIVE, "Units": "V"},
            "position": {"Time": TIME, "Data": RESPONSE, "Units": "um"},
        },
        "Ts": 0.005,
    },
    "interval of a scope": {"voltage_V": DRIVE, "position_um": RESPONSE, "Tinterval": 0.005},
}


@pytest.mark.parametrize("name", STRUCTURES)
def test_structures_of_matlab(tmp_path, name):
    path = tmp_path / "loop.mat"
    savemat(path, STRUCTURES[name])
    is_the_loop(read(path))


def test_a_to_file_matrix_begins_with_the_times(tmp_path):
    path = tmp_path / "loop.mat"
    savemat(path, {"ans": np.stack([TIME, DRIVE, RESPONSE])})
    is_the_loop(read(path, input_unit="V", output_unit="um"))


def test_objects_of_matlab_73_are_named_with_the_remedy(tmp_path):
    path = tmp_path / "loop.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        data = file.create_dataset("voltage", data=np.zeros((1, 6), np.uint32))
        data.attrs["MATLAB_class"] = np.bytes_("timeseries")
        data.attrs["MATLAB_object_decode"] = np.int32(3)
    content = bytearray(path.read_bytes())
    content[:128] = b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM"
    path.write_bytes(content)
    with pytest.raises(
        InputError, match=r"a MATLAB object \(timeseries\).*t = voltage.Time; y = voltage.Data"
    ):
        read(path)


def test_objects_of_matlab_5_are_known(tmp_path):
    def element(code: int, data: bytes) -> bytes:
        return (
            code.to_bytes(4, "little")
            + len(data).to_bytes(4, "little")
            + data
            + bytes(-len(data) % 8)
        )

    inside = element(6, (17).to_bytes(8, "little"))
    inside += b"".join(element(1, text) for text in (b"voltage", b"MCOS", b"timeseries"))
    path = tmp_path / "loop.mat"
    savemat(path, {"u": DRIVE})
    path.write_bytes(path.read_bytes()[:128] + element(14, inside))
    assert _check(str(path)) == {"voltage": "timeseries"}


@pytest.mark.parametrize("suffix", [".h5", ".nc"])
def test_scales_and_offsets_of_netcdf(tmp_path, suffix):
    """CF conventions, 8.1: unpacked = packed · scale_factor + add_offset."""
    path = tmp_path / f"loop{suffix}"
    packed = {"voltage": (DRIVE, 1e-4, 1.0, "V"), "position": (RESPONSE, 5e-3, -100.0, "um")}
    codes = {
        name: np.round((values - offset) / scale).astype(np.int16)
        for name, (values, scale, offset, _) in packed.items()
    }
    codes["position"][3] = -32768
    if suffix == ".h5":
        with h5py.File(path, "w") as file:
            for name, (_, scale, offset, unit) in packed.items():
                data = file.create_dataset(name, data=codes[name])
                told = {"scale_factor": scale, "add_offset": offset, "units": unit}
                data.attrs.update(told | {"_FillValue": np.int16(-32768)})
            file.attrs["sampling_frequency"] = 200.0
    else:
        with netcdf_file(path, "w") as file:
            file.createDimension("n", COUNT)
            for name, (_, scale, offset, unit) in packed.items():
                data = file.createVariable(name, "i2", ("n",))
                data[:] = codes[name]
                data.scale_factor, data.add_offset, data.units = scale, offset, unit
                data._FillValue = np.int16(-32768)
            file.sampling_frequency = 200.0
    with pytest.raises(InputError, match="sample 3: expected a number, found -32768"):
        read(path)
    recording = read(path, mask="bad")
    assert recording.masked is not None
    kept = ~recording.masked
    assert list(np.flatnonzero(~kept)) == [3]
    np.testing.assert_allclose(recording.drive, DRIVE, atol=5e-5)
    np.testing.assert_allclose(recording.response[kept], RESPONSE[kept], atol=2.5e-3)
    assert (recording.drive_unit, recording.response_unit, recording.rate) == ("V", "um", 200)


def test_a_factor_that_may_not_be_in_the_numbers_is_told(tmp_path):
    path = tmp_path / "loop.h5"
    with h5py.File(path, "w") as file:
        file["voltage_V"], file["position_um"] = DRIVE, RESPONSE
        file["voltage_V"].attrs["gain"] = 20.0
        file.attrs["SampleRate [Hz]"] = 200.0
    assert any('"voltage_V/gain" of 20 was not applied' in w for w in read(path).warnings)


def channel(name: str, values: np.ndarray, unit: str, **told: object) -> ChannelObject:
    return ChannelObject("Log", name, values, {"unit_string": unit, **told})


def tdms(path: Path, *channels: ChannelObject) -> Path:
    with TdmsWriter(str(path)) as file:
        file.write_segment(list(channels))
    return path


@pytest.mark.parametrize("late", ["wf_start_time", "wf_start_offset"])
def test_channels_of_tdms_are_aligned_by_their_starts(tmp_path, late):
    starts = {"wf_start_time": BEGIN, "wf_start_offset": 0.0}
    moved = starts | {late: BEGIN + np.timedelta64(20, "ms") if late == "wf_start_time" else 0.02}
    path = tdms(
        tmp_path / "loop.tdms",
        channel("Voltage", DRIVE[4:], "V", wf_increment=0.005, **moved),
        channel("Position", RESPONSE, "um", wf_increment=0.005, **starts),
    )
    recording = read(path)
    np.testing.assert_array_equal(recording.drive, DRIVE[4:])
    np.testing.assert_array_equal(recording.response, RESPONSE[4:])
    assert "the drive begins 0.02 s after the response" in recording.warnings[-1]


def test_channels_of_tdms_between_each_others_samples_are_not_aligned(tmp_path):
    later = BEGIN + np.timedelta64(2, "ms")
    path = tdms(
        tmp_path / "loop.tdms",
        channel("Voltage", DRIVE, "V", wf_increment=0.005, wf_start_time=BEGIN),
        channel("Position", RESPONSE, "um", wf_increment=0.005, wf_start_time=later),
    )
    with pytest.raises(
        InputError, match=r"the response 0.002 s after the drive; give --resample 200Hz"
    ):
        read(path)


def test_channels_of_dates_are_times(tmp_path):
    stamps = BEGIN + (1e6 * TIME).astype("timedelta64[us]")
    path = tdms(
        tmp_path / "loop.tdms",
        ChannelObject("Log", "Time", stamps),
        channel("Voltage", DRIVE, "V"),
        channel("Position", RESPONSE, "um"),
    )
    is_the_loop(read(path))
    with pytest.raises(InputError, match='"Log/Time": expected real numbers, found dates'):
        read(path, input="Time")


def test_sheets_with_units_dates_and_numbers_as_text(tmp_path):
    path = tmp_path / "loop.xlsx"
    rows = [list(row) for row in zip(TIME.tolist(), DRIVE.tolist(), RESPONSE.tolist(), strict=True)]
    head = [["Stage, 13.02.2024"], [], ["Time", "Voltage", "Displacement"], ["s", "V", "um"]]
    is_the_loop(read(workbook(path, {"a": head + rows})))
    moments = [(BEGIN + np.timedelta64(int(5000 * k), "us")).astype(object) for k in range(COUNT)]
    dated = [[moment, *row[1:]] for moment, row in zip(moments, rows, strict=True)]
    is_the_loop(read(workbook(path, {"a": [["Time", "Voltage (V)", "y (um)"], *dated]})))
    texts = [[f"{cell:.9f}".replace(".", ",") for cell in row] for row in rows]
    recording = read(workbook(path, {"a": [["t [s]", "u [V]", "y [um]"], *texts]}))
    is_the_loop(recording)
    assert sum("its numbers are stored as text" in warning for warning in recording.warnings) == 3
