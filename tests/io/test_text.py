"""Files in and out: what is read, and the one sentence that refuses the rest."""

import os
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fracjax._io import read
from fracjax._recording import InputError, Recording

DATA = Path(os.environ.get("FRACJAX_DATA", Path(__file__).parents[2] / "../shared/data"))
COUNT = 40
TIME = np.arange(COUNT) * 0.005
DRIVE = 1.8 + 1.8 * np.sin(np.arange(COUNT) / 3)
RESPONSE = -100 + 20 * np.cos(np.arange(COUNT) / 3)
NAMES = ("time_s", "voltage_V", "displacement_um")


def lines_of(*columns, names: tuple[str, ...] = NAMES, separator: str = ",") -> list[str]:
    """The lines of a table, of the standard loop unless told."""
    rows = zip(*(columns or (TIME, DRIVE, RESPONSE)), strict=True)
    head = [separator.join(names)] if names else []
    return head + [separator.join(repr(float(value)) for value in row) for row in rows]


@pytest.fixture
def put(tmp_path):
    """Write lines, text or bytes to a file and give its path."""

    def write(content: list[str] | str | bytes, name: str = "loop.csv") -> Path:
        text = "\n".join(content) + "\n" if isinstance(content, list) else content
        path = tmp_path / name
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return write


def is_the_loop(recording: Recording) -> None:
    """Assert that it is the standard loop, to the last digit."""
    np.testing.assert_array_equal(recording.drive, DRIVE)
    np.testing.assert_array_equal(recording.response, RESPONSE)
    assert recording.dt == pytest.approx(0.005, rel=1e-12)


# What is read -------------------------------------------------------------------------------------


BASIC = [f"20261128T2359{59.9 + 0.005 * k:06.3f}" for k in range(20)]
BASIC += [f"20261129T0000{0.005 * k:06.3f}" for k in range(20)]


PLAIN = lines_of(DRIVE, RESPONSE, names=("voltage", "position"))


@pytest.mark.parametrize(
    ("lines", "units"),
    [
        # A stroke within a unit, and shares.
        (lines_of(names=("time_s", "field_kV/mm", "strain_ppm")), ("kV/mm", "ppm")),
        # An object of JSON, and a mapping of YAML.
        (
            ['# {"fs": 200, "units": ["V", "um"]}', *PLAIN],
            ("V", "um"),
        ),
        (
            ["rate: 200", "units: {voltage: V, position: um}", *PLAIN],
            ("V", "um"),
        ),
        # Values of a key above a table without names.
        (["#UNITS:V;um", "#RATE=200", *lines_of(DRIVE, RESPONSE, names=(), separator=";")],
         ("V", "um")),
        # Stamps in ISO's basic form, over midnight.
        (
            ["stamp,voltage_V,position_um"]
            + [f"{t},{u!r},{y!r}" for t, u, y in
               zip(BASIC, DRIVE.tolist(), RESPONSE.tolist(), strict=True)],
            ("V", "um"),
        ),
        # Names above a line of dashes, and above a comment of as many words.
        ([lines_of()[0], "-" * 30, *lines_of()[1:]], ("V", "um")),
        ([lines_of()[0], "# measured in air", *lines_of()[1:]], ("V", "um")),
        # Another table below.
        ([*lines_of(), "", "frequency [Hz],gain [dB]", "1,2", "2,3"], ("V", "um")),
    ],
)  # fmt: skip
def test_what_is_declared_in_other_ways(put, lines, units):
    recording = read(put(lines))
    is_the_loop(recording)
    assert (recording.drive_unit, recording.response_unit) == units


def test_a_rate_with_thousands_beside_decimal_commas(put):
    rows = [line.replace(".", ",") for line in lines_of(DRIVE, RESPONSE, names=(), separator=";")]
    recording = read(put(["# Abtastrate: 1.000,0 Hz", "Spannung [V];Weg [um]", *rows]))
    assert recording.rate == pytest.approx(1000)


def test_zeros_behind_the_last_row_are_none_of_it(put):
    """As a logger leaves them that lost its power before it had filled its file."""
    is_the_loop(read(put("\n".join(lines_of()).encode() + b"\n" + bytes(512))))


def test_pieces_of_a_text_end_with_its_lines(put, monkeypatch):
    """Arrow reads it in pieces of memory of its own, here of a few lines each."""
    monkeypatch.setattr("fracjax._io._text._PIECE", 200)
    is_the_loop(read(put(lines_of())))


def test_rows_that_all_stand_twice_are_taken_once(put):
    head, *rows = lines_of()
    recording = read(put([head, *(row for row in rows for _ in range(2))]))
    is_the_loop(recording)
    assert "40 row(s) stand there twice" in recording.warnings[0]


def test_stamps_of_single_precision_are_uniform(put):
    """Nine digits, which are those of float32."""
    stamps = [f"{np.float32(1234.5 + t):.9g}" for t in TIME]
    rows = zip(stamps, DRIVE.tolist(), RESPONSE.tolist(), strict=True)
    path = put([",".join(NAMES)] + [f"{t},{u},{y}" for t, u, y in rows])
    assert read(path).rate == pytest.approx(200, rel=1e-4)


def test_thousands_parted_by_a_space_that_does_not_break(put):
    parted = [f"{1e4 * u:,.4f}".replace(",", "\u202f") for u in DRIVE]
    rows = zip(TIME.tolist(), parted, RESPONSE.tolist(), strict=True)
    path = put(["time_s;voltage_mV;displacement_um"] + [f"{t};{u};{y}" for t, u, y in rows])
    np.testing.assert_allclose(read(path).drive, 1e4 * DRIVE, atol=1e-4)


def test_real_recording():
    path = DATA / "piezo_dbo" / "Model_Vi_Do.dat"
    if not path.exists():
        pytest.skip(f"the recordings are not in {DATA}; name their folder in FRACJAX_DATA")
    recording = read(path, input=0, output=4, rate="200Hz")
    assert (len(recording), recording.dt) == (8027, 0.005)
    assert (recording.drive[1], recording.response[1]) == (1.856539, -120.154262)
    assert recording.drive_period() == (200, 0, 8027)
    assert recording.checks() == ()
    assert recording.warnings == ()
    assert recording.response_unit == "response units"


@pytest.mark.parametrize("suffix", [".csv", ".tsv", ".txt", ".dat", ".asc", ".log", ".CSV", ""])
@pytest.mark.parametrize("separator", [",", ";", "\t", " ", "   ", ", ", " \t "])
def test_separators_and_suffixes(put, separator, suffix):
    is_the_loop(read(put(lines_of(separator=separator), "loop" + suffix)))


@pytest.mark.parametrize("separator", [";", "\t", " "])
def test_decimal_comma(put, separator):
    lines = [line.replace(".", ",") for line in lines_of(separator=separator)]
    is_the_loop(read(put(lines)))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(put, encoding, end):
    lines = lines_of(names=("time [s]", "Voltage (V)", "Displacement (µm)"))
    recording = read(put(end.join(lines).encode(encoding)))
    is_the_loop(recording)
    assert (recording.response_unit, recording.warnings) == ("µm", ())


def test_comments_blank_lines_and_quotes(put):
    head, *rows = lines_of()
    quoted = ",".join(f'"{name}"' for name in head.split(","))
    numbers = [f'"{rows[0]}"'.replace(",", '","'), *rows[1:]]
    is_the_loop(read(put(["# made, by, me", "", quoted, *numbers[:3], "% later", *numbers[3:]])))


def test_a_column_whose_first_cells_are_empty_is_one_of_numbers(put):
    """The first lines of a file do not say what its columns hold."""
    late, times = 25, np.arange(200) * 0.005
    head, *rows = lines_of(times, np.sin(30 * times), np.cos(30 * times))
    rows[:late] = [f"{row.rpartition(',')[0]}," for row in rows[:late]]
    recording = read(put([head, *rows]), mask="bad")
    np.testing.assert_array_equal(recording.response[late:], np.cos(30 * times)[late:])
    assert recording.masked is not None
    np.testing.assert_array_equal(np.flatnonzero(recording.masked), np.arange(late))


def test_decimal_commas_may_begin_late(put):
    """Whole numbers in the first lines do not say what the decimal mark is."""
    count, whole = 400, 100
    rise = np.arange(count) + np.where(np.arange(count) < whole, 0.0, 0.5)
    rows = [f"{at};{value:g};{value:g}".replace(".", ",") for at, value in enumerate(rise)]
    recording = read(put([";".join(NAMES), *rows]))
    np.testing.assert_array_equal(recording.drive, rise)


def test_names_in_the_comment_above_the_numbers(put, tmp_path):
    path = tmp_path / "loop.txt"
    np.savetxt(path, np.c_[TIME, DRIVE, RESPONSE], fmt="%.17g", header="a note\nt u_V y_um")
    recording = read(path)
    is_the_loop(recording)
    assert (recording.drive_unit, recording.response_unit) == ("V", "um")


def test_other_columns_may_hold_anything(put):
    head, *rows = lines_of()
    is_the_loop(read(put([head + ",remark", *(row + ",good" for row in rows)])))


@pytest.mark.parametrize(
    ("names", "units"),
    [
        (("time_s", "voltage_V", "displacement_um"), ("V", "um")),
        (("time [s]", "Voltage (V)", "Displacement [nm]"), ("V", "nm")),
        (("Time / s", "Drive voltage / kV", "Force / N"), ("kV", "N")),
        (("t", "drive_mV", "response_um"), ("mV", "um")),
        (("t", "u_V", "y_mm"), ("V", "mm")),
        (("Zeit", "input_volts", "position_nm"), ("volts", "nm")),
        (("t", "ch1_V", "ch2_um"), ("V", "um")),
        (("t", "current_A", "Sensor 2 [mm]"), ("A", "mm")),
    ],
)
@pytest.mark.parametrize("separator", [",", "\t"])
def test_columns_by_name_and_unit(put, names, units, separator):
    recording = read(put(lines_of(names=names, separator=separator)))
    is_the_loop(recording)
    assert (recording.drive_unit, recording.response_unit) == units


def test_names_with_blanks_before_the_unit_in_a_blank_separated_file(put):
    names = ("time [s]", "voltage (V)", "y [um]")
    is_the_loop(read(put(lines_of(names=names, separator="  "))))


@pytest.mark.parametrize(("unit", "scale"), [("ms", 1e3), ("us", 1e6), ("s", 1.0), ("min", 1 / 60)])
def test_time_units(put, unit, scale):
    names = (f"time [{unit}]", "u_V", "y_um")
    is_the_loop(read(put(lines_of(TIME * scale, DRIVE, RESPONSE, names=names))))


def test_what_no_file_states_is_not_assumed(put):
    path = put(lines_of(names=("t", "u", "y")))
    recording = read(path)
    assert (recording.drive_unit, recording.response_unit) == ("drive units", "response units")
    assert recording.warnings == (f'{path}, column "t": no unit is written, s was assumed.',)
    told = read(path, input_unit="mV", output_unit="N", time_unit="ms")
    assert (told.drive_unit, told.response_unit, told.warnings) == ("mV", "N", ())
    assert told.rate == pytest.approx(200e3)


def test_a_unit_told_is_what_the_numbers_are_converted_to_aloud(put):
    path = put(lines_of())
    recording = read(path, output_unit="nm")
    assert recording.response_unit == "nm"
    np.testing.assert_allclose(recording.response, 1000 * RESPONSE, rtol=1e-12)
    (warning,) = recording.warnings
    assert "converted from um to nm as given" in warning
    with pytest.raises(InputError, match=r'of the same kind as "um".*found "V" in the call'):
        read(path, output_unit="V")
    with pytest.raises(InputError, match=r'a unit of what "displacement" speaks of, found "N"'):
        read(path, output_unit="N")
    with pytest.raises(InputError, match=r'a unit of what "voltage" speaks of, found "furlong"'):
        read(path, input_unit="furlong")


@pytest.mark.parametrize("keys", [("a", "b", "c"), (0, 1, 2), ("0", "1", "2"), ("a", 1, "c")])
def test_columns_by_name_or_index(put, keys):
    path = put(lines_of(names=("a", "b", "c")))
    is_the_loop(read(path, time=keys[0], input=keys[1], output=keys[2]))


def test_a_short_file_with_wrong_columns_is_told_both(put):
    """So that nobody records at length what is then refused for its columns."""
    short = lines_of(names=("time_s", "foo", "bar"))[:11]
    with pytest.raises(InputError) as refused:
        read(put(short))
    assert str(refused.value).endswith(
        'expected columns for input and output, found 3 column(s): "time_s", "foo", "bar"; give '
        "--input foo and --output bar, or --input bar and --output foo; and give a longer "
        "recording: it has 10 samples, and at least 32 are needed."
    )
    with pytest.raises(InputError) as alone:
        read(put(lines_of()[:11]))
    assert str(alone.value).count("samples") == 1


def test_columns_by_position(put):
    is_the_loop(read(put(lines_of(names=()))))
    is_the_loop(read(put(lines_of(DRIVE, RESPONSE, names=())), rate="0.2 kHz"))
    is_the_loop(read(put(lines_of(DRIVE, RESPONSE, names=())), rate=200))


def test_an_order_that_nothing_names_is_assumed_aloud(put):
    """A displacement before its drive would else be taken for it without a word."""
    path = put(lines_of(RESPONSE, DRIVE, names=()))
    assert read(path, rate=200).warnings[0] == (
        f"{path}: nothing names the columns, so 0 was taken for the drive and 1 for the response; "
        "if it is the other way round, give --input 1 and --output 0."
    )
    told = read(path, rate=200, input=1, output=0)
    is_the_loop(told)
    assert not any("nothing names" in warning for warning in told.warnings)


def test_a_names_row_may_stand_among_skipped_lines(put):
    head, *rows = lines_of()
    is_the_loop(read(put([head, "Length,64,64,64", *rows]), names_row=1, skip_rows=2))


def test_a_comment_says_what_it_lists(put):
    head, *rows = lines_of(separator="  ")
    path = put(["# columns: " + head, *rows])
    recording = read(path)
    is_the_loop(recording)
    assert recording.warnings == ()


def test_units_beside_two_time_columns_are_those_of_the_signals(put):
    """As oscilloscopes export channels, each with a time of its own."""
    columns = lines_of(TIME, DRIVE, TIME, RESPONSE, names=("TIME", "CH1", "TIME", "CH2"))
    path = put(["Horizontal Units,s,s", "Vertical Units,V,um", *columns])
    recording = read(path)
    is_the_loop(recording)
    assert (recording.drive_unit, recording.response_unit) == ("V", "um")


def test_rate_beside_a_time_column(put):
    path = put(lines_of())
    is_the_loop(read(path, rate=200.1))
    with pytest.raises(InputError, match=r"a step of 0.004 s by --rate, found 0.005 s"):
        read(path, rate="250Hz")


def test_a_bracket_that_is_no_unit_is_none(put):
    path = put(lines_of(names=("t_s", "u (CH1)", "y (wumpus)")))
    recording = read(path, input=1, output=2)
    assert (recording.drive_unit, recording.response_unit) == ("drive units", "response units")
    assert [warning.split(": ")[1] for warning in recording.warnings] == [
        '"CH1" is no unit that is known, and none was taken.',
        '"wumpus" is no unit that is known, and none was taken.',
    ]


# What is refused ----------------------------------------------------------------------------------

REFUSED = {
    "empty": ("", {}, "expected rows of numbers, found an empty file"),
    "a factor in a name": (
        lines_of(names=("time_s", "monitor (1 V = 10 V drive) [V]", "displacement_um")),
        {},
        "a name without a factor, found .*; give --unit drive=V",
    ),
    "a sensitivity in a name": (
        lines_of(names=("time_s", "voltage_V", "sensor [V] (10 um/V)")),
        {},
        "a name without a factor, found .*; give --unit response=V",
    ),
    "a divided name": (
        lines_of(names=("time_s", "voltage/10 [V]", "displacement_um")),
        {},
        "a name without a factor, found .*; give --unit drive=V",
    ),
    "force and motion": (
        lines_of(names=("Time [s]", "Extension [mm]", "Load [N]")),
        {},
        "columns for input, found .*; give --input 'Load ",
    ),
    "two voltages": (
        lines_of(names=("time_s", "CH1_V", "CH2_V")),
        {},
        "give --input CH1_V and --output CH2_V, or --input CH2_V and --output CH1_V",
    ),
    "a time without a name": (
        lines_of(names=("device", "u_V", "x_um")),
        {},
        "a time column or a rate, .*; give --time device, in even steps, or --rate",
    ),
    "only comments": ("# a\n\n", {}, "found an empty file"),
    "a list of JSON": ('[{"time_s": 0, "u": 1}]', {}, "found JSON; save its arrays as"),
    "only names": ("time_s,u,y\n", {}, "found only a line of names"),
    "ten samples": (lines_of()[:11], {}, "expected at least 32 samples, found 10"),
    "one sample": (lines_of()[:2], {}, "expected at least 32 samples, found 1"),
    "binary": (b"\x89HDF\r\n\x1a\n\x00\x00", {}, "expected text, found binary data"),
    "half a utf-16": (b"\xff\xfea", {}, "expected text, found binary data"),
    "one endless line": ("1," * 60_000, {}, "one sample per line, found a line of 120000"),
    "no time": (
        lines_of(DRIVE, RESPONSE, names=("u", "y")),
        {},
        "expected a time column or a rate.*give --rate such as 200Hz",
    ),
    "no time nor names": (lines_of(DRIVE, RESPONSE, names=()), {}, "a time column or a rate"),
    "strange names": (
        lines_of(names=("a", "b", "c")),
        {},
        'for input and output, found 3 .*"a", "b", "c"; give --time a and --input b',
    ),
    "three nameless": (
        lines_of(DRIVE, RESPONSE, RESPONSE, names=()),
        {"rate": 200},
        r"found 3 column\(s\) without names; give --input and --output",
    ),
    "one told": (lines_of(names=()), {"input": 1}, "columns for output, .*--time 0 and --output 2"),
    "two responses": (
        lines_of(names=("u_V", "x_um", "y_um")),
        {"rate": 200},
        'one column for output, found "x_um" .*, "y_um" .*; give --output x_um or --output y',
    ),
    "twice the same": (lines_of(), {"input": 1, "output": 1}, "--input 1, --output 1"),
    "no such name": (lines_of(), {"input": "w"}, 'a column "w", found .*"voltage_V".*--input'),
    "index too large": (lines_of(), {"output": 3}, 'a column "3".* index from 0 to 2'),
    "index negative": (lines_of(), {"output": -1}, 'a column "-1"'),
    "name twice": (lines_of(names=("t", "u", "u")), {"output": "u"}, 'one column "u", found'),
    "constant response": (
        lines_of(TIME, RESPONSE, 0 * TIME),
        {},
        "response: expected a signal that varies, found the constant 0",
    ),
    "unknown unit told": (lines_of(), {"input_unit": "wumpus"}, '--unit drive=wumpus: .*"wumpus"'),
    "time in volts": (
        lines_of(names=("t [V]", "u", "y")),
        {},
        'column "t \\[V\\]": expected a unit of what "t" speaks of',
    ),
    "rate in seconds": (lines_of(), {"rate": "5 ms"}, "--rate: expected a value in Hz"),
    "rate zero": (lines_of(), {"rate": 0}, "--rate: expected a positive rate"),
    "names too few": (
        ["a,b", *lines_of()[1:]],
        {},
        r"line 1: expected 3 column name\(s\), found 2",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(put, case):
    content, options, sentence = REFUSED[case]
    path = put(content)
    with pytest.raises(InputError, match=rf"^{path}.*{sentence}.*\.$") as refusal:
        read(path, **options)
    assert "; " in str(refusal.value)


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("0.075,abc,1.5", 'column "voltage_V": expected a number, found "abc"; correct it'),
        ("0.075,,1.5", 'column "voltage_V": expected a number, found ""'),
        ("0.075,1.5,nan", 'column "displacement_um": expected a finite number, found "nan"'),
        ("0.075,-inf,1.5", 'column "voltage_V": expected a finite number, found "-inf"'),
        ("0.075,1e200,1.5", 'column "voltage_V": expected a finite number, found "1e200"'),
        ("0.075,1_0,1.5", 'column "voltage_V": expected a number, found "1_0"'),
        ("0.075,1.5", r"expected 3 column\(s\), found 2"),
        ("0.075,1.5,1.5,1.5", r"expected 3 column\(s\), found 4"),
        ("0.07,1.5,1.5", 'column "time_s": expected time to increase, found 0.07 after 0.07'),
        ("0.065,1.5,1.5", 'column "time_s": expected time to increase, found 0.065 after 0.07'),
        (
            "0.0751,1.5,1.5",
            'column "time_s": expected a step of 0.005 s, found 0.0751 after 0.07; give --resample '
            "200Hz",
        ),
    ],
)
def test_refused_with_its_line_and_column(put, line, sentence):
    lines = lines_of()
    lines[16] = line
    path = put(lines)
    with pytest.raises(InputError, match=f"^{path}, line 17[,:] ?{sentence}"):
        read(path)
    path = put(["# a comment", "", *lines])
    with pytest.raises(InputError, match=f"^{path}, line 19[,:] ?{sentence}"):
        read(path)


def test_refused_in_a_nameless_file_by_index(put):
    lines = lines_of(names=(), separator="\t")
    lines[6] = lines[6].replace(repr(float(DRIVE[6])), "off")
    path = put(lines, "loop.dat")
    with pytest.raises(
        InputError, match=f'^{path}, line 7, column 1: expected a number, found "off"'
    ):
        read(path)


def test_a_decimal_point_among_decimal_commas_is_not_guessed(put):
    lines = [line.replace(".", ",") for line in lines_of(separator=";")]
    lines[9] = "0,04;1.234;5,5"
    with pytest.raises(InputError, match=r'line 10, .* a number, found "1.234"'):
        read(put(lines))


def test_files_that_cannot_be_opened(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"absent.csv: .*no such file.*; check the path"):
        read(tmp_path / "absent.csv")
    with pytest.raises(InputError, match="is a directory"):
        read(tmp_path)
    with pytest.raises(InputError, match="null"):
        read("a\0b")

    def deny(path, *args, **options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", deny)
    with pytest.raises(InputError, match="permission denied"):
        read("loop.csv")


# Anything at all ----------------------------------------------------------------------------------


def reads_or_refuses(content: bytes, options: dict) -> None:
    """Assert that only a Recording, fit to be examined, or one sentence comes out."""
    with tempfile.NamedTemporaryFile(suffix=".csv") as file, warnings.catch_warnings():
        warnings.simplefilter("error")
        file.write(content)
        file.flush()
        try:
            recording = read(file.name, **options)
        except InputError as error:
            assert str(error).endswith(".")
            assert "\n" not in str(error)
            return
        recording.checks()
        recording.static_stretches()
        recording.drive_period()


OPTIONS = st.fixed_dictionaries(
    {},
    optional={
        **{name: st.sampled_from([0, 1, 2, "1", "voltage_V", -1, 9]) for name in ("time", "input")},
        "output": st.sampled_from([0, 2, "2", "displacement_um"]),
        "rate": st.sampled_from([200, "200Hz", "0", "wumpus", 1e-320]),
        "output_unit": st.sampled_from(["nm", "wumpus"]),
    },
)


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=300) | st.text(max_size=200).map(str.encode), OPTIONS)
@example(b'"', {})
@example(b"\x85\n1,2,3\n", {})
def test_random_bytes(content, options):
    reads_or_refuses(content, options)


@settings(max_examples=250, deadline=None)
@given(st.data())
def test_mangled_tables(data):
    separator = data.draw(st.sampled_from([",", ";", "\t", " "]))
    names = data.draw(st.sampled_from([NAMES, (), ("t", "u", "y"), ("a [s]", "b [V]", "c (um)")]))
    text = "\n".join(lines_of(names=names, separator=separator))
    for _ in range(data.draw(st.integers(0, 3))):
        start = data.draw(st.integers(0, len(text)))
        stop = start + data.draw(st.integers(0, 30))
        junk = st.sampled_from(
            [",", '"', "\n", "nan", "1e308", "-1e99", "5e-324", "#", "µ", "\x00"]
        )
        text = text[:start] + data.draw(junk | st.text(max_size=4)) + text[stop:]
    reads_or_refuses(
        text.encode(data.draw(st.sampled_from(["utf-8", "utf-16"]))), data.draw(OPTIONS)
    )


# Out ----------------------------------------------------------------------------------------------
