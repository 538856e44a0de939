"""TDMS: channels, their units and their clocks."""

import numpy as np
import pytest
from nptdms import ChannelObject, GroupObject, RootObject

from fracjax._io import read, write
from fracjax._recording import InputError
from tests.io.layouts import (
    DRIVE,
    LOOP,
    RESPONSE,
    TIME,
    is_the_loop,
    tdms,
)


def test_tdms_channels_units_and_waveforms(tmp_path):
    def channel(name: str, values: np.ndarray, unit: str, **properties) -> ChannelObject:
        return ChannelObject("Position loop", name, values, {"unit_string": unit, **properties})

    path = tmp_path / "loop.tdms"
    voltage = channel("Voltage", DRIVE, "V", wf_increment=0.005)
    group = GroupObject("Position loop", {"fs": 1.0})
    tdms(path, RootObject({"rate": 7}), group, voltage, channel("Position", RESPONSE, "nm"))
    with pytest.raises(
        InputError, match=r"one rate, found the drive at 200 Hz and the response at 1 Hz;"
    ):
        read(path)
    tdms(path, group, voltage, channel("Position", RESPONSE, "nm", wf_increment=0.005))
    recording = read(path)
    is_the_loop(recording)
    assert (recording.drive_unit, recording.response_unit) == ("V", "nm")
    (note,) = recording.warnings
    assert '200 Hz was taken as the rate, from "Position loop/Voltage/wf_increment" of' in note
    tdms(path, voltage, channel("Position", RESPONSE, "wumpus"), channel("Time", TIME, ""))
    with pytest.raises(
        InputError, match=r'loop/Position": .*found "wumpus"; give --unit response=um'
    ):
        read(path)
    is_the_loop(read(path, output_unit="um", output="Position"))


def test_a_tdms_file_beside_an_outdated_index(tmp_path):
    write(tmp_path / "loop.tdms", LOOP)
    (tmp_path / "loop.tdms_index").write_bytes(b"TDSh and nothing of use")
    is_the_loop(read(tmp_path / "loop.tdms"))


@pytest.mark.parametrize(
    "properties",
    [{"time_unit": "min", "u_unit": "kV", "y_unit": "nm"}, {"units": '["min", "kV", "nm"]'}],
)
def test_units_among_the_properties_of_the_file(tmp_path, properties):
    channels = [
        ChannelObject("run", name, values)
        for name, values in (("time", TIME / 60), ("u", DRIVE), ("y", RESPONSE))
    ]
    path = tmp_path / "loop.tdms"
    tdms(path, RootObject(properties), *channels)
    recording = read(path)
    assert recording.rate == pytest.approx(200, rel=1e-6)
    assert (recording.drive_unit, recording.response_unit) == ("kV", "nm")
