"""The command posterior."""

import json
from dataclasses import replace

import numpy as np
import pytest

import fracjax as fj
import fracjax._fit
from fracjax._cli import run
from tests.posterior.helpers import TIMES, diagnosis_file


@pytest.mark.slow
def test_the_command_says_when_a_chain_has_not_converged(tmp_path, cubic, capsys, monkeypatch):
    (take,) = cubic.preparation.takes
    recording = take.recording
    columns = np.stack([TIMES, recording.drive, recording.response], axis=1)
    path, out = tmp_path / "loop.csv", tmp_path / "out"
    named = replace(
        cubic,
        model=fj.Model(cubic.model.block, "creep"),
        preparation=replace(
            cubic.preparation,
            takes=(replace(take, recording=replace(recording, source=str(path))),),
        ),
    )
    monkeypatch.setattr(fracjax._fit, "fit", lambda model, recordings, **options: named)
    head = "time_s,voltage_V,displacement_um"
    np.savetxt(path, columns, delimiter=",", header=head, comments="")
    call = ["posterior", str(path), "--model", "creep", "--out", str(out), "--quiet"]
    assert run([*call, "--noise-model", "white", "--steps", "100"]) == 3
    _, err = capsys.readouterr()
    assert "did not converge in 100 steps" in err
    assert err.count("\n") == 1
    assert not fj.load_posterior(out).converged
    doubted = diagnosis_file(tmp_path, verdict="unexplained", model="creep")
    again = [*call, "--noise-model", "white", "--resume", "--json", "--diagnosis", str(doubted)]
    assert run([*again, "--steps", "4000"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["converged"]
    assert "intervals hold only if the model is right" in told["sentence"]
    assert told["doubt"] in (out / "report.html").read_text(encoding="utf-8")
    assert 100 < told["steps"] < 4000
    names = {"posterior.nc", "posterior.json", "report.html", "fit.json", "chain.h5"}
    assert {p.name for p in out.iterdir()} == names
    assert run([*again, "--noise-model", "measured"]) == 2
    assert (
        "expected a chain with noise model measured, found one with white"
        in capsys.readouterr().err
    )
