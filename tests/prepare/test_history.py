"""What a recording tells of the time before it: prior history and periods."""

from dataclasses import replace

import numpy as np
import pytest

import fracjax as fj
from fracjax._operators._grid import History
from fracjax._prepare import alternative_history, prepare, take_of
from tests.fit.helpers import KNOWN, LAW, SIGMA, STARTS, STEP, fit_foh, several_tones, truth, white


def test_an_estimated_past_explains_what_a_recording_cut_out_of_motion_remembers():
    """The second half of a burst and three tones, for a law without the rate term."""

    def drive_of(t):
        return several_tones(np.maximum(t - 1.0, 0.0)) + 30 * np.sin(2 * np.pi * t) ** 2 * (t < 1.0)

    law = LAW | {"k_p": 0.0}
    drive, clean = truth(drive_of, law)
    cut = fj.Recording(drive[500:], clean[500:] + SIGMA * white(3)[500:], STEP, "V", "um")
    model = fj.parse_model("foh")
    held, estimated = (
        fj.fit(
            model,
            cut,
            noise=KNOWN,
            history=past,
            settling=0,
            starts=STARTS,
            fixed={"k_p": 0.0, "beta": -0.1},
        )
        for past in ("constant", "estimated")
    )
    assert held.scores.rmse > 1.5 * SIGMA
    assert estimated.scores.rmse == pytest.approx(SIGMA, rel=0.1)
    alpha = next(e for e in estimated.estimates if e.name == "alpha")
    assert abs(alpha.value - law["alpha"]) < 4 * alpha.standard_error
    assert estimated.to_dict()["assumptions"][0]["history"] == "estimated"


def test_of_steady_cycles_whole_periods_count_and_all_of_them():
    times = np.arange(1100) * STEP
    drive = 40 + 30 * np.sin(2 * np.pi * times / 0.4)  # 5.5 periods of 200
    response = 0.1 * drive + SIGMA * np.random.default_rng(0).standard_normal(1100)
    recording = fj.Recording(drive, response, STEP, "V", "um")
    taken = prepare([recording], history="periodic").takes[0]
    assert len(taken.recording) == taken.used.size == 1000
    assert taken.used.all()
    weighed = prepare([recording], history="periodic", weights=times > 0.1).takes[0]
    assert weighed.roots is not None
    assert weighed.used.size == weighed.roots.size == 1000
    assert np.count_nonzero(~weighed.used) == 51


def test_steady_cycles_that_end_within_one_are_compared_with_a_start_on_whole_ones():
    times = np.arange(1100) * STEP
    drive = 40 + 30 * np.sin(2 * np.pi * times / 0.4)  # 5.5 periods of 200
    law = fj.parse_model("creep").with_values({"k_c": 0.1, "mu": 0.2})
    steady = np.tile(fj.simulate(law, drive[:200], STEP, "periodic").response, 6)[:1100]
    noise = SIGMA * np.random.default_rng(0).standard_normal(1100)
    fit = fj.fit("creep", fj.Recording(drive, steady + noise, STEP, "V", "um"), starts=1)
    assert fit.to_dict()["assumptions"][0]["history"] == "periodic"
    assert fit.scores.rmse == pytest.approx(SIGMA, rel=0.1)


def one_period(history: History, seed: int = 0) -> fj.Recording:
    """FOH under ten tones of random phase, one period long, with noise."""
    generator = np.random.default_rng(seed)
    times = np.arange(512) * STEP
    tones = np.arange(1, 11)[:, None]
    phases = generator.uniform(0, 2 * np.pi, (10, 1))
    drive = 40 + 8 * np.sum(np.cos(2 * np.pi * tones * times / (512 * STEP) + phases), axis=0)
    response = fj.simulate("foh", drive, STEP, history).response
    return fj.Recording(drive, response + SIGMA * generator.standard_normal(512), STEP, "V", "um")


@pytest.mark.parametrize("history", ["periodic", "constant"])
def test_one_period_tells_whether_it_had_run_before(history):
    """Its drive ends where it began either way; its response only where it had."""
    fit = fit_foh(one_period(history))
    assert fit.to_dict()["assumptions"][0]["history"] == history
    assert fit.scores.rmse == pytest.approx(SIGMA, rel=0.1)


def two_cycles(model: str, history: History, tones: int, seed: int, wandering=0.0) -> fj.Recording:
    """A model and a mode just above so many tones, two periods, the noise perhaps wandering off."""
    generator = np.random.default_rng(seed)
    times = np.arange(1024) * STEP
    of_tone = 2 * np.pi * np.arange(1, tones + 1)[:, None] / (512 * STEP)
    phases = generator.uniform(0, 2 * np.pi, (tones, 1))
    waves = np.cos(of_tone * times + phases)
    drive = 40 + 8 * np.sum(waves, axis=0) / np.sqrt(tones / 10)
    mode = {"second.frequency": 1.1 * tones / (512 * STEP), "second.damping": 0.02}
    law = fj.parse_model(f"{model} >> resonance").with_values(mode)
    noise = SIGMA * generator.standard_normal(1024)
    noise += wandering * SIGMA * np.cumsum(generator.standard_normal(1024))
    return fj.Recording(
        drive, fj.simulate(law, drive, STEP, history).response + noise, STEP, "V", "um"
    )


@pytest.mark.parametrize(
    ("model", "history", "tones", "seed", "wandering"),
    [
        # The least residual of these had spoken for the other.
        ("lfdh", "periodic", 64, 2, 0.0),
        ("lfdh", "constant", 40, 1, 0.0),
        ("lfdh", "constant", 64, 3, 0.0),
        # A law that foretells no change leaves both as they are: that one begins otherwise counts.
        ("foh", "constant", 20, 1, 0.0),
        ("foh", "periodic", 20, 1, 0.2),
        ("foh", "constant", 20, 2, 0.2),
    ],
)
def test_two_cycles_tell_whether_it_had_run_before_whatever_the_law_misses(
    model, history, tones, seed, wandering
):
    """It misses a mode in both of them, by far more than what their start could add."""
    recording = two_cycles(model, history, tones, seed, wandering)
    fit = fj.fit(fj.parse_model(model), recording)
    assert fit.scores.rmse > 20 * SIGMA
    assert fit.to_dict()["assumptions"][0]["history"] == history


def test_the_period_of_a_drive():
    """By three repeats, or by one other that fills the recording."""
    recording = two_cycles("lfdh", "periodic", 20, 0)
    assert take_of(recording, None, None, None).period == 512
    assert take_of(recording.window(0, 1000), None, None, None).period is None
    assert take_of(one_period("periodic"), None, None, None).period is None
    times = np.arange(1100) * STEP
    sine = fj.Recording(np.sin(2 * np.pi * times / 0.4), times, STEP, "V", "um")
    assert take_of(sine, None, None, None).period == 200


def test_one_period_of_steady_motion_may_be_told():
    recording = one_period("periodic")
    taken = prepare([recording], history="periodic").takes[0]
    assert (taken.history, taken.used.sum()) == ("periodic", 512)
    with pytest.raises(fj.InputError, match=r"expected a drive that repeats.*or one period"):
        prepare([recording.window(0, 400)], history="periodic")


def test_a_drive_that_begins_at_rest_is_no_period():
    recording = one_period("periodic")
    drive = np.concatenate([np.full(50, recording.drive[0]), recording.drive])
    response = np.concatenate([np.full(50, recording.response[0]), recording.response])
    take = take_of(fj.Recording(drive, response, STEP, "V", "um"), None, None, None)
    assert alternative_history(take) is None


def test_one_period_ends_where_it_began_in_drive_and_response():
    recording, away = one_period("periodic"), np.linspace(0, 1, 512)
    drive = recording.drive + np.ptp(recording.drive) * away
    response = recording.response + np.ptp(recording.response) * away
    for change, history in (
        ({}, "periodic"),
        ({"drive": drive}, None),
        ({"response": response}, None),
    ):
        other = alternative_history(take_of(replace(recording, **change), None, None, None))
        assert (other and other.history) == history
