"""What a file declares anywhere counts, what it does not is not assumed, and a contradiction stops
with the option that settles it."""

import re
import shlex
import struct
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import feather, parquet

from benchmarks.files.corpus import outcome_of
from fracjax._cli import run
from fracjax._io import read, read_segments
from fracjax._recording import InputError, Recording, conversion

COUNT = 400
PHASE = 2 * np.pi * np.arange(COUNT) / 100
DRIVE = np.round(50 - 50 * np.cos(PHASE), 3)
RESPONSE = np.round(5000 - 5000 * np.cos(PHASE - 0.1), 2)
MILLISECONDS = 2.0 * np.arange(COUNT)
HEAD = "time,voltage,displacement\n"


def rows(*columns, separator: str = ",") -> str:
    """Columns as lines."""
    return "".join(separator.join(map(str, row)) + "\n" for row in zip(*columns, strict=True))


PLAIN = rows(MILLISECONDS, DRIVE, RESPONSE)


@pytest.fixture
def put(tmp_path, monkeypatch):
    """A file of text in the folder where the test runs."""
    monkeypatch.chdir(tmp_path)

    def write(text: str, name: str = "loop.csv") -> str:
        (tmp_path / name).write_text(text, encoding="utf-8")
        return name

    return write


def is_the_loop(recording: Recording, units: tuple[str, str] = ("kV", "nm")) -> None:
    """Assert the rate, the numbers and the units."""
    assert recording.rate == pytest.approx(500, rel=1e-6)
    np.testing.assert_allclose(recording.drive, DRIVE)
    np.testing.assert_allclose(recording.response, RESPONSE)
    assert (recording.drive_unit, recording.response_unit) == units


@pytest.mark.parametrize(
    "lines",
    [
        "# time: ms\n# voltage: kV\n# displacement: nm\n",
        "# time unit: ms\n# voltage unit: kV\n# displacement unit: nm\n",
        "# displacement (capacitive, in nm)\n# voltage = kV\n# time in ms\n",
        '# {"time": {"unit": "ms"}, "voltage": {"unit": "kV"}, "displacement": {"unit": "nm"}}\n',
        '# {\n# "time": {\n# "unit": "ms"\n# },\n# "voltage": {\n# "unit": "kV"\n# },\n'
        '# "displacement": {\n# "unit": "nm"\n# }\n# }\n',
        "# - {name: time, unit: ms, datatype: float64}\n# - {name: voltage, unit: kV}\n"
        "# - {name: displacement, unit: nm}\n",
        "# - name: time\n#   unit: ms\n# - name: voltage\n#   unit: kV\n# - name: displacement\n"
        "#   unit: nm\n",
        "# units: ms, kV, nm\n",
        "# units: [ms, kV, nm]\n",
        "# units: ms;kV;nm\n",
    ],
)
def test_units_in_lines_above_the_table(put, lines):
    taken = read_segments(put(lines + HEAD + PLAIN))[0]
    is_the_loop(taken.recording)
    assert (taken.unused, taken.recording.warnings) == ((), ())


def test_what_speaks_of_something_else_is_no_unit_and_is_listed(put):
    path = put("# range: 10 V\n# voltage amplifier gain 20\n# lock-in at 3 kHz\n" + HEAD + PLAIN)
    with pytest.raises(InputError, match=r"whole numbers 2 apart.*--clock ms"):
        read(path)
    taken = read_segments(path, time_unit="ms")[0]
    is_the_loop(taken.recording, ("drive units", "response units"))
    assert [line.partition(": ")[2] for line in taken.unused] == [
        "range: 10 V",
        "voltage amplifier gain 20",
        "lock-in at 3 kHz",
    ]


def test_two_units_of_one_column_stop_with_the_options_that_settle_it(put):
    path = put("# voltage_V unit: kV\ntime_ms,voltage_V,displacement_nm\n" + PLAIN)
    with pytest.raises(InputError) as refused:
        read(path)
    assert 'expected one unit, found "kV" in line 1 and "V" in its name' in str(refused.value)
    assert str(refused.value).endswith("give --unit drive=kV or --unit drive=V.")
    for unit in ("V", "kV"):
        assert run(["info", path, "--unit", f"drive={unit}", "--quiet"]) == 0
        is_the_loop(read(path, input_unit=unit), (unit, "nm"))


def test_a_rate_that_the_times_contradict_stops_with_their_unit(put):
    path = put("# sample rate: 500 Hz\n" + "time_s,voltage_kV,displacement_nm\n" + PLAIN)
    with pytest.raises(InputError, match=r"a step of 0.002 s.*found 2 in s; give --clock ms\."):
        read(path)
    is_the_loop(read(path, time_unit="ms"))


def test_a_line_with_a_unit_of_time_forbids_to_assume_seconds(put):
    path = put("# stamps of the FPGA, in ms\n" + HEAD.replace("time", "t") + PLAIN)
    with pytest.raises(InputError, match=r'"stamps of the FPGA, in ms" in line 1; give --clock ms'):
        read(path)


@pytest.mark.parametrize("units", [("mV", "V"), ("nm", "um")])
def test_units_that_change_from_row_to_row(put, units):
    small, large = units
    column = DRIVE if small == "mV" else RESPONSE / 1e3
    written = [(small, 1e3 * value) if value < 5 else (large, value) for value in column]
    values, names = [f"{v:.9g}" for _, v in written], [unit for unit, _ in written]
    if small == "mV":
        text = "time_ms,u,unit,y_nm\n" + rows(MILLISECONDS, values, names, RESPONSE)
        recording = read(put(text))
        np.testing.assert_allclose(recording.drive, column, rtol=1e-9)
        assert recording.drive_unit == "V"
    else:
        text = "time_ms,voltage_V,y,unit\n" + rows(MILLISECONDS, DRIVE, values, names)
        recording = read(put(text), output="y")
        scale = conversion(recording.response_unit, "um")
        np.testing.assert_allclose(recording.response * scale, column, rtol=1e-9)
    assert "states the unit of each value" in recording.warnings[0]


def test_a_column_of_units_and_a_name_that_says_another(put):
    units = ["mV"] * COUNT
    path = put("time_ms,voltage_V,unit,y_nm\n" + rows(MILLISECONDS, DRIVE, units, RESPONSE))
    with pytest.raises(InputError, match='found "mV" in column "unit" and "V" in its name'):
        read(path)


def test_factors_by_the_name_of_a_column(put):
    lines = "# ch1: 0.001 V/LSB\n# ch2: 0.01 nm/count\ntime_ms,ch1,ch2\n"
    counts = np.round(DRIVE / 0.001).astype(int), np.round(RESPONSE / 0.01).astype(int)
    path = put(lines + rows(MILLISECONDS, *counts))
    columns: Any = {"input": "ch1", "output": "ch2"}
    with pytest.raises(
        InputError, match=r'"drive=counts\*0.001 V" --scale "response=counts\*0.01 nm"'
    ):
        read(path, **columns)


def test_units_of_different_kinds_in_one_column_are_refused(put):
    names = ["V"] * 200 + ["A"] * 200
    text = "time_ms,u,unit,y_nm\n" + rows(MILLISECONDS, DRIVE, names, RESPONSE)
    with pytest.raises(InputError, match="units of different kinds beside its values"):
        read(put(text), input="u")


def test_prefixes_beside_the_values(put):
    prefixes = ["m" if value < 1 else "" for value in DRIVE]
    values = [f"{1e3 * v if p else v:.9g}" for v, p in zip(DRIVE, prefixes, strict=True)]
    text = "time_ms,voltage,prefix,y_nm\n" + rows(MILLISECONDS, values, prefixes, RESPONSE)
    recording = read(put(text))
    np.testing.assert_allclose(recording.drive, DRIVE, rtol=1e-9)
    assert recording.drive_unit == "drive units"


@pytest.mark.parametrize("suffix", [".parquet", ".feather"])
@pytest.mark.parametrize("where", ["fields", "schema", "pandas"])
def test_metadata_of_arrow(tmp_path, suffix, where):
    names, units = ("time", "voltage", "displacement"), ("ms", "kV", "nm")
    table = pa.table(dict(zip(names, (MILLISECONDS, DRIVE, RESPONSE), strict=True)))
    by_name = "{" + ", ".join(f'"{n}": "{u}"' for n, u in zip(names, units, strict=True)) + "}"
    if where == "fields":
        fields = [
            field.with_metadata({"unit": unit})
            for field, unit in zip(table.schema, units, strict=True)
        ]
        table = table.cast(pa.schema(fields))
    elif where == "schema":
        table = table.replace_schema_metadata({"units": by_name})
    else:
        table = table.replace_schema_metadata({"PANDAS_ATTRS": f'{{"units": {by_name}}}'})
    path = tmp_path / f"loop{suffix}"
    write = parquet.write_table if suffix == ".parquet" else feather.write_feather
    write(table, str(path))
    is_the_loop(read(path))


@pytest.mark.parametrize(
    "beside",
    [
        {"dt": 2, "dt_unit": "ms"},
        {"fs": 0.5, "fs_unit": "kHz"},
        {"xIncrement": 2.0, "xUnit": "ms"},
        {"dt": 2, "units": np.array(["ms", "kV", "nm"])},
    ],
)
def test_a_step_and_its_unit_in_values_of_their_own(tmp_path, beside):
    np.savez(tmp_path / "loop.npz", u=DRIVE, y=RESPONSE, **beside)
    recording = read(tmp_path / "loop.npz", input_unit="kV", output_unit="nm")
    is_the_loop(recording)


def test_counts_with_a_factor_beside_them(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with h5py.File("loop.h5", "w") as file:
        file.attrs["sample_rate"] = 500.0
        for name, values, factor, unit in (
            ("voltage", DRIVE, 0.001, "V"),
            ("displacement", RESPONSE, 0.01, "nm"),
        ):
            file[name] = np.round(values / factor).astype(np.int32)
            file[name].attrs.update({"unit": unit, "coefficients": [0.0, factor]})
    assert run(["info", "loop.h5"]) == 2
    remedy = capsys.readouterr().err.partition("give ")[2].partition(" if they")[0]
    assert remedy == '--scale "drive=counts*0.001 V" --scale "response=counts*0.01 nm"'
    assert run(["info", "loop.h5", "--quiet", *shlex.split(remedy)]) == 0
    scales: Any = {"input_scale": "counts*0.001 V", "output_scale": "counts*0.01 nm"}
    is_the_loop(read("loop.h5", **scales), ("V", "nm"))
    offset = read("loop.h5", input_scale="counts*0.001 - 10 V", output_scale=scales["output_scale"])
    np.testing.assert_allclose(offset.drive, DRIVE - 10)
    in_mv = read("loop.h5", **scales, input_unit="mV")
    np.testing.assert_allclose(in_mv.drive, 1e3 * DRIVE)


@pytest.mark.parametrize("scale", ["counts*x V", "", "counts*0 V", "counts*2 wumpus"])
def test_scales_that_say_nothing(put, scale):
    path = put("time_ms,u,y\n" + PLAIN)
    with pytest.raises(InputError, match=r'such as "drive=counts\*0.0305 mV"'):
        read(path, input_scale=scale or "?")


# Clocks -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "stamps"),
    [
        ("time_us", (2**32 - 100_000 + 2000 * np.arange(COUNT)) % 2**32),
        ("time_us", (2**31 - 100_000 + 2000 * np.arange(COUNT)) % 2**32 - 2**31),
        ("time_ms", (2**16 - 100 + 2 * np.arange(COUNT)) % 2**16),
        ("micros", (2000 * np.arange(COUNT)) % 1_000_000),
        ("time_s", np.round((59.5 + 0.002 * np.arange(COUNT)) % 60, 3)),
    ],
)
def test_counters_that_begin_anew_are_one_recording(put, name, stamps):
    path = put(f"{name},voltage_kV,displacement_nm\n" + rows(stamps, DRIVE, RESPONSE))
    recording = read(path)
    is_the_loop(recording)
    if np.diff(stamps).min() < 0:
        assert "begins anew" in recording.warnings[0]
        assert len(read_segments(path, wrap="none")) > 1


def test_segments_of_decimal_seconds_stay_segments(put):
    times = np.round((0.002 * np.arange(COUNT)) % 0.4, 3)
    path = put("time_s,voltage_kV,displacement_nm\n" + rows(times, DRIVE, RESPONSE))
    assert len(read_segments(path)) == 2
    is_the_loop(read(path, wrap="0.4 s"))
    with pytest.raises(InputError, match=r"--wrap 16: expected steps of 0.002"):
        read(path, wrap=16)


@pytest.mark.parametrize(
    ("columns", "stamps"),
    [
        (
            "sec,nsec",
            (1_717_000_000 + np.arange(COUNT) // 500, 2_000_000 * np.arange(COUNT) % 10**9),
        ),
        ("secs,msec", (np.arange(COUNT) // 300, 2 * (np.arange(COUNT) % 300))),
    ],
)
def test_seconds_and_parts_of_them_in_two_columns(put, columns, stamps):
    path = put(f"{columns},voltage_kV,displacement_nm\n" + rows(*stamps, DRIVE, RESPONSE))
    if columns == "sec,nsec":
        is_the_loop(read(path))
    else:  # Milliseconds that restart before the second is full are no parts of it.
        with pytest.raises(InputError):
            read(path)


def test_milliseconds_beside_seconds_since_1970(put):
    milliseconds = 2 * np.arange(COUNT) + 300
    stamps = 1_717_000_000 + milliseconds // 1000, milliseconds % 1000
    is_the_loop(read(put("epoch,ms,voltage_kV,y_nm\n" + rows(*stamps, DRIVE, RESPONSE))))


def test_milliseconds_beside_a_date(put):
    moments = [f"2026-02-13 10:21:{7 + at // 500:02d}" for at in range(COUNT)]
    text = "date,ms,voltage_kV,displacement_nm\n"
    milliseconds = (2 * np.arange(COUNT) + 500) % 1000
    moments = [f"2026-02-13 10:21:{7 + (2 * at + 500) // 1000:02d}" for at in range(COUNT)]
    is_the_loop(read(put(text + rows(moments, milliseconds, DRIVE, RESPONSE))))


@pytest.mark.parametrize(
    ("name", "stamps", "rate"),
    [
        ("timestamp_ns", [1_717_000_000_000_000_000 + 100 * k for k in range(COUNT)], 1e7),
        ("epoch_s", [f"1717000000.{10 * k:07d}" for k in range(COUNT)], 1e6),
    ],
)
def test_stamps_of_many_digits_lose_none(put, tmp_path, name, stamps, rate):
    path = put(f"{name},voltage_V,displacement_um\n" + rows(stamps, DRIVE, RESPONSE))
    assert read(path).rate == pytest.approx(rate, rel=1e-9)
    if name == "timestamp_ns":
        table = {name: stamps, "voltage_V": DRIVE, "displacement_um": RESPONSE}
        parquet.write_table(pa.table(table), tmp_path / "loop.parquet")
        assert read(tmp_path / "loop.parquet").rate == pytest.approx(rate, rel=1e-9)


def test_the_proposed_rate_is_the_roundest_that_fits(put):
    stamps = 1_717_000_000 + (np.arange(COUNT) + 20) // 50
    path = put("timestamp,voltage_kV,displacement_nm\n" + rows(stamps, DRIVE, RESPONSE))
    with pytest.raises(InputError, match=r"give --rate 50Hz\.$"):
        read(path)
    assert run(["info", path, "--quiet", "--rate", "50Hz"]) == 0


def test_two_signals_beside_stamps_that_repeat_are_named_together(put):
    stamps = 0.002 * (np.arange(COUNT) // 2)
    path = put("in s,CH1 in V,CH2 in V\n" + rows(stamps, DRIVE, RESPONSE))
    with pytest.raises(InputError, match="give --input 'CH1 in V' and --output 'CH2 in V', or"):
        read(path)


def test_a_frequency_response_is_told_how_to_be_fitted(put):
    frequencies = np.geomspace(1, 2000, 60)
    values = 0.1 / (1 - (frequencies / 900) ** 2 + 0.06j * frequencies / 900)
    path = put(
        "Frequency (Hz),Real (um/V),Imag (um/V)\n" + rows(frequencies, values.real, values.imag)
    )
    # `remedies` carries the command out.
    with pytest.raises(InputError, match=r"as what it is: fracjax fit loop\.csv --model 'gain"):
        read(path)


def test_a_frequency_beside_a_time_is_that_of_a_sweep(put):
    columns = MILLISECONDS, np.linspace(1, 90, COUNT), DRIVE, RESPONSE
    with pytest.raises(InputError, match="give --input") as refused:
        read(put("time (ms),Frequency (Hz),a,b\n" + rows(*columns)))
    assert "--frequency-response" not in str(refused.value)


def test_pairs_of_one_stamp_are_said_as_such(put):
    stamps = 2.0 * (np.arange(COUNT) // 2)
    path = put("time_ms,voltage_kV,displacement_nm\n" + rows(stamps, DRIVE, RESPONSE))
    with pytest.raises(InputError, match=r"each stamp stands 2 times, as of pairs") as refused:
        read(path)
    assert "--rate" not in str(refused.value)


def test_signals_in_rows_of_their_own_are_brought_together(put):
    times = np.arange(2 * COUNT)
    drive = [DRIVE[at // 2] if at % 2 == 0 else "" for at in times]
    response = ["" if at % 2 == 0 else RESPONSE[at // 2] for at in times]
    path = put("time_ms,voltage_kV,displacement_nm\n" + rows(times, drive, response))
    with pytest.raises(InputError, match=r"0.001 s after the drive; give --resample 500Hz"):
        read(path)
    for mask in ([], ["--mask", "bad"]):
        assert run(["info", path, "--resample", "500Hz", "--quiet", *mask]) == 0
    recording = read(path, resample="500Hz")
    np.testing.assert_allclose(recording.response[1:-1], RESPONSE[1 : COUNT - 2], atol=1e-9)


def test_a_unit_of_time_that_changes_within_the_column(put):
    # As shown in us, in ns below one of them, and in us again.
    times = 0.01 * np.arange(-200, 200)
    written = [f"{1e3 * t:.3f}" if -1 < t < 1 else f"{t:.6f}" for t in np.round(times, 6)]
    recording = read(put("Time (us),u_kV,y_nm\n" + rows(written, DRIVE, RESPONSE)))
    assert recording.rate == pytest.approx(1e8)
    assert len(recording) == COUNT
    assert "its unit changes within the column" in recording.warnings[0]


def test_rows_where_a_signal_changes_are_held(put):
    at = np.array([0, 7, 9, 30, 34, 60, 61, 95, *range(100, 400, 12)])
    lines = "# Sample rate: 500 Hz\ntime_s,voltage_kV,displacement_nm\n"
    path = put(lines + rows(0.002 * at, DRIVE[at], RESPONSE[at]))
    recording = read(path)
    assert (len(recording), recording.rate) == (int(at[-1]) + 1, pytest.approx(500))
    np.testing.assert_array_equal(recording.drive[9:30], DRIVE[9])
    assert "Each was held until the next" in recording.warnings[0]


def test_rows_that_a_logger_wrote_twice(put):
    at = np.sort(np.concatenate([np.arange(COUNT), [5, 77, 200]]))
    path = put(
        "time_ms,voltage_kV,displacement_nm\n" + rows(MILLISECONDS[at], DRIVE[at], RESPONSE[at])
    )
    recording = read(path)
    is_the_loop(recording)
    assert "3 row(s) stand there twice" in recording.warnings[0]
    assert len(read(path, resample="500Hz")) == COUNT


def test_lines_of_two_kinds_are_told_with_the_commands_that_part_them(put):
    text = "".join(
        f"$DRV,{t},{u}\n$POS,{t},{y}\n"
        for t, u, y in zip(MILLISECONDS + 0.1, DRIVE, RESPONSE, strict=True)
    )
    with pytest.raises(InputError) as refused:
        read(put(text))
    assert "2 in turn" in str(refused.value)
    for number, word in enumerate(("$DRV", "$POS"), 1):
        assert f"grep -F '{word}' loop.csv > {number}.csv" in str(refused.value)
        lines = [line for line in text.splitlines(keepends=True) if word in line]
        put("".join(lines), f"{number}.csv")
    units = ["--unit", "drive=kV", "--unit", "response=nm"]
    call = ["info", "--drive", "1.csv", "--response", "2.csv", "--clock", "ms", *units]
    assert run([*call, "--quiet"]) == 0


def test_a_column_called_n_counts_only_where_it_does(put):
    noise = np.random.default_rng(0).standard_normal(COUNT).round(3)
    recording = read(put("u,y,n\n" + rows(DRIVE, RESPONSE, noise)), rate="500Hz")
    is_the_loop(recording, ("drive units", "response units"))


# Descriptions -------------------------------------------------------------------------------------


def test_a_description_says_once_what_options_say(put, capsys):
    path = put("a,b,c\n" + PLAIN)
    first = ["--time", "a", "--input", "b", "--output", "c", "--clock", "ms"]
    units = ["--unit", "drive=kV", "--unit", "response=nm"]
    assert run(["info", path, *first, *units, "--write-description", "lab.toml", "--quiet"]) == 0
    is_the_loop(read(path, description="lab.toml"))
    assert run(["info", path, "--description", "lab.toml", "--json"]) == 0
    assert '"unit": "kV"' in capsys.readouterr().out
    assert read(path, description="lab.toml", input_unit="V").drive_unit == "V"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[time\n", "a description in TOML"),
        ("[clock]\nunit = 'ms'\n", r"sections \[time\], \[drive\], \[response\], \[file\]"),
        ("[time]\nunits = 'ms'\n", r"\[time\]: expected column, unit, wrap"),
        ("[drive]\nunit = ['V']\n", r"\[drive\]: expected column, unit, scale"),
    ],
)
def test_descriptions_that_say_nothing(put, text, sentence):
    path = put("a,b,c\n" + PLAIN)
    with pytest.raises(InputError, match=f"lab.toml.*{sentence}"):
        read(path, description=put(text, "lab.toml"))


@pytest.mark.parametrize("call", [["--unit", "mV"], ["--unit", "x=mV"], ["--scale", "time=2 s"]])
def test_calls_that_say_nothing(put, call, capsys):
    assert run(["info", put(HEAD + PLAIN), *call]) == 2
    assert "as drive=mV" in capsys.readouterr().err.replace('"drive=counts*0.0305 mV"', "drive=mV")


AT = np.arange(COUNT)
REMEDIED = {
    "two units": "# voltage_V unit: kV\ntime_ms,voltage_V,displacement_nm\n" + PLAIN,
    "another step": "# sample rate: 500 Hz\ntime_s,voltage_kV,displacement_nm\n" + PLAIN,
    "a line in ms": "# stamps of the FPGA, in ms\n" + HEAD + PLAIN,
    "whole numbers": HEAD + PLAIN,
    "rounded stamps": "t,voltage_kV,displacement_nm\n" + rows(AT // 50, DRIVE, RESPONSE),
    "no rate": "voltage_kV,displacement_nm\n" + rows(DRIVE, RESPONSE),
    "two drives": "time_ms,CH1 [V],CH2 [V]\n" + PLAIN,
    "an unknown unit": "time_ms,voltage_V,displacement\nms,V,Skt\n" + PLAIN,
    "gaps": "time_ms,voltage_kV,displacement_nm\n"
    + rows(
        np.delete(MILLISECONDS, [7, 90]), np.delete(DRIVE, [7, 90]), np.delete(RESPONSE, [7, 90])
    ),
    "a missing sample": "time_ms,voltage_kV,displacement_nm\n"
    + PLAIN.replace(f"{RESPONSE[77]}", "nan", 1),
    "counts": "# voltage scale: 0.01 V/count\ntime_ms,voltage,displacement_nm\n"
    + rows(MILLISECONDS, np.round(100 * DRIVE), RESPONSE),
    "two segments": "time_ms,voltage_kV,displacement_nm\n"
    + rows(MILLISECONDS + 9000.5 * (AT > 150), DRIVE, RESPONSE),
}


@pytest.mark.parametrize("name", REMEDIED)
def test_every_remedy_works_as_it_is_printed(put, name, capsys):
    """The first remedy of each refusal, given to the same command, lets it read the file, or is
    followed by the remedy of what is left, as of the response after the drive."""
    call = ["fit", put(REMEDIED[name]), "--model", "no such model", "--out", "out"]
    options: list[str] = []
    for _ in range(3):
        assert run([*call, *options]) == 2
        message = capsys.readouterr().err
        if "no such model" in message:
            return
        remedy = re.search(
            r"(?:; |, or |or )?give (--.*?)(?: or | if | where |, which | to |, or |\.$)", message
        )
        assert remedy, message
        words = remedy[1].replace("such as ", "").replace(" and --", " --").rstrip(",.")
        options += shlex.split(words)
    raise AssertionError(options)


# Formats ------------------------------------------------------------------------------------------


def test_lines_of_json(put):
    path = put(
        "".join(
            f'{{"time_ms": {t}, "voltage_kV": {u}, "displacement_nm": {y}}}\n'
            for t, u, y in zip(MILLISECONDS, DRIVE, RESPONSE, strict=True)
        ),
        "loop.jsonl",
    )
    is_the_loop(read(path))


def test_mdf(tmp_path):
    mdf = pytest.importorskip("asammdf")
    times = MILLISECONDS / 1e3
    signals = [
        mdf.Signal(values, times, name=name, unit=unit)
        for name, values, unit in (("voltage", DRIVE, "kV"), ("displacement", RESPONSE, "nm"))
    ]
    with mdf.MDF(version="4.10") as file:
        file.append(signals)
        file.save(tmp_path / "loop.mf4")
    is_the_loop(read(tmp_path / "loop.mf4"))


def igor_wave(path, name: bytes, values: np.ndarray, unit: bytes) -> None:
    """A binary wave of version 2 with steps of 2 ms, as Igor Pro writes it."""
    head = (4, 0, name, 0, 0, 0, unit, b"ms", len(values), 0, 2.0, 0.0, 0, 0, 0, 0.0, 0.0)
    wave = struct.pack("<hI20shhI4s4sihddhhhddccIiI2sII", *head, b"\0", b"\0", 0, 0, 0, b"", 0, 0)
    opening = struct.pack("<hiii", 2, len(wave) + 16 + 8 * len(values), 0, 0)
    words = struct.unpack(f"<{(len(opening) + len(wave)) // 2}h", opening + wave)
    data = values.astype("<f8").tobytes() + bytes(16)
    path.write_bytes(opening + struct.pack("<H", -sum(words) & 0xFFFF) + wave + data)


def test_waves_of_igor(tmp_path):
    igor_wave(tmp_path / "u.ibw", b"voltage", DRIVE, b"kV")
    igor_wave(tmp_path / "y.ibw", b"displacement", RESPONSE, b"nm")
    is_the_loop(read(tmp_path / "u.ibw", response=tmp_path / "y.ibw"))


# All of it together -------------------------------------------------------------------------------


def test_no_layout_is_read_wrongly_in_silence():
    outcomes = {seed: outcome_of(seed) for seed in range(250)}
    assert not {
        seed: outcome
        for seed, outcome in outcomes.items()
        if not re.fullmatch("right|aloud|listed|refused", outcome[0])
    }
    assert sum(outcome == "right" for outcome, _ in outcomes.values()) > 180


def test_a_text_too_large_is_refused_at_once(put, tmp_path):
    path = put(HEAD)
    with open(path, "ab") as file:
        file.truncate(2_000_000_000)
    with pytest.raises(InputError, match=r"at most 1.5 GB of text, found 2 GB; .*head -n"):
        read(path)
