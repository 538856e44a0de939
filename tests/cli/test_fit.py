"""The command fit: what it writes and prints, and how it ends early."""

import json
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

import fracjax._fit
from fracjax._cli import heed_interrupt, run
from fracjax._fit import load_model
from tests.cli.helpers import FOLDER, written
from tests.helpers import failure, without_progress


def test_fit_for_real(loop, capsys):
    assert run(["fit", loop, "--model", "creep", "--out", "results"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("creep describes loop.csv only in part: mu ended on its bound, with an ")
    assert without_progress(err) == ""
    assert written() == {"fit.json", "report.html"}
    assert set(load_model(FOLDER / "fit.json").parameters) == {"k_c", "mu"}


def test_options_reach_the_fit(loop, quick):
    call = ["fit", loop, loop, "--model", "foh", "--out", "results", "--history", "rest"]
    assert run([*call, "--settle", "250ms", "--seed", "3", "--input-unit", "mV"]) == 0
    (told,) = quick
    assert (told["history"], told["settling"], told["seed"]) == ("rest", "250ms", 3)
    assert [recording.drive_unit for recording in told["recordings"]] == ["mV", "mV"]


def test_several_models_are_compared(loop, quick, capsys):
    models = ["--model", "foh >> creep", "--model", "lfdh", "--model", "lfdh"]
    assert run(["fit", loop, *models, "--out", "results"]) == 0
    files = {"fit.json", "fit_foh-then-creep.json", "fit_lfdh.json", "comparison.json"}
    assert written() == files | {"report.html"}
    out, _ = capsys.readouterr()
    assert out.startswith("foh >> creep describes loop.csv best of 2 models by BIC")
    assert (FOLDER / "fit.json").read_text() == (FOLDER / "fit_foh-then-creep.json").read_text()


def test_what_is_asked_of_parameters_and_samples_reaches_the_fit(loop, quick):
    call = ["fit", loop, "--model", "foh", "--out", "results", "--loss", "huber"]
    asked = ["--fix", "k_p=0", "--bound", "beta=-0.2..0", "--prior", "alpha=0.1+-0.02"]
    more = ["--tie", "k_l=2*k_h", "--own", "k_h", "--mask", "0.1 s..0.2 s", "--mask", "1..2"]
    assert run([*call, *asked, *more]) == 0
    (told,) = quick
    assert (told["fixed"], told["bounds"]) == ({"k_p": 0.0}, {"beta": (-0.2, 0.0)})
    assert float(told["priors"]["alpha"].sd) == 0.02
    assert (told["tied"], told["own"]) == ({"k_l": ("k_h", 2.0)}, ("k_h",))
    assert told["mask"] == ((0.1, 0.2), (1.0, 2.0))
    assert told["loss"] == "huber"


def test_of_several_models_each_takes_what_speaks_of_its_parameters(loop, quick):
    call = ["fit", loop, "--model", "foh", "--model", "lfdh", "--out", "results"]
    assert run([*call, "--fix", "k_p=0", "--fix", "mu=0.2", "--fix", "wumpus=1"]) == 0
    assert [told["fixed"] for told in quick] == [
        {"k_p": 0.0, "wumpus": 1.0},
        {"mu": 0.2, "wumpus": 1.0},
    ]


def test_a_fit_with_options_for_real(loop, capsys):
    call = ["fit", loop, "--model", "creep", "--out", "results", "--loss", "student_t"]
    asked = ["--fix", "mu=0.02", "--mask", "0 s..0.5 s", "--profile", "k_c", "--holdout", loop]
    assert run([*call, *asked]) == 0
    out, _ = capsys.readouterr()
    assert "RMSE, held-out data" in out
    assert "Profile of k_c: 95 % from" in out
    assert "The residual is " in out
    told = json.loads((FOLDER / "fit.json").read_text())
    assert told["samples_left_out"] == [51]
    assert told["loss"]["name"] == "student_t"
    assert [profile["name"] for profile in told["profiles"]] == ["k_c"]
    page = (FOLDER / "report.html").read_text()
    for said in (
        "<h2>Residual</h2>",
        "Profiles: the rise",
        "weight or mask excluded 51 more samples",
        "Held out",
    ):
        assert said in page
    assert written() == {"fit.json", "comparison.json", "report.html"}


def test_json_is_all_that_is_printed(loop, quick, capsys):
    assert run(["fit", loop, "--model", "lfdh", "--out", "results", "--json"]) == 0
    one = json.loads(capsys.readouterr().out)
    assert one == json.loads((FOLDER / "fit.json").read_text())
    models = ["--model", "foh", "--model", "lfdh"]
    assert run(["fit", loop, *models, "--out", "results", "--json"]) == 0
    several = json.loads(capsys.readouterr().out)
    assert (several["best"], [row["bic"] for row in several["fits"]]) == ("foh", [2.0, 3.0])


@pytest.mark.parametrize("command", ["fit", "diagnose"])
def test_quiet(loop, quick, capsys, command):
    assert run([command, loop, "--model", "foh", "--out", "results", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_without_convergence_the_best_point_is_kept(loop, quick, fitted, monkeypatch, capsys):
    failed = replace(fitted, converged=False)
    monkeypatch.setattr(fracjax._fit, "fit", lambda *_, **__: failed)
    assert run(["fit", loop, "--model", "creep", "--out", "results", "--quiet"]) == 3
    assert failure(capsys, 3) == (
        "The fit of creep did not converge; its best point was saved in results."
    )
    assert written() == {"fit.json", "report.html"}


def test_an_interrupt_keeps_what_is_finished(loop, quick, monkeypatch, capsys):
    whole = fracjax._fit.fit

    def interrupted(model, *rest, **options):
        if model.name == "lfdh":
            raise KeyboardInterrupt
        return whole(model, *rest, **options)

    monkeypatch.setattr(fracjax._fit, "fit", interrupted)
    call = ["fit", loop, "--model", "foh", "--model", "lfdh", "--out", "results"]
    assert run(call) == 130
    assert "Interrupted; kept results/fit_foh.json." in capsys.readouterr().err
    assert written() == {"fit_foh.json"}
    assert run(["fit", loop, "--model", "lfdh", "--out", "other"]) == 130
    assert "nothing had been written yet" in capsys.readouterr().err
    assert not Path("other").exists()


def test_an_interrupt_is_not_lost_in_the_garbage_collector(monkeypatch):
    class Swallows:
        def __del__(self):
            raise KeyboardInterrupt

    def work():
        Swallows()
        for _ in range(100):
            time.sleep(0.02)

    monkeypatch.setattr(sys, "unraisablehook", heed_interrupt)
    # A shell lets what it starts in the background ignore the signal.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            work()
    finally:
        signal.signal(signal.SIGINT, before)
