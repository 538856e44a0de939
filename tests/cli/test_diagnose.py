"""The commands diagnose and demo."""

import json
from pathlib import Path

import pytest

from fracjax._cli import run
from fracjax._io import read
from tests.cli.helpers import FOLDER, written
from tests.helpers import without_progress


def test_diagnose(loop, quick, capsys):
    options = ["--holdout", loop, "--repeat", loop, "--noise", "70 nm", "--settle", "0"]
    options += ["--mask", "10 ms..20 ms", "--mask", "1 s..2 s"]
    assert run(["diagnose", loop, "--model", "foh", "--out", "results", *options]) == 0
    (told,) = quick
    assert told["mask"] == ((0.01, 0.02), (1.0, 2.0))
    assert told["noise"] == "70 nm"
    assert told["settling"] == "0"
    assert told["history"] is None
    assert told["holdout"].source == loop
    assert [each.source for each in told["repeat"]] == [loop]
    out, err = capsys.readouterr()
    assert out.startswith("Model and recording agree.\n")
    assert "RMSE, held-out data" in out
    assert "The residual does not exceed the noise anywhere." in out
    assert without_progress(err) == ""
    assert written() == {"diagnosis.json", "fit.json", "report.html"}


def test_diagnose_as_json(loop, quick, capsys):
    assert run(["diagnose", loop, "--model", "foh", "--out", "results", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((FOLDER / "diagnosis.json").read_text())


def test_diagnose_without_a_model(loop, quick, capsys):
    assert run(["diagnose", loop, "--out", "results"]) == 0
    (told,) = quick
    assert told["model"] is None
    assert written() == {"diagnosis.json", "fit.json", "report.html"}


def test_demo(quick, capsys):
    Path("other.csv").write_text("mine")
    assert run(["demo"]) == 0
    assert read("loop.csv").rate == pytest.approx(150)
    assert Path("other.csv").read_text() == "mine"
    (told,) = quick
    assert told["model"].name == "foh"
    assert len(told["recordings"][0]) == 3900
    assert told["holdout"].source.endswith("heldout.csv")
    out, _ = capsys.readouterr()
    assert "s  diagnosing" in out
    assert out.rstrip().endswith("fracjax-demo/report.html")
