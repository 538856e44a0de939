"""Diagnoses of independent truths: verdicts, names, places, predictions."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import fracjax as fj
from benchmarks.concealed.cases import make_case
from fracjax._blocks import EFFECTS
from fracjax._diagnose import _detect
from fracjax._recording import Recording
from tests.diagnose.helpers import STEP, TIMES, creeping, recording_of

VERDICTS = {"none", "missing", "confusable", "unexplained"}


@pytest.fixture(scope="module")
def null():
    return fj.diagnose(fj.parse_model("foh"), recording_of(make_case("foh", "none", "bursts")))


@pytest.fixture(scope="module")
def concealed():
    case = make_case("foh", "electrostriction", "bursts", level=3.0)
    return case, fj.diagnose(fj.parse_model("foh"), recording_of(case))


def test_a_clean_recording_gets_no_name(null):
    assert null.verdict == "none"
    assert null.effects == ()
    assert null.extended is None
    assert null.p_value > 0.01
    assert all(c.detectable_amplitude > 0 for c in null.candidates)


def test_a_concealed_effect_is_named_located_and_predicts_better(concealed):
    case, diagnosis = concealed
    assert case.label["R2"] > 0.999
    assert diagnosis.verdict == "missing"
    assert [e.name for e in diagnosis.effects] == ["electrostriction"]
    assert diagnosis.axes[0].axis in {"level", "harmonics"}
    assert diagnosis.held_out.extended_rmse == pytest.approx(case.label["noise_sd_um"], rel=0.05)
    assert diagnosis.held_out.base_rmse > 2 * diagnosis.held_out.extended_rmse
    assert diagnosis.extended_model.name == "electrostriction >> foh"


def test_the_named_parameter_is_in_its_interval(concealed):
    case, diagnosis = concealed
    q = next(p for p in diagnosis.effects[0].parameters if p.name == "q")
    span = np.ptp(case.voltage)
    # Of u + q (u - u0)², another centre c changes the gain: q' = q U / (1 + 2 q (c - u0)).
    truth = case.label["parameters"]
    centre = 0.5 * (case.voltage.max() + case.voltage.min())
    expected = truth["q"] * span / (1 + 2 * truth["q"] * (centre - truth["u0"]))
    assert abs(q.value - expected) < 4 * q.standard_error + 0.02 * abs(expected)
    assert q.ends is not None  # told by the profile, in the fit that is saved too
    assert q.interval in {e.interval for e in diagnosis.extended.estimates}


def test_the_noise_floor_is_the_simulated_one(concealed, null):
    case, diagnosis = concealed
    for found in (diagnosis, null):
        assert found.noise.method == "static"
    assert diagnosis.noise.sigma == pytest.approx(case.label["noise_sd_um"], rel=0.1)


def test_what_is_written_follows_the_schema(concealed, null, tmp_path: Path):
    required = {"schema", "model", "recordings", "noise", "numerics", "verdict", "effects"}
    for number, diagnosis in enumerate((concealed[1], null)):
        diagnosis.save(tmp_path / f"{number}.json")
        content = json.loads((tmp_path / f"{number}.json").read_text())
        assert required | {"candidates", "where", "fit", "sentence"} <= set(content)
        assert content["verdict"] in VERDICTS
        assert {c["name"] for c in content["candidates"]} == set(fj.EFFECTS)
        evidence = [("delta_bic" in c, c["log_evidence"]) for c in content["candidates"]]
        assert evidence == sorted(evidence, reverse=True)
        for axis in content["where"]["axes"]:
            assert len(axis["edges"]) == len(axis["strength"]) + 1


@pytest.mark.slow
def test_interference_that_does_not_repeat_is_noise():
    """A bump at 37 Hz of ever changing phase, far above the white noise beside it."""
    generator = np.random.default_rng(3)
    bump = lfilter([1.0], np.poly(0.995 * np.exp(2j * np.pi * 37 * STEP * np.array([1, -1]))).real,
                   generator.standard_normal(TIMES.size))  # fmt: skip
    white, bump = generator.standard_normal(TIMES.size), np.asarray(bump)
    noise = 0.01 * white + 0.02 * bump / bump.std()
    diagnosis = fj.diagnose(fj.parse_model("creep"), creeping(noise))
    assert diagnosis.noise.method == "repeats"
    assert diagnosis.verdict == "none"


@pytest.mark.slow
def test_look_alikes_are_told_with_the_drive_that_would_part_them(monkeypatch):
    """A lag on a slow sine could be a delay or a sensor's: all are told, and a faster drive."""
    # Of the whole catalogue each law costs a compilation.
    asked = {name: EFFECTS[name] for name in ("drive_lag", "delay", "sensor_lag", "resonance")}
    monkeypatch.setattr(_detect, "EFFECTS", asked)
    step, lag = 2e-3, 0.01
    drive = 50 - 40 * np.cos(2 * np.pi * step * np.arange(1500))
    keep = np.exp(-step / lag)
    late = 10 + np.asarray(lfilter([1 - keep], [1, -keep], drive - 10))
    noise = 1e-3 * np.random.default_rng(2).standard_normal(drive.size)
    response = fj.simulate("lfdh", late, step).response + noise
    found = fj.diagnose("lfdh", Recording(drive, response, step), limits="0..100 V, 20 V/ms")
    assert found.verdict == "confusable"
    names = {found.effects[0].name, *found.effects[0].confusable_with}
    assert "drive_lag" in names
    assert found.next_experiment is not None
    assert set(found.next_experiment.separates) <= names
    proposed = found.next_experiment.drive
    assert 0 <= proposed.values.min() < proposed.values.max() <= 100
    assert np.abs(np.diff(proposed.values)).max() / proposed.step <= 20e3 * (1 + 1e-9)
