"""The one sentence that refuses what cannot be used, nothing being left behind."""

import os
import pickle
import re
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from fracjax._io import _FORMATS, read, write
from fracjax._recording import InputError
from tests.io.layouts import (
    BINARY,
    COUNT,
    DRIVE,
    LOOP,
    RESPONSE,
    SIGNALS,
    TIME,
    is_the_loop,
    matlab_73,
    put_arrays,
    refused,
    rows_of,
    with_value,
    workbook,
)


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


UNUSABLE = {
    "nan": (
        {**LOOP, "voltage_V": with_value(DRIVE, np.nan)},
        'voltage_V", sample 16: .* "?nan"?[;,]',
    ),
    "inf": ({**LOOP, "displacement_um": with_value(RESPONSE, -np.inf)}, "sample 16: .* -inf[;,]"),
    "overload": ({**LOOP, "voltage_V": with_value(DRIVE, 1e300)}, "sample 16: .* 1e.300[;,]"),
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
        sentence = sentence.replace(
            'voltage_V", sample 16: .* "?nan"?', "cell B18: .* an empty cell"
        )
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
    assert f'{path}, sheet "Run 1", cell B18: expected a ' in sentence
    assert f"number, found {found}" in sentence


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
