"""The commands diagnose and demo."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import fracjax as fj
from docs.tables import README, ROOT
from fracjax._cli import run
from fracjax._io import read
from tests.cli.helpers import FOLDER, written
from tests.helpers import without_progress

TUTORIAL = ROOT / "docs" / "tutorial.md"


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


def test_small_tones_leave_tables_of_the_frequency_response(loop, quick, monkeypatch, capsys):
    angles = 2 * np.pi * np.outer([3, 5, 9], np.arange(600)) / 150
    tones = np.cos(angles).sum(axis=0)
    recording = fj.Recording(50 + tones, 0.2 * tones, 1e-3, "V", "um", "tones")
    both = 2 * fj.best_linear_approximations(recording)
    monkeypatch.setattr("fracjax._diagnose._result.best_linear_approximations", lambda _: both)
    assert run(["diagnose", loop, "--out", "results"]) == 0
    tables = {"frequency_response_1.csv", "frequency_response_2.csv"}
    assert written() == {"diagnosis.json", "fit.json", "report.html", *tables}
    table = fj.read_frequency_table(FOLDER / "frequency_response_2.csv")
    assert abs(table.response) == pytest.approx(0.2)


def squeezed(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.slow
def test_the_demo_ends_as_the_readme_says(empty_folder, capsys):
    """What README and tutorial show of the demonstration is what the program prints."""
    assert run(["demo"]) == 0
    assert run(["info", "loop.csv"]) == 0
    assert run(["fit", "loop.csv", "--model", "foh", "--holdout", "other.csv", "--out", "out"]) == 0
    printed = squeezed(capsys.readouterr().out)
    # Diagnosis and fit say one thing of the same model on the same data.
    assert len({*re.findall(r"RMSE, held-out data (\S+)", printed)}) == 1
    numbers = [float(each) for each in re.findall(r"\d+\.\d+", printed)]
    for page, prose in ((README, r"!\[.*?^## Install"), (TUTORIAL, r"^## 2\..*?^## 3\.")):
        text = page.read_text(encoding="utf-8")
        blocks = re.findall(r"^```text\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
        assert blocks
        pieces = re.split(r"…|\n", "\n".join(blocks))
        assert [each for each in map(squeezed, pieces) if each not in printed] == []
        shown = re.search(prose, text, re.DOTALL | re.MULTILINE)
        assert shown is not None
        sentences = re.sub(r"```.*?```", "", shown[0], flags=re.DOTALL)
        quoted = re.findall(r"(?<![\w.])\d*\.\d+(?=\D)", sentences)
        assert quoted
        for each in quoted:
            digits = len(each.partition(".")[2])
            assert float(each) in {round(number, digits) for number in numbers}, each


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
