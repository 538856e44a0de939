"""A known loop, written in random combinations of what instruments write, is read back exactly or
refused in a sentence."""

import tempfile
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fracjax._io import read
from fracjax._recording import InputError, conversion

COUNT = 48
DRIVE = [f"{50 - 50 * np.cos(k / 4):.4f}" for k in range(COUNT)]
RESPONSE = [f"{1043.7 - 1044.2 * np.cos(k / 4 - 0.2):.3f}" for k in range(COUNT)]
UNITS = ("s", "V", "um")
NAMES = {
    "plain": ("time", "voltage", "displacement"),
    "german": ("Zeit", "Spannung", "Weg"),
    "french": ("Temps", "Tension", "Déplacement"),
    "chinese": ("时间", "电压", "位移"),
    "japanese": ("時間", "電圧", "変位"),
    "russian": ("Время", "Напряжение", "Перемещение"),
    "letters": ("t", "u", "y"),
    "channels": ("X", "CH1", "CH2"),
}
STYLES = {
    "brackets": "{} [{}]",
    "parentheses": "{}({})",
    "stroke": "{}/{}",
    "spaced stroke": "{} / {}",
    "comma": "{}, {}",
    "underscore": "{}_{}",
    "in": "{} in {}",
    "blank": "{} {}",
    "row": "{}",
    "row in brackets": "{}",
    "none": "{}",
}
PREAMBLES = (
    "Operator{s}lab",
    "Date: 2024-02-13",
    "Instrument = scope 7",
    "Record Length{s}48",
    "Vertical Scale{s}20{s}2",
    "# made by a program",
    "; exported",
    "Measurement of a stack",
    "",
    "Gain{s}1.5{s}2.5{s}3.5",
    "12{s}13",
    "***End_of_Header***",
)
TIMES = (
    "s",
    "ms",
    "us",
    "min",
    "dates",
    "german dates",
    "clock",
    "count",
    "none",
    "stated",
    "interval",
)


ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "cp1252", "gb18030", "shift_jis", "cp1251")


def fits(text: str, encoding: str) -> bool:
    """Whether an encoding has all characters of a text."""
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return False
    return True


def stamps(kind: str) -> list[str]:
    """The times of samples at 500 Hz as text."""
    begin = datetime(2024, 2, 13, 10, 21, 58)
    moments = [begin + timedelta(milliseconds=2 * k) for k in range(COUNT)]
    if kind == "dates":
        return [m.strftime("%Y-%m-%d %H:%M:%S.%f")[:-3] for m in moments]
    if kind == "german dates":
        return [m.strftime("%d.%m.%Y %H:%M:%S.%f")[:-3] for m in moments]
    if kind == "clock":
        return [m.strftime("%H:%M:%S.%f")[:-3] for m in moments]
    if kind == "count":
        return [str(k + 1) for k in range(COUNT)]
    scale, digits = {"s": (1, 4), "ms": (1e3, 1), "us": (1e6, 0), "min": (1 / 60, 9)}[kind]
    return [f"{0.002 * k * scale:.{digits}f}" for k in range(COUNT)]


@st.composite
def written(draw) -> tuple[bytes, dict, dict]:
    """The bytes of a file, the options to read it with, and the units it is in."""
    separator = draw(st.sampled_from([",", ";", "\t", "|", " ", "  "]))
    comma = draw(st.booleans())
    quoted = draw(st.booleans()) or (comma and separator == ",")
    kind = draw(st.sampled_from(TIMES))
    style = draw(st.sampled_from(list(STYLES)))
    names = list(NAMES[draw(st.sampled_from(list(NAMES)))])
    units = [
        kind if kind in ("s", "ms", "us", "min") else "s",
        draw(st.sampled_from(["V", "kV", "mV"])),
        draw(st.sampled_from(["um", "nm", "mm", "µm", "mrad"])),
    ]
    columns = [list(DRIVE), list(RESPONSE)]
    if comma:
        columns = [[cell.replace(".", ",") for cell in column] for column in columns]
    options: dict = {}
    lines = [
        line.format(s=separator) for line in draw(st.lists(st.sampled_from(PREAMBLES), max_size=4))
    ]
    if kind in ("none", "stated", "interval"):
        names, units = names[1:], units[1:]
        if kind == "none":
            options["rate"] = 500
        else:
            said = ["Sampling rate", "500 Hz"] if kind == "stated" else ["Sample Interval", "0.002"]
            lines.append(draw(st.sampled_from([separator, ": ", " = "])).join(said))
    else:
        times = stamps(kind)
        if comma and kind not in ("dates", "german dates", "clock"):
            times = [cell.replace(".", ",") for cell in times]
        columns.insert(0, times)
        if kind == "count":
            options["rate"] = 500
            names[0], units[0] = "Sample", ""
    heads = [STYLES[style].format(n, u) if u else n for n, u in zip(names, units, strict=True)]

    def row(cells: list[str]) -> str:
        if quoted or any(
            (separator.strip(" ") and separator in c) or (separator.isspace() and " " in c)
            for c in cells
        ):
            cells = [f'"{cell}"' for cell in cells]
        return separator.join(cells) + end

    end = draw(st.sampled_from(["", "", separator if separator.strip() else ""]))
    lines.append(draw(st.sampled_from(["", "# "])) * (not quoted) + row(heads))
    if style.startswith("row"):
        lines.append(row([f"[{u}]" if "brackets" in style else u for u in units]))
    if draw(st.booleans()):
        lines.append("")
    lines += [row(list(cells)) for cells in zip(*columns, strict=True)]
    lines += draw(st.sampled_from([[], [], [""], ["End of data"]]))
    if names[-1] == "CH2" and draw(st.booleans()):
        options |= {"input": "CH1", "output": "CH2"}
    text = draw(st.sampled_from(["\n", "\r\n"])).join(lines) + "\n"
    order = draw(st.permutations(ENCODINGS))
    encoding = next(each for each in order if fits(text, each))
    content = text.encode(encoding)
    told = {"drive": units[-2], "response": units[-1]}
    return content, options, told if style != "none" else {}


def is_utf8(content: bytes) -> bool:
    """Whether bytes are text in UTF-8."""
    try:
        content.decode()
    except UnicodeDecodeError:
        return False
    return True


def is_right(content: bytes, options: dict, units: dict) -> bool:
    """Whether a file is read back exactly; True, or False where it is refused in a sentence."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "loop.csv"
        path.write_bytes(content)
        try:
            recording = read(path, **options)
        except InputError as error:
            assert str(error).endswith(".")
            assert str(error).isprintable()
            return False
    np.testing.assert_array_equal(
        recording.drive, np.array(DRIVE, float), err_msg=content.decode("latin-1")
    )
    np.testing.assert_array_equal(recording.response, np.array(RESPONSE, float))
    if not any("s was assumed" in warning for warning in recording.warnings):
        assert recording.rate == pytest.approx(500, rel=1e-3)
    for role, written in units.items():
        stated = getattr(recording, f"{role}_unit")
        if stated == f"{role} units" and not written.isascii() and not is_utf8(content):
            continue  # of one letter no encoding can be told: then there is no unit, not another
        assert conversion(stated, written) == pytest.approx(1, rel=1e-12)
    if not units:
        assert (recording.drive_unit, recording.response_unit) == ("drive units", "response units")
    return True


@settings(max_examples=150)
@given(written())
def test_read_exactly_or_refused(example):
    is_right(*example)


@pytest.mark.slow
@pytest.mark.timeout(900)
@settings(max_examples=2000)
@given(written())
def test_two_thousand_files_are_read_exactly_or_refused(example):
    is_right(*example)
