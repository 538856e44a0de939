"""The command compensate."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fracjax as fj
import fracjax._compensate
from fracjax import blocks
from fracjax._cli import run
from fracjax._compensate import load_compensation
from fracjax._parameters import set_values
from fracjax._show import figure, quantity
from tests.compensate.helpers import COUNT, SINE, STEP, TIMES, model, wanted
from tests.helpers import without_progress


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> Path:
    """A fit.json of a creeping law, in volts and micrometres, its zero at -30 µm."""
    drive = 50 - 45 * np.cos(2 * np.pi * TIMES)
    response = fj.simulate(model(blocks.Creep(0.1, 0.01)), drive, STEP).response - 30
    noise = np.random.default_rng(1).normal(0, 1e-3, COUNT)
    recording = fj.Recording(drive, response + noise, STEP, "V", "um")
    path = tmp_path_factory.mktemp("fit") / "fit.json"
    columns = {"time_s": TIMES, "drive_V": drive, "displacement_um": recording.response}
    fj.write(path.with_name("recording.csv"), columns)
    fj.fit(fj.parse_model("creep"), recording, starts=1).save(path)
    return path


@pytest.fixture
def call(empty_folder, fitted):
    """The command in an empty folder with a trajectory, want.csv, in nanometres."""
    fj.write("want.csv", {"time_s": TIMES, "displacement_nm": 1000 * (0.8 * SINE - 29)})

    def command(*words: str) -> int:
        return run(["compensate", "want.csv", "--fit", str(fitted), "--out", "out", *words])

    return command


def test_the_command_writes_drive_result_and_report(call, capsys):
    assert call() == 0
    out, err = capsys.readouterr()
    assert out.startswith("creep follows want.csv; the drive is ")
    assert without_progress(err) == ""
    assert {path.name for path in Path("out").iterdir()} == {
        "drive.csv",
        "compensation.json",
        "report.html",
    }
    told = load_compensation("out/compensation.json")
    assert told.units == ("V", "um")
    assert told.offset == pytest.approx(-30, abs=0.01)
    drive = fj.read("out/drive.csv")
    np.testing.assert_array_equal(drive.drive, told.drive)
    np.testing.assert_allclose(drive.response, 0.8 * SINE - 29, atol=1e-9)
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert "follows want.csv" in page
    assert page.count("<svg") == 3
    assert 'href="http' not in page
    assert 'src="http' not in page


def test_the_error_to_expect_on_the_stage_is_that_of_held_out_data_or_else_of_the_fit(
    call, fitted, capsys
):
    """The inversion is exact to 1e-6, and what the model leaves is its noise of 1 nm in 30 um."""
    assert call() == 0
    content = json.loads(fitted.read_text(encoding="utf-8"))
    rms, noise = content["scores"]["rmse"], content["noise"]["sigma"]
    assert rms == pytest.approx(1e-3, rel=0.3)
    own = max(rms**2 - noise**2, 0) ** 0.5
    output = capsys.readouterr().out
    told = load_compensation("out/compensation.json")
    assert told.expected_error == pytest.approx(np.hypot(own, told.rms_error), rel=1e-6)
    assert f"On the stage expect {told.expected}." in output
    assert "as on the data it was fitted to" in output
    assert f"the sensor adds {quantity(noise, 'um')} of noise" in output
    assert "On the stage expect" in Path("out/report.html").read_text(encoding="utf-8")
    shutil.copy(fitted, "fit.json")
    rows = [{"model": "foh", "unseen": {"rmse": 9.0}}, {"model": "creep", "unseen": {"rmse": 0.5}}]
    Path("comparison.json").write_text(json.dumps({"rows": rows}), encoding="utf-8")
    words = ["compensate", "want.csv", "--fit", "fit.json", "--out", "again", "--json"]
    assert run(words) == 0
    error = json.loads(capsys.readouterr().out)["model_error"]
    assert error == {"rms": 0.5, "on": "held-out data", "noise": noise, "spread": None}
    Path("comparison.json").unlink()
    held_out = {"base_folds": [3.0, 4.0], "extended_folds": [1.0]}
    content = {"model": "creep", "held_out": held_out}
    Path("diagnosis.json").write_text(json.dumps(content), encoding="utf-8")
    words[words.index("again")] = "third"
    assert run(words) == 0
    error = json.loads(capsys.readouterr().out)["model_error"]
    assert error["rms"] == pytest.approx(12.5**0.5)
    assert error["spread"] == pytest.approx(3.5)  # the squares 9 and 16: 4.95/√2


def test_one_error_is_expected_of_the_model_and_of_the_limits(call, fitted, capsys):
    """As the mean squares of both, with the model's interval."""
    shutil.copy(fitted, "fit.json")
    content = {"model": "creep", "held_out": {"base_folds": [0.3, 0.4], "extended_folds": []}}
    Path("diagnosis.json").write_text(json.dumps(content), encoding="utf-8")
    words = ["--fit", "fit.json", "--limits", "0..60V"]
    assert call(*words) == 0
    told = load_compensation("out/compensation.json")
    error = told.model_error
    assert error is not None
    own = (0.125 - error.noise**2) ** 0.5
    assert told.expected_error == pytest.approx(np.hypot(own, told.rms_error))
    out = " ".join(capsys.readouterr().out.split())
    assert out.count("On the stage expect") == 1
    low, high = ((0.125 + sign * 1.96 * 0.035 - error.noise**2) ** 0.5 for sign in (-1, 1))
    assert f"({figure(low)} to {quantity(high, 'um')}) of the model, as on held-out data" in out
    assert "of the limits; the sensor adds" in out


def test_the_recorded_range_is_the_limit_unless_another_is_said(call, capsys):
    assert call() == 0
    told = load_compensation("out/compensation.json")
    assert told.limits == pytest.approx((5.0, 95.0), abs=0.01)
    assert call("--limits", "none") == 0
    assert load_compensation("out/compensation.json").limits is None


def test_limits_reach_the_inversion_and_the_verdict_is_no_failure(call, capsys):
    words = ["--limits", "-1..60000 mV", "--slew", "0.3 V/ms", "--offset", "-30 um"]
    assert call(*words, "--history", "rest", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads(Path("out/compensation.json").read_text(encoding="utf-8"))
    assert told["limits"] == [-0.001, 60.0]
    assert told["slew_per_s"] == pytest.approx(300)
    assert (told["offset"], told["history"], told["verdict"]) == (-30.0, "rest", "limited")
    assert told["missed"]
    assert call("--limits", "0..60V") == 0
    assert "creep cannot follow want.csv within 0 to 60 V" in capsys.readouterr().out
    assert "out of reach within the limits" in Path("out/report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_band_of_a_real_posterior(call, fitted, capsys):
    """From `fracjax posterior` to the band, against the Laplace approximation's own."""
    recorded = fitted.parent / "recording.csv"
    words = ["--model", "creep", "--out", "post", "--history", "constant", "--steps", "400"]
    assert run(["posterior", str(recorded), *words, "--quiet"]) in (0, 3)
    assert call("--fit", "post/fit.json", "--posterior", "post") == 0
    told = load_compensation("out/compensation.json")
    draws = fj.load_posterior("post").samples
    assert told.band is not None
    inside = (told.band[0] <= told.predicted) & (told.predicted <= told.band[1])
    assert inside.all()
    # Straight lines through the draws' means, as a small spread allows; where the recording has
    # its mean, the sensor's zero goes with the gain.
    law = fj.load_model("post/fit.json")
    values = np.stack([draws[name].ravel() for name in ("k_c", "mu")])
    middle, spread = values.mean(axis=1), values.std(axis=1)
    recorded_drive = fj.read(recorded).drive

    def response(shift, drive):
        k_c, mu = middle + shift
        moved = {"k_c": k_c, "mu": mu}
        return fj.simulate(model(set_values(law.block, moved)), drive, STEP).response

    changes = []
    for shift in np.diag(spread):
        mean = (response(shift, recorded_drive) - response(0, recorded_drive)).mean()
        changes.append(response(shift, told.drive) - response(0, told.drive) - mean)
    wide = np.sqrt(np.einsum("in,ij,jn->n", changes, np.corrcoef(values), changes))
    width, counted = told.band[1] - told.band[0], wide > 0.3 * wide.max()
    np.testing.assert_allclose(width[counted], 3.92 * wide[counted], rtol=0.25)
    assert "largest error within the band" in capsys.readouterr().out


def test_quiet_prints_nothing(call, capsys):
    assert call("--quiet", "--regularisation", "5 ms") == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make here")
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler here")
def test_a_target_writes_the_inverse_for_a_loop(fitted, empty_folder, capsys):
    """Code that compiles and agrees with Python, and what it promises."""
    words = ["compensate", "--fit", str(fitted), "--target", "c", "--step", "10 ms"]
    assert run([*words, "--slew", "2 V/ms", "--out", "loop"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert out.startswith("The inverse of creep runs every 0.01 s, and its linear parts hold to")
    assert "What the model lacks comes on top." in out
    assert sorted(path.name for path in Path("loop").iterdir()) == [
        "Makefile", "report.html", "stage.c", "stage.h", "stage_test.c", "stage_vector.csv",
    ]  # fmt: skip
    done = subprocess.run(["make", "-C", "loop", "check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "0 other flags" in done.stdout
    assert run([*words, "--json", "--limits", "0..50 V", "--out", "loop"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["limits"] == [0.0, 50.0]
    assert told["step_s"] == 0.01
    assert run([*words[:4], "fmu", *words[5:], "--out", "simulated"]) == 0
    assert "The FMU holds its sources, and a library for" in capsys.readouterr().out
    assert {path.name for path in Path("simulated").iterdir()} == {"report.html", "stage.fmu"}
    assert told["promise"]["rows"][0]["interval"][1] > 0
    assert "ends at the limit" in told["promise"]["failures"][0]
    page = Path("loop/report.html").read_text(encoding="utf-8")
    assert "Where it must fail" in page
    assert "promise.json" in page


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["want.csv", "--target", "c", "--step", "1 ms"], "a trajectory or --target"),
        ([], "found neither"),
        (["--target", "c"], 'give --step "50 us"'),
        (["--target", "c", "--step", "1 V"], "expected a value in s"),
        (["--target", "fmu", "--step", "1 ms", "--real", "float"], "double with --target fmu"),
        (["--target", "c", "--step", "1 ms", "--limits", "none"], "lowest and highest drive"),
        (["--target", "c", "--step", "1 ms", "--adaptive", "20 s"], "a model with hysteresis"),
    ],
)
def test_unusable_calls_for_a_loop(fitted, empty_folder, words, said, capsys):
    fj.write("want.csv", {"time_s": TIMES, "displacement_um": SINE})
    assert run(["compensate", *words, "--fit", str(fitted), "--out", "out"]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not Path("out").exists()


def test_what_did_not_converge_is_saved_and_said(call, capsys, monkeypatch):
    found = fj.compensate(model(blocks.Creep(0.1, 0.01)), wanted())
    stopped = replace(found, converged=False)
    monkeypatch.setattr(fracjax._compensate, "compensate", lambda *_, **__: stopped)
    assert call("--quiet") == 3
    assert "did not converge; the best drive was saved in out" in capsys.readouterr().err
    assert Path("out/compensation.json").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--limits", "60 V"], 'a range such as "0..100 V"'),
        (["--limits", "60..0 V"], "the lower limit, then the upper"),
        (["--limits", "0..60 um"], "expected a value in V"),
        (["--slew", "50 V"], "expected a value in V/s"),
        (["--slew", "-50 V/s"], "a rate above 0"),
        (["--regularisation", "2 V"], "expected a value in s"),
        (["--offset", "2 V"], "expected a value in um"),
        (["--output-unit", "V"], 'of the same kind as "nm"'),
        (["--output", "7"], 'a column "7"'),
        (["--history", "estimated"], "Invalid value for '--history'"),
        (["--posterior", "nowhere"], "no posterior.json"),
        (["--fit", "none.json"], "found no such file"),
        (["--out", "want.csv"], "a place that can be written"),
    ],
)
def test_unusable_calls_of_the_command(call, words, said, capsys):
    assert call(*words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == 1
    assert not Path("out").exists()
