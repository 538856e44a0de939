"""The command batch."""

import io
import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from fracjax._batch import FITS
from fracjax._batch._parts import Parts
from fracjax._cli import run
from tests.batch.helpers import fit_by
from tests.helpers import failure


def test_the_command(data, quick, capsys):
    (data / "5.csv").write_text("nonsense")
    call = ["batch", str(data), "--model", "creep", "--out", "results", "--bound", "mu=0.001..0.1"]
    call += ["--mask", "1 s..2 s", "--loss", "huber"]
    assert run([*call, "--settle", "250ms", "--seed", "3", "--history", "rest"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("creep: of 7 recordings 6 fitted, 1 unreadable; of the fitted, 0 with a ")
    assert "Unreadable: " in out
    assert out.endswith(f"Written: results/{FITS}, results/fits.csv, results/report.html\n")
    assert err == ""
    told = (quick[0]["history"], quick[0]["settling"], quick[0]["seed"], quick[0]["starts"])
    assert told == ("rest", "250ms", 3, 4)
    told = {name: quick[0][name] for name in ("bounds", "mask", "loss")}
    assert told == {"bounds": {"mu": (0.001, 0.1)}, "mask": ((1.0, 2.0),), "loss": "huber"}
    assert run([*call, "--seed", "1"]) == 2
    assert "give another --out" in failure(capsys)


def test_the_command_as_json_and_quiet(data, quick, capsys):
    call = ["batch", str(data), "--model", "creep", "--out", "results"]
    assert run([*call, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["counts"] == {"fitted": 7, "not converged": 0, "unreadable": 0, "failed": 0}
    assert (told["table"], told["unfitted"]) == (f"results/{FITS}", [])
    assert run([*call, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_the_command_where_fits_do_not_converge(data, quick, fitted, monkeypatch, capsys):
    failed = replace(fitted, converged=False)
    fit_by(monkeypatch, lambda *_, **__: failed)
    assert run(["batch", str(data), "--model", "creep", "--out", "results", "--quiet"]) == 3
    assert failure(capsys).startswith("7 of 7 fits did not converge; ")


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("batch --model creep --out results", "Missing argument 'PATH...'"),
        ("batch a.csv --out results", "Missing option '--model'"),
        ("batch a.csv --model nope --out results", 'model "nope": expected names'),
        ("batch *.csv --model creep --out results", "expected a pattern that matches files"),
        ("batch a.csv --model creep --out results --settle 9um", "expected a value in s"),
        ("batch a.csv --model creep --out results --cluster 127.0.0.1:9", "connection refused"),
    ],
)
def test_unusable_calls(call, said, capsys):
    assert run(call.split()) == 2
    assert said in failure(capsys)
    assert list(Path.cwd().iterdir()) == []


def test_where_nothing_can_be_read(capsys):
    assert run(["batch", "none.csv", "--model", "creep", "--out", "results", "--quiet"]) == 2
    assert "None of 1 recordings could be read; the first: " in failure(capsys)


def test_an_interrupted_command_says_what_it_kept(data, quick, fitted, monkeypatch, capsys):
    def write(self, rows):
        Parts_write(self, rows)
        raise KeyboardInterrupt

    Parts_write = Parts.write
    monkeypatch.setattr(Parts, "write", write)
    assert run(["batch", str(data), "--model", "creep", "--out", "results"]) == 130
    assert f"Interrupted; kept results/{FITS}." in capsys.readouterr().err


def test_a_bar_only_where_someone_watches(data, quick, monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    monkeypatch.setenv("TERM", "xterm")
    assert run(["batch", str(data), "--model", "creep", "--out", "results", "--json"]) == 0
    assert "7/7" in terminal.getvalue()
