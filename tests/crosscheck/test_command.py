"""The command crosscheck."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

import fracjax as fj
from fracjax._cli import run
from fracjax._crosscheck import Crosscheck
from fracjax._report._text import crosscheck_figures
from tests.crosscheck.helpers import recording
from tests.helpers import without_progress


@pytest.fixture
def loop(empty_folder) -> str:
    """A recording's file, in an empty folder."""
    taken = recording()
    signals = {"voltage_V": taken.drive, "displacement_um": taken.response}
    fj.write("loop.csv", {"time_s": taken.times} | signals)
    return "loop.csv"


def answer(monkeypatch, result: Crosscheck) -> list[dict]:
    """Let the command find this, and note what it asked."""
    calls: list[dict] = []

    def crosscheck(model, recordings, *, progress, **options):
        progress("fitting")
        calls.append({"model": model.name, "recordings": recordings, **options})
        return result

    monkeypatch.setattr(fj._crosscheck, "crosscheck", crosscheck)
    return calls


def test_the_command_prints_one_table(loop, checked, monkeypatch, capsys):
    calls = answer(monkeypatch, checked)
    asked = ["--fix", "beta=-0.1", "--bound", "alpha=0..0.5", "--mask", "1 s..1.1 s"]
    call = ["crosscheck", loop, "--model", "foh", "--seed", "7", "--settle", "0.1 s"]
    assert run([*call, *asked]) == 0
    out, err = capsys.readouterr()
    assert without_progress(err) == ""
    assert out.startswith(
        "foh on three_tones.csv: no method has a smaller error than the gradient fit"
    )
    assert "5 of 5 others agree with it" in out
    heads, rows = crosscheck_figures(checked)
    assert {len(row) for row in rows} == {len(heads)}
    for label in (
        "rms error",
        "rel. error",
        "alpha",
        "k_h",
        "evaluations",
        "seconds",
        "agrees",
    ):
        assert f"\n{label} " in out
    assert "Written" not in out
    assert calls[0] | {"recordings": None} == {
        "model": "foh", "recordings": None, "history": None, "settling": "0.1 s", "seed": 7,
        "fixed": {"beta": -0.1}, "bounds": {"alpha": (0.0, 0.5)}, "mask": ((1.0, 1.1),),
    }  # fmt: skip
    assert [path.name for path in Path.cwd().iterdir()] == ["loop.csv"]


def test_the_command_writes_and_prints_json(loop, sabotaged, monkeypatch, capsys):
    answer(monkeypatch, sabotaged)
    call = ["crosscheck", loop, loop, "--model", "foh", "--out", "results"]
    assert run([*call, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads(Path("results/crosscheck.json").read_text(encoding="utf-8"))
    assert {p.name for p in Path("results").iterdir()} == {
        "crosscheck.json", "fit.json", "report.html",
    }  # fmt: skip
    # What is answered is of another recording, so that the folder would be held for another's.
    call = ["crosscheck", loop, loop, "--model", "foh"]
    assert run([*call, "--out", "printed"]) == 0
    assert f"Warning: {sabotaged.warning}" in capsys.readouterr().out
    assert run([*call, "--out", "quiet", "--quiet"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("options", "kept"), [([], "nothing was saved"), (["--out", "results"], "was saved in results")]
)
def test_a_gradient_fit_without_convergence_ends_with_3(
    options, kept, loop, checked, monkeypatch, capsys
):
    answer(monkeypatch, replace(checked, fit=replace(checked.fit, converged=False)))
    assert run(["crosscheck", loop, "--model", "foh", *options]) == 3
    err = without_progress(capsys.readouterr().err)
    assert err.startswith("The fit of foh did not converge")
    assert kept in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("crosscheck", "Missing argument 'RECORDING...'"),
        ("crosscheck loop.csv", "Missing option '--model'"),
        ("crosscheck none.csv --model foh", "none.csv: expected a file"),
        ("crosscheck loop.csv --model nope", 'model "nope": expected names'),
        ("crosscheck loop.csv --model foh --settle 9s", "--settle: expected a time"),
    ],
)
def test_unusable_calls(call, said, loop, capsys):
    assert run(call.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == 1
