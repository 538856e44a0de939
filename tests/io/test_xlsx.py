"""XLSX: the table of a sheet."""

import zipfile

import pytest

from fracjax._io import read
from fracjax._recording import InputError
from tests.io.layouts import (
    DRIVE,
    LOOP,
    RESPONSE,
    TIME,
    is_the_loop,
    rows_of,
    workbook,
)


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


def test_units_behind_the_numbers_of_cells(tmp_path):
    """As text of a sheet they count as they do in a file of text: minutes are not seconds."""
    cells = [
        [f"{t / 60:.12g} min", f"{u:.12g} kV", f"{y:.12g} nm"]
        for t, u, y in zip(TIME, DRIVE, RESPONSE, strict=True)
    ]
    book = workbook(tmp_path / "loop.xlsx", {"run": [["time", "voltage", "position"], *cells]})
    recording = read(book)
    assert recording.rate == pytest.approx(200, rel=1e-6)
    assert (recording.drive_unit, recording.response_unit) == ("kV", "nm")
    assert recording.drive == pytest.approx(DRIVE)
