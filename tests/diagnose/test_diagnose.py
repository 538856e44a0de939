"""The diagnosis from end to end: verdicts on independent truths, and what is written of them."""

import json
from pathlib import Path

import numpy as np
import pytest

import fracjax as fj
from benchmarks.concealed.cases import make_case
from fracjax._computing import Clock, computing, within
from fracjax._diagnose._fitted import fitted
from fracjax._diagnose._inquiry import Inquiry, inquire
from fracjax._diagnose._views import model_view, path_view
from fracjax._fit import settle
from fracjax._prepare import prepare
from fracjax._recording import InputError, Recording
from tests.diagnose.helpers import recording_of

VERDICTS = {"none", "missing", "confusable", "unexplained"}
STEP, CYCLES = 4e-3, 8
TIMES = STEP * np.arange(CYCLES * 250)
TONE = 50 - 50 * np.cos(2 * np.pi * TIMES)
RADII = (4.0, 9.0, 16.0, 25.0, 38.0)


def five_plays(drive: np.ndarray, seed: int, extra: np.ndarray | float = 0.0) -> Recording:
    """A sum of plays, sample by sample, and white noise: hysteresis and nothing else."""
    response = 0.06 * drive
    for radius in RADII:
        state, states = drive[0], []
        for level in drive:
            state = min(max(state, level - radius), level + radius)
            states.append(state)
        response = response + 0.008 * np.array(states)
    noise = 0.005 * np.random.default_rng(seed).standard_normal(drive.size)
    return Recording(drive, response + noise + extra, STEP, "V", "um")


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
    assert null.shape is None
    assert null.complete
    assert null.p_value > 0.01
    assert all(c.detectable_amplitude > 0 for c in null.candidates)


def test_a_concealed_effect_is_named_located_and_predicts_better(concealed):
    case, diagnosis = concealed
    assert case.label["R2"] > 0.999
    assert [e.name for e in diagnosis.effects] == ["electrostriction"]
    assert diagnosis.axes[0].axis in {"level", "harmonics"}
    assert diagnosis.held_out.extended_rmse == pytest.approx(case.label["noise_sd_um"], rel=0.05)
    assert diagnosis.held_out.base_rmse > 2 * diagnosis.held_out.extended_rmse
    assert diagnosis.extended_model.name == "electrostriction >> foh"


def test_a_model_that_describes_its_recording_is_asked_before_any_path():
    """A fractional loop is no path curve's: on loops that grow, without a rest, curves of some
    thousand coefficients took up noise and a lag was named."""
    times = 2e-3 * np.arange(4000)
    drive = 40 * np.sin(2 * np.pi * times) ** 2 * (0.5 + 0.5 * times / times[-1])
    law = fj.simulate(fj.parse_model("foh"), drive, 2e-3, "rest").response
    noise = 1e-3 * np.ptp(law) * np.random.default_rng(0).standard_normal(times.size)
    stages: list[str] = []
    recording = Recording(drive, law + noise, 2e-3, "V", "um")
    diagnosis = fj.diagnose("foh", recording, progress=stages.append)
    assert diagnosis.verdict == "none"
    assert not any("path" in stage for stage in stages)


def test_the_noise_that_path_curves_leave_is_as_large_as_it_was():
    """Curves of many branches take up a tenth of it."""
    times = STEP * np.arange(4000)
    drive = 50 + 50 * np.sin(2 * np.pi * times) * (1 - 0.9 * times / times[-1])
    recording = five_plays(drive, 2)
    view, preparation = path_view(prepare([recording]))
    (take,) = preparation.takes
    assert take.noise is not None
    assert view.spent[0].mean() > 0.05
    assert take.noise.sigma == pytest.approx(0.005, rel=0.04)


def test_the_named_parameter_is_in_its_interval(concealed):
    case, diagnosis = concealed
    q = next(p for p in diagnosis.effects[0].parameters if p.name == "q")
    span = np.ptp(case.voltage)
    # Of u + q (u - u0)², another centre c changes the gain: q' = q U / (1 + 2 q (c - u0)).
    truth = case.label["parameters"]
    centre = 0.5 * (case.voltage.max() + case.voltage.min())
    expected = truth["q"] * span / (1 + 2 * truth["q"] * (centre - truth["u0"]))
    assert abs(q.value - expected) < 4 * q.standard_error + 0.02 * abs(expected)


def test_the_noise_floor_is_the_simulated_one(concealed, null):
    case, diagnosis = concealed
    for each in (diagnosis, null):
        assert each.noise.method == "static"
    assert diagnosis.noise.sigma == pytest.approx(case.label["noise_sd_um"], rel=0.1)


@pytest.fixture(scope="module")
def plays():
    return fj.diagnose("bouc_wen", five_plays(TONE, 0))


def test_another_loop_is_no_dynamics(plays):
    assert {e.name for e in plays.effects} <= {
        "hysteresis_shape",
        "minor_loop_memory",
        "amplitude_dependence",
        "backlash",
        "coulomb_friction",
    }
    assert plays.verdict != "none"


@pytest.mark.slow
def test_a_drift_that_a_settling_loop_could_make_is_said_not_to_be_shown():
    drift = 0.02 * TIMES
    diagnosis = fj.diagnose("bouc_wen", five_plays(TONE, 2, drift))
    (shown,) = (each for each in diagnosis.can_show if each.effect == "thermal_drift")
    assert shown.size is None or shown.size > np.ptp(drift)
    assert {e.name for e in diagnosis.effects} <= {"hysteresis_shape"}


def test_a_rounded_drive_is_no_mode():
    exact = five_plays(TONE, 3)
    rounded = Recording(0.8 * np.round(TONE / 0.8), exact.response, STEP, "V", "um")
    diagnosis = fj.diagnose("bouc_wen", rounded)
    assert not {"resonance", "second_mode"} & {e.name for e in diagnosis.effects}
    assert any("written in steps of 0.8 V" in warning for warning in diagnosis.warnings)


def test_what_is_written_follows_the_schema(concealed, null, plays, tmp_path: Path):
    required = {"schema", "model", "recordings", "noise", "numerics", "verdict", "effects"}
    for number, diagnosis in enumerate((concealed[1], null, plays)):
        diagnosis.save(tmp_path / f"{number}.json")
        content = json.loads((tmp_path / f"{number}.json").read_text())
        assert required | {"candidates", "where", "fit", "sentence"} <= set(content)
        assert content["verdict"] in VERDICTS
        assert content["complete"] is True
        assert ("shape" in content) == (diagnosis.shape is not None)
        assert {c["name"] for c in content["candidates"]} == set(fj.EFFECTS)
        shown = {entry["effect"]: entry for entry in content["can_show"]}
        assert {"creep", "resonance", "degradation"} <= set(shown) <= set(fj.EFFECTS)
        assert all((e["size"] is None) == bool(e["reason"]) for e in shown.values())
        assert {entry["unit"] for entry in shown.values()} == {"um"}
        evidence = [c["log_evidence"] for c in content["candidates"]]
        assert evidence == sorted(evidence, reverse=True)
        for axis in content["where"]["axes"]:
            assert len(axis["edges"]) == len(axis["strength"]) + 1


@pytest.mark.slow
def test_a_sum_of_plays_may_be_the_model_that_does_not_describe_the_recording():
    law = fj.parse_model("bouc_wen").with_values({"k_u": 0.1, "rho": 0.05, "sigma": 2.0, "n": 2.0})
    drive = TONE * (1 - 0.5 * TIMES / TIMES[-1])
    noise = 0.002 * np.random.default_rng(0).standard_normal(drive.size)
    response = fj.simulate(law, drive, STEP).response + noise
    recording = Recording(drive, response, STEP, "V", "um")
    diagnosis = fj.diagnose("prandtl_ishlinskii", recording)
    # No other law stands beside it: that it is not the recording's is said, and nothing is named.
    assert diagnosis.effects == ()
    assert diagnosis.verdict == "unexplained"


def test_nothing_is_named_when_the_time_is_over_before_the_base_fit_ends():
    case = make_case("foh", "electrostriction", "bursts", level=3.0)
    diagnosis = fj.diagnose("foh", recording_of(case), max_time=1e-3)
    assert not diagnosis.complete
    assert "This is the verdict so far" in diagnosis.sentence
    assert diagnosis.effects == ()


def test_when_the_time_is_over_no_further_rival_is_refitted():
    recording = recording_of(make_case("foh", "electrostriction", "bursts", level=3.0))
    clock, refits = Clock(60.0), []

    def progress(text: str) -> None:
        clock.stopped = clock.stopped or text.startswith("refitting")
        refits.extend([text] if text.startswith("refitting") else [])

    model = fj.parse_model("foh")
    with computing(), within(clock):
        preparation = prepare([recording])
        solved = settle(model.block, preparation, history=None, starts=4, seed=0)
        base = fitted([solved.block], solved.preparation)
        path, _ = path_view(solved.preparation)
        inquiry = Inquiry.of(base, path, model_view(base))
        inquire(inquiry, model.block, progress, clock)
    assert len(refits) == 1
    assert clock.stopped


def test_a_time_of_none_is_refused(null):
    with pytest.raises(InputError, match="max_time: expected seconds above 0, found 0"):
        fj.diagnose("foh", null.base.preparation.takes[0].recording, max_time=0)
