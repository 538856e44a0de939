"""The layouts in which instruments and labs write text: each is read whole, or refused."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fracjax._io import read, read_segments
from fracjax._recording import InputError, Recording
from tests.io.layouts import COUNT, DRIVE, RESPONSE, TIME

Put = Callable[..., Path]


@pytest.fixture
def put(tmp_path) -> Put:
    """Write text in an encoding and give its path."""

    def write(text: str, name: str = "loop.csv", encoding: str = "utf-8") -> Path:
        path = tmp_path / name
        path.write_bytes(text.encode(encoding))
        return path

    return write


def rows(
    *columns: np.ndarray | list[str],
    separator: str = ",",
    comma: bool = False,
    end: str = "",
    start: str = "",
) -> str:
    """Columns as rows; numbers as short as they are exact, with decimal commas on request."""

    def cell(value: object) -> str:
        text = value if isinstance(value, str) else f"{value:.9g}"
        return text.replace(".", ",") if comma else text

    lines = (separator.join(map(cell, row)) for row in zip(*columns, strict=True))
    return "".join(f"{start}{line}{end}\n" for line in lines)


def is_the_loop(recording: Recording, units: tuple[str, str] = ("V", "um")) -> None:
    np.testing.assert_allclose(recording.drive, DRIVE, rtol=0, atol=1e-8)
    np.testing.assert_allclose(recording.response, RESPONSE, rtol=0, atol=1e-6)
    assert recording.dt == pytest.approx(0.005, rel=1e-6)
    assert (recording.drive_unit, recording.response_unit) == units


LOOP = (TIME, DRIVE, RESPONSE)
COUNTED = [str(k) for k in range(COUNT)]
CLOCK = [f"10:21:{58 + k / 200:06.3f}" for k in range(COUNT)]
DAYS = [f"{739295.4 + t / 86400:.10f}" for t in TIME]
STAMPS = [f"13.02.2024 {clock}" for clock in CLOCK]

LABVIEW = (
    "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\n***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\nSamples\t64\t64\t\nTime\t10:21:05\t10:21:05\t\nY_Unit_Label\tV\tum\t\n"
    "X_Dimension\tTime\tTime\t\nDelta_X\t0.005\t0.005\t\n***End_of_Header***\t\t\t\n"
    "X_Value\tVoltage\tDisplacement\tComment\n"
)
TABLES = {
    "labview": (LABVIEW + rows(*LOOP, separator="\t"), {}),
    "labview without times": (
        LABVIEW + rows(DRIVE, RESPONSE, separator="\t", start="\t"),
        {},
    ),
    "names and units in rows": (
        "x-axis,1,2\nsecond,V,um\n" + rows(*LOOP),
        {"input": "1", "output": "2"},
    ),
    "units in brackets below": (
        "Time,Channel A,Channel B\n(ms),(V),(um)\n\n" + rows(1000 * TIME, DRIVE, RESPONSE),
        {"input": "Channel A", "output": "Channel B"},
    ),
    "scope with a preamble": (
        "Record Length,Analog:64\nSample Interval,Analog:0.005\nVertical Units,CH1:V CH2:um\n"
        "Horizontal Units,s\nModel,X\nSource,CH1,CH2\nSecond,V,um\n" + rows(*LOOP),
        {"input": 1, "output": 2},
    ),
    "start and increment beside the names": (
        "X,CH1,CH2,Start,Increment,\nSequence,V,um,-0.5,5e-3\n"
        + rows(COUNTED, DRIVE, RESPONSE, end=","),
        {"input": "CH1", "output": "CH2"},
    ),
    "keys with numbers of channels": (
        "# REM recorder\n# SEPARATOR = 32\n# SAMPLE_TIME = 0.005\n# NAME0 = Control Voltage\n"
        "# NAME1 = Actual Position\n# UNIT0 = V\n# UNIT1 = um\n# END_HEADER\n"
        + rows(DRIVE, RESPONSE, separator=" ", end=" "),
        {},
    ),
    "names above a line of types": (
        "Zeit;Spannung;Weg\ns;V;um\nDBL;DBL;DBL\n" + rows(*LOOP, separator=";", comma=True),
        {},
    ),
    "long names, units, comments": (
        "Time\tVoltage\tDisplacement\ns\tV\tum\n\tmonitor\tsensor\n" + rows(*LOOP, separator="\t"),
        {},
    ),
    "units behind in": ("t in s;U in V;s in um\n" + rows(*LOOP, separator=";", comma=True), {}),
    "separator told": ("sep=;\nZeit [s];U [V];Weg [um]\n" + rows(*LOOP, separator=";"), {}),
    "keys and values": (
        "Date: 2024-02-13\nOperator: lab\nGain: 15\n\ntime_s,voltage_V,displacement_um\n"
        + rows(*LOOP),
        {},
    ),
    "rate in the preamble": (
        "Abtastrate;200,0;Hz\nSpannung [V];Weg [um]\n"
        + rows(DRIVE, RESPONSE, separator=";", comma=True),
        {},
    ),
    "trace names and units above nameless columns": (
        '"Model","DL850"\n"TraceName","CH1","CH2"\n"VUnit","V","um"\n"SampleRate",200,200\n'
        '"HUnit","s","s"\n\n' + rows(DRIVE, RESPONSE),
        {},
    ),
    "clock times": ("Time,Voltage (V),Displacement (um)\n" + rows(CLOCK, DRIVE, RESPONSE), {}),
    "dates": (
        "Zeitstempel;Spannung [V];Weg [um]\n" + rows(STAMPS, DRIVE, RESPONSE, separator=";"),
        {},
    ),
    "date and clock in columns of their own": (
        "Date,Time,Voltage (V),Displacement (um)\n"
        + rows(["13/02/2024"] * COUNT, CLOCK, DRIVE, RESPONSE),
        {},
    ),
    "whole seconds beside an interval": (
        'Sampling interval,"5ms"\nNumber,Date&Time,ms,CH1,CH2,Alarm\nNO.,Time,ms,V,um,A1\n'
        + rows(
            [str(k + 1) for k in range(COUNT)],
            ["2024-02-13 10:21:05"] * COUNT,
            [str(5 * k) for k in range(COUNT)],
            DRIVE,
            RESPONSE,
            ["LLLL"] * COUNT,
        ),
        {},
    ),
    "counted samples": (
        "Sample,Voltage (V),Position (um)\n" + rows(COUNTED, DRIVE, RESPONSE),
        {"rate": 200},
    ),
    "units in cells": (
        "time,voltage,displacement\n"
        + rows(
            [f"{t:.4f} s" for t in TIME],
            [f"{u:.9f} V" if u > 1 else f"{1e3 * u:.9f} mV" for u in DRIVE],
            [f"{y:.9f} um" for y in RESPONSE],
        ),
        {},
    ),
    "fortran": (
        "time_s voltage_V displacement_um\n"
        + rows(
            *([f" {x:.10E}".replace("E", "D") for x in column] for column in LOOP), separator=" "
        ),
        {},
    ),
    "decimal commas in quotes": (
        '"t [s]","u [V]","y [um]"\n'
        + rows(*([f'"{x:.9g}"'.replace(".", ",") for x in column] for column in LOOP)),
        {},
    ),
    "markdown": (
        "| time_s | voltage_V | displacement_um |\n|---|---|---|\n"
        + rows(*LOOP, separator=" | ", start="| ", end=" |"),
        {},
    ),
    "padding and a footer": (
        "time_s,voltage_V,displacement_um\n" + rows(*LOOP) + ",,\n,,\n\nEnd of data\n",
        {},
    ),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_are_found(put, name):
    text, options = TABLES[name]
    recording = read(put(text), **options)
    is_the_loop(recording)
    assert not any("assumed" in warning for warning in recording.warnings)


@pytest.mark.parametrize(
    ("names", "encoding"),
    [
        (("时间(s)", "电压(V)", "位移(um)"), "gb18030"),
        (("时间（秒）", "电压（伏）", "位移（微米）"), "gb18030"),
        (("時間[s]", "電圧[V]", "変位[um]"), "shift_jis"),
        (("시간(s)", "전압(V)", "변위(um)"), "euc_kr"),
        (("時間(s)", "電壓(V)", "位移(um)"), "big5"),
        (("Время, с", "Напряжение, В", "Перемещение, мкм"), "cp1251"),
        (("Temps (s)", "Tension (V)", "Déplacement (um)"), "cp1252"),
        (("Zeit [s]", "Spannung [V]", "Weg [um]"), "utf-16-le"),
    ],
)
def test_languages_and_encodings(put, names, encoding):
    is_the_loop(read(put(";".join(names) + "\n" + rows(*LOOP, separator=";"), encoding=encoding)))


@pytest.mark.parametrize(
    ("mark", "group", "separator"),
    [(",", ".", ";"), (".", ",", ";"), (".", "'", ";"), (",", " ", ";")],
)
def test_thousands(put, mark, group, separator):
    def cell(value: float) -> str:
        return f"{value:,.3f}".replace(",", "g").replace(".", mark).replace("g", group)

    columns = [[cell(x) for x in 1000 * column] for column in LOOP]
    recording = read(put("t [ms];u [mV];y [nm]\n" + rows(*columns, separator=separator)))
    np.testing.assert_allclose(recording.response, 1000 * RESPONSE, atol=1e-3)
    np.testing.assert_allclose(recording.drive, 1000 * DRIVE, atol=1e-3)


def test_a_scope_writes_a_file_for_each_channel(put):
    left = [
        "Record Length,64,",
        "Sample Interval,5e-3,",
        "Vertical Units,{},",
        "Horizontal Units,s,",
    ]
    left += [",,"] * (COUNT - len(left))

    def channel(values: np.ndarray, unit: str) -> str:
        pairs = zip(left, rows(TIME, values).splitlines(), strict=True)
        return "".join(f"{beside.format(unit)},{row},\n" for beside, row in pairs)

    drive, response = put(channel(DRIVE, "V"), "1.csv"), put(channel(RESPONSE, "um"), "2.csv")
    with pytest.raises(
        InputError, match=r"found one signal \(column 4\) beside its time .*--drive"
    ):
        read(drive)
    is_the_loop(read(drive, response=response))


@pytest.mark.parametrize(
    ("text", "options", "sentence"),
    [
        ("Zeit;Spannung;Weg\ns;V;Skt\n" + rows(*LOOP, separator=";"), {}, 'found "Skt"'),
        ("t,u (V),y (um)\n" + rows(COUNTED, DRIVE, RESPONSE), {}, "whole numbers 1 apart"),
        (rows(COUNTED, DRIVE, RESPONSE), {}, "whole numbers 1 apart"),
        (
            "t,u (V),y (um)\n"
            + rows([f"{739295.4 + t / 86400:.10f}" for t in TIME], DRIVE, RESPONSE),
            {},
            "may be days",
        ),
        ("Sample,u (V),y (um)\n" + rows(COUNTED, DRIVE, RESPONSE), {}, "a time column or a rate"),
        (
            "Sample Interval,0.005\nTime,u (V),y (um)\n" + rows(1000 * TIME + 0.1, DRIVE, RESPONSE),
            {},
            'a step of 0.005 s, as "Sample Interval" says',
        ),
        ("t_s,CH1 (V),CH2 (V)\n" + rows(*LOOP), {}, "one column for input"),
        ('{"time": [0, 1]}', {}, "found JSON"),
        ("    -1\n    58\nNONE\n", {}, "found a universal file"),
        ("a: b\nc: d\n", {}, "found 2 lines of text"),
    ],
)
def test_what_is_not_understood_is_refused(put, text, options, sentence):
    with pytest.raises(InputError, match=sentence):
        read(put(text), **options)


def test_rows_told_by_the_call(put):
    text = "1,2,3\n4,5,6\nSpannung,Weg,Zeit\nV,um,s\nu,v,w\n" + rows(DRIVE, RESPONSE, TIME)
    is_the_loop(read(put(text), names_row=3, units_row=4, skip_rows=2))
    with pytest.raises(InputError, match=r"--names-row: expected a line above the numbers"):
        read(put(text), names_row=40, skip_rows=2)


@pytest.mark.parametrize("between", ["time_s,voltage_V,displacement_um\n", "Run 2\n", "\n\n", ""])
def test_segments_are_recordings_of_their_own(put, between):
    text = "time_s,voltage_V,displacement_um\n" + rows(*LOOP) + between + rows(*LOOP)
    path = put(text)
    with pytest.raises(
        InputError, match=r"found two segments of 0.32 s, .*; give --segment 1 to 2"
    ):
        read(path)
    found = read_segments(path)
    assert len(found) == 2
    for each in found:
        is_the_loop(each.recording)


def test_a_header_on_every_page_parts_nothing_where_the_clock_goes_on(put):
    head = "time_s,voltage_V,displacement_um\n"
    lines = rows(*LOOP).splitlines(keepends=True)
    is_the_loop(read(put(head + "".join(lines[:32]) + head + "".join(lines[32:]))))


def test_missing_and_clipped_samples_are_left_out_where_that_is_asked(put):
    response = [f"{y:.9g}" for y in RESPONSE]
    response[20:23] = ["", "NaN", "∞"]
    path = put("time_s,voltage_V,displacement_um\n" + rows(TIME, DRIVE, response))
    with pytest.raises(InputError, match=r'line 22, .* a number, found "".*give --mask bad'):
        read(path)
    with pytest.raises(InputError, match=r'line 24, .* found "∞", beyond the range'):
        read(path, mask=["0.09 s..0.107 s"])
    for mask in ("bad", [(0.1, 0.11)], ["100 ms..110 ms"]):
        recording = read(path, mask=mask)
        assert recording.masked is not None
        assert list(np.flatnonzero(recording.masked)) == [20, 21, 22]
        assert np.isfinite(recording.response).all()
        assert any("3 samples are left out" in warning for warning in recording.warnings)
    spoiled = np.array(RESPONSE)
    spoiled[40] += 500
    path = put("time_s,voltage_V,displacement_um\n" + rows(TIME, DRIVE, spoiled))
    assert "1 sample(s) far from those before" in read(path).checks()[0]
    masked = read(path, mask="bad").masked
    assert masked is not None
    assert list(np.flatnonzero(masked)) == [40]


def test_two_clocks_are_brought_together(put):
    slow = put("time_s,voltage_V\n" + rows(TIME[::2], DRIVE[::2]), "u.csv")
    fast = put("time_s,displacement_um\n" + rows(TIME + 0.02, RESPONSE), "y.csv")
    with pytest.raises(InputError, match=r"drive at 100 Hz and the response at 200 Hz; give --res"):
        read(slow, response=fast)
    recording = read(slow, response=fast, resample=200)
    assert (len(recording), recording.rate) == (59, 200)
    np.testing.assert_allclose(recording.response, RESPONSE[:59], atol=1e-6)
    assert "The drive has about 100 Hz" in recording.warnings[-1]
    late = put("time_s,voltage_V\n" + rows(TIME + 0.025, DRIVE), "late.csv")
    recording = read(late, response=fast)
    np.testing.assert_allclose(recording.drive, DRIVE[:-1], atol=1e-8)
    np.testing.assert_allclose(recording.response, RESPONSE[1:], atol=1e-6)
    apart = put("time_s,voltage_V\n" + rows(TIME + 9, DRIVE), "apart.csv")
    with pytest.raises(InputError, match="times that do not overlap"):
        read(apart, response=fast)
