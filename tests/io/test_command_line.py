"""What the command line says and does with files of all kinds."""

import json

import numpy as np
import pytest

from fracjax._batch import FITS
from fracjax._cli import run
from fracjax._cli._batch import _spreads
from fracjax._compensate import Trajectory
from fracjax._io import read, write
from fracjax._recording import InputError
from tests.io.layouts import DRIVE, LOOP, RESPONSE, TIME


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Every test in an empty folder, with no cache of compiled programs."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "")


def test_info_of_two_files(capsys):
    write("u.csv", {"time_s": TIME, "voltage_V": DRIVE})
    write("y.csv", {"time_s": TIME, "displacement_um": RESPONSE})
    assert run(["info", "--drive", "u.csv", "--response", "y.csv", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["source"] == "u.csv and y.csv"
    assert (told["samples"], told["rate_Hz"]) == (64, pytest.approx(200))
    assert run(["info", "u.csv"]) == 2
    assert "or this file as --drive and that of the other as --response." in capsys.readouterr().err
    assert run(["info", "--drive", "u.csv"]) == 2
    assert "Give --drive and --response together" in capsys.readouterr().err
    assert run(["info"]) == 2
    assert "Missing argument 'RECORDING" in capsys.readouterr().err


def test_info_of_segments(capsys):
    times = np.concatenate([TIME, TIME + 5])
    twice = {"voltage_V": np.tile(DRIVE, 2), "displacement_um": np.tile(RESPONSE, 2)}
    write("loop.csv", {"time_s": times} | twice)
    assert run(["info", "loop.csv", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [one["samples"] for one in told] == [64, 64]
    assert "two segments of 0.32 s with gaps of 4.685 s" in told[0]["warnings"][0]
    assert run(["info", "loop.csv", "--segment", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["source"] == "loop.csv, segment 2 of 2"
    call = ["posterior", "loop.csv", "--model", "creep", "--out", "p"]
    assert run(call) == 2
    assert "give --segment 1 to 2" in capsys.readouterr().err


@pytest.mark.parametrize("suffix", ["svg", "png", "pdf"])
def test_info_draws_what_was_understood(tmp_path, suffix, capsys):
    write("loop.csv", LOOP)
    assert run(["info", "loop.csv", "--plot", f"loop.{suffix}"]) == 0
    assert capsys.readouterr().out.endswith(f"Written: loop.{suffix}\n")
    begins = {"svg": b"<?xml", "png": b"\x89PNG", "pdf": b"%PDF"}[suffix]
    assert (tmp_path / f"loop.{suffix}").read_bytes().startswith(begins)
    assert run(["info", "loop.csv", "--plot", "loop.doc"]) == 2
    assert "a file ending in .svg, .png or .pdf" in capsys.readouterr().err


def test_bad_samples_are_masked_where_that_is_asked(capsys):
    response = RESPONSE.copy()
    response[20:23] = np.nan
    write("loop.csv", LOOP | {"displacement_um": response})
    assert run(["info", "loop.csv"]) == 2
    assert "one of 3 that are no numbers from 0.1 to 0.11 s" in capsys.readouterr().err
    call = ["fit", "loop.csv", "--model", "creep", "--out", "out", "--fix", "mu=0.1", "--json"]
    for mask in ("bad", "0.1 s..0.11 s"):
        assert run([*call, "--mask", mask]) == 0
        assert json.loads(capsys.readouterr().out)["samples_left_out"] == [3]
    assert run([*call, "--mask", "0.2 s..0.3 s"]) == 2
    assert 'found "nan"' in capsys.readouterr().err


def test_rows_told_by_the_call(capsys):
    with open("loop.csv", "w") as file:
        file.write("1,2,3\n4,5,6\n7,8,9\nWeg;Spannung\num,V,s\nWeg,Spannung,Zeit\n")
        np.savetxt(file, np.stack([RESPONSE, DRIVE, TIME], axis=1), delimiter=",")
    call = ["info", "loop.csv", "--skip-rows", "4", "--names-row", "6", "--units-row", "5"]
    assert run([*call, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["drive"]["column"], told["response"]["unit"]) == ("Spannung", "um")
    write("loop.h5", LOOP)
    assert run(["info", "loop.h5", "--skip-rows", "1"]) == 2
    assert "rows to skip only in text or XLSX" in capsys.readouterr().err


def test_spreads_of_a_batch_are_in_one_unit():
    import pandas as pd

    rows = pd.DataFrame(
        {
            "status": ["fitted"] * 5,
            "rmse": [1.0, 1.2, 1.1, 900.0, 1000.0],
            "response_unit": ["um", "um", "um", "nm", "nm"],
            "k.value": [0.1, 0.12, 0.11, 104.0, 110.0],
            "k.standard_error": [0.01] * 5,
            "k.unit": ["um/V", "um/V", "um/V", "nm/V", "nm/V"],
        }
    )
    _, table = _spreads(rows)
    assert [(line[0], line[2], line[4]) for line in table] == [
        ("RMSE", "1", "µm"),
        ("k", "0.11", "µm/V"),
    ]
    assert FITS.endswith(".parquet")


def test_what_is_simulated_comes_in_the_unit_asked_for():
    write("u.csv", {"time_s": TIME, "voltage_V": DRIVE})
    for unit in ("um", "nm"):
        call = ["simulate", "u.csv", "--model", "creep", "--out", f"{unit}.csv", "--quiet"]
        assert run([*call, "--output-unit", unit]) == 0
    assert (
        run(["simulate", "u.csv", "--model", "creep", "--out", "x.csv", "--output-unit", "q"]) == 2
    )
    assert read("nm.csv").response_unit == "nm"


def test_a_trajectory_in_another_unit_is_converted():
    trajectory = Trajectory(1000 * RESPONSE, 0.005, "nm")
    converted = trajectory.in_unit("um")
    assert converted.response_unit == "um"
    np.testing.assert_allclose(converted.response, RESPONSE)
    with pytest.raises(InputError, match="a motion in V"):
        trajectory.in_unit("V")
