"""Layouts of instruments in which what a file says is easily overlooked: a factor, a number of
averaged samples, a unit in capitals, in a list, in a format, or in a file beside it."""

import json
import shlex
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from openpyxl.comments import Comment

from fracjax._cli import run
from fracjax._io import read, read_segments
from fracjax._recording import InputError, conversion

COUNT = 64
PHASE = 2 * np.pi * np.arange(COUNT) / 21
DRIVE = np.round(50 - 50 * np.cos(PHASE), 2)
"""[V]"""
RESPONSE = np.round(6 - 6 * np.cos(PHASE - 0.15), 2)
"""[um]"""
TIME = np.round(0.002 * np.arange(COUNT), 3)
"""[s]"""
TICKS = 2 * np.arange(COUNT)
"""[ms]"""


def rows(*columns, separator: str = ",") -> str:
    return "".join(separator.join(map(str, row)) + "\n" for row in zip(*columns, strict=True))


def is_the_loop(path: Path, units: tuple[str, str] = ("V", "um"), **options) -> None:
    """Assert rate, units and numbers, converted where the file has others of their kind."""
    recording = read(path, **options)
    assert recording.rate == pytest.approx(500, rel=1e-6)
    for written, values, truth, unit in (
        (recording.drive_unit, recording.drive, DRIVE, units[0]),
        (recording.response_unit, recording.response, RESPONSE, units[1]),
    ):
        scale = conversion(written, unit)
        assert scale is not None
        np.testing.assert_allclose(scale * values, truth, rtol=1e-9, atol=1e-9)


@pytest.fixture
def put(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(text: str, name: str = "loop.csv") -> Path:
        Path(name).write_text(text, encoding="utf-8")
        return Path(name)

    return write


@pytest.mark.parametrize(
    "text",
    [
        "t [2 ms],U [V],x [um]\n" + rows(np.arange(COUNT), DRIVE, RESPONSE),
        "time (10^-3 s),U (10^2 V),x (×10^-6 m)\n" + rows(TICKS, DRIVE / 100, RESPONSE),
        "t (1/500 s),U [V],position [1/100 mm]\n" + rows(np.arange(COUNT), DRIVE, RESPONSE / 10),
        "time_s,drive [0.01 V/LSB],position (1 ct = 5 nm)\n"
        + rows(TIME, np.round(100 * DRIVE), np.round(200 * RESPONSE)),
        "time_s,drive_V,displacement [mil]\n" + rows(TIME, DRIVE, RESPONSE / 25.4),
        "$t$ [ms],$V_0$ [V],$x$ [$\\mu$m]\n" + rows(TICKS, DRIVE, RESPONSE),
        "TIME(MS),VOLTAGE(KV),DISP(UM)\n" + rows(TICKS, DRIVE / 1e3, RESPONSE),
        "TIME_MS,VOLTAGE_KV,DISPLACEMENT_NM\n" + rows(TICKS, DRIVE / 1e3, 1e3 * RESPONSE),
        "Interval=\t2 ms\nChannelTitle=\tDrive\tStage\nUnitName=\tV\tum\n"
        + rows(TIME, DRIVE, RESPONSE, separator="\t"),
        "T0 = 2 Jan\nt 1\tU\tWeg\nAbtastrate: 500 Hz\tAbtastrate: 500 Hz\tAbtastrate: 500 Hz\n"
        "s\tV\tum\n" + rows(TIME, DRIVE, RESPONSE, separator="\t"),
        "time,drive,position\n" + rows(TICKS, DRIVE, RESPONSE) + "# units: ms, V, um\n",
    ],
)
def test_units_with_numbers_in_capitals_and_below_the_table(put, text):
    is_the_loop(put(text))


PLAIN = "drive_V,position_um\n" + rows(DRIVE, RESPONSE)
TIMED = rows(TICKS, DRIVE, RESPONSE)


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        ("# Sample rate: 5 kHz\n# Decimation: 10\n" + PLAIN, "--rate 500Hz"),
        ("dt = 2\ntime unit = ms\n" + PLAIN, "--rate 500Hz"),
        ("rate: 0.5\nunit: kHz\n" + PLAIN, "--rate 500Hz"),
        ("# sampling clock 500 Hz\nsample,drive_V,x_um\n" + TIMED, "--rate 500Hz"),
        ("# 1: time/ms\n# 2: U/V\n" + TIMED, "--clock ms"),
        ("times are milliseconds\ntime,drive_V,x_um\n" + TIMED, "--clock milliseconds"),
        ("TimeScale,0.001\ntime,drive_V,x_um\n" + TIMED, "--clock ms"),
        ("time (ms/div 10),drive_V,x_um\n" + TIMED, "--clock ms"),
        ("time*1000 (s),drive_V,x_um\n" + TIMED, "--clock ms"),
        ("time (mS),drive_V,x_um\n" + TIMED, "--clock ms"),
        ("t [Ms],drive_V,x_um\n" + TIMED, "--clock ms"),
        ("TIME_MS,VOLTAGE_MV,DISP_UM\n" + TIMED, "--unit drive=mV"),
        ("dt_ms,drive_V,x_um\n" + rows([2] * COUNT, DRIVE, RESPONSE), "--rate 500Hz"),
        ("time_ms,V,V\n" + TIMED, "--input 1"),
        (
            "time_ms,command_V,monitor_V,x_um\n" + rows(TICKS, DRIVE, DRIVE, RESPONSE),
            "--input command_V",
        ),
        (
            "Name\tu\tName\tx\nUnit\tV\tUnit\tum\nScale factor\t0.01\tScale factor\t0.1\n"
            + rows(TICKS, np.round(100 * DRIVE), TICKS, np.round(10 * RESPONSE), separator="\t"),
            '--scale "drive=counts*0.01 V"',
        ),
    ],
)
def test_what_was_overlooked_stops_with_what_settles_it(put, text, remedy, capsys):
    path = put(text)
    assert run(["info", str(path), "--quiet"]) == 2
    printed = capsys.readouterr().err
    assert remedy in printed
    # It settles that question; others may stay.
    run(["info", str(path), *shlex.split(remedy)])
    assert capsys.readouterr().err != printed


def test_torque_is_no_length_and_grams_no_acceleration(put):
    recording = read(put("time_s,current_A,torque [Nm]\n" + rows(TIME, DRIVE, RESPONSE)))
    assert conversion(recording.response_unit, "N*m") == 1
    assert conversion(recording.response_unit, "nm") is None
    path = put("time_s,drive_V,accel [g]\n" + rows(TIME, DRIVE, RESPONSE))
    with pytest.raises(InputError, match=r"--unit response=m/s\*\*2"):
        read(path)


@pytest.mark.parametrize(
    "line", ["monitor ratio 1:20", "sensor polarity: inverted", "all values in SI units"]
)
def test_factors_and_signs_that_were_not_used_are_listed(put, line):
    path = put(f"# {line}\ntime_s,drive_V,x_um\n" + rows(TIME, DRIVE, RESPONSE))
    assert read_segments(path)[0].unused == (f"loop.csv, line 1: {line}",)


def test_a_file_beside_it_may_speak_of_its_units(put, capsys):
    path = put("t,u,y\n" + TIMED)
    put(json.dumps({"columns": [{"name": "t", "unit": "ms"}]}), "loop.csv-metadata.json")
    with pytest.raises(InputError, match=r"in loop.csv-metadata.json; give --clock ms"):
        read(path)
    run(["info", "loop.csv", "--clock", "ms", "--input", "u", "--output", "y", "--json"])
    put(capsys.readouterr().out, "loop.csv.json")
    unused = read_segments(path, time_unit="ms", input="u", output="y")[0].unused
    assert [said.startswith("loop.csv, loop.csv-metadata.json: ") for said in unused] == [True]


UNITS = np.array(["kV", "um"])
MATRIX = np.stack([DRIVE / 1e3, RESPONSE], axis=1)


@pytest.mark.parametrize(
    "arrays",
    [
        {"data": MATRIX, "names": np.array(["drive", "position"]), "units": UNITS, "fs": 500.0},
        {"data": MATRIX, "units": UNITS, "dt": 2.0, "dt_unit": "ms"},
        {"u": MATRIX[:, 0], "y": MATRIX[:, 1], "units": UNITS, "fs": 500.0},
        {
            "u": MATRIX[:, 0],
            "y": MATRIX[:, 1],
            "meta": json.dumps({"sample_rate_khz": 0.5, "u_unit": "kV", "y_unit": "um"}),
        },
        {
            "u": MATRIX[:, 0],
            "y": MATRIX[:, 1],
            "meta": json.dumps(
                {
                    "sample_rate": {"value": 0.5, "unit": "kHz"},
                    "channels": [{"name": "u", "unit": "kV"}, {"name": "y", "unit": "um"}],
                }
            ),
        },
    ],
)
def test_lists_of_units_speak_of_the_columns_of_a_matrix(tmp_path, arrays):
    np.savez(tmp_path / "loop.npz", **arrays)
    is_the_loop(tmp_path / "loop.npz")


def test_a_rate_of_another_device_is_not_taken(tmp_path):
    info = json.dumps({"generator": {"sample_rate": 50000}})
    np.savez(tmp_path / "loop.npz", drive=DRIVE, position=RESPONSE, info=info)
    with pytest.raises(InputError, match="expected a time column or a rate"):
        read(tmp_path / "loop.npz")


def test_formats_comments_and_sheets_of_a_workbook(tmp_path):
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    for row in (["time", "drive", "position"], *np.stack([TICKS, DRIVE, RESPONSE], 1).tolist()):
        sheet.append(row)
    book.create_sheet("notes").append(["time in", "ms"])
    sheet["B1"].comment = Comment("in V", "lab")
    path = tmp_path / "loop.xlsx"
    book.save(path)
    with pytest.raises(InputError, match=r'in sheet "notes", row 1; give --clock ms'):
        read(path)
    assert any("in V" in said for said in read_segments(path, time_unit="ms")[0].unused)
    for column, unit in enumerate(("ms", "V", "um"), 1):
        sheet.cell(2, column).number_format = f'0.000" {unit}"'
    book.save(path)
    is_the_loop(path)


def test_columns_of_names_that_say_nothing(put):
    path = put("a;b;c\n" + rows(TIME, DRIVE, RESPONSE, separator=";"))
    with pytest.raises(InputError, match="give --time a and --input b and --output c, or --time a"):
        read(path)
    is_the_loop(
        path, time="a", input="b", output="c", time_unit="s", input_unit="V", output_unit="um"
    )


def test_a_tdm_file_is_named_with_the_way_to_one_that_is_read(put):
    path = put('<?xml version="1.0"?>\n<usi:tdm version="1.0">\n</usi:tdm>\n', "loop.tdm")
    with pytest.raises(InputError, match=r"a TDM file, .*save it as \.tdms in DIAdem"):
        read(path)
