"""Where a mismatch is: planted at one place, it is found there and said so; noise is nowhere."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fracjax as fj
from fracjax._diagnose._locate import locate
from fracjax._diagnose._next_experiment import Drive, Proposal
from fracjax._diagnose._result import Axis, Candidate, HeldOut, NamedEffect
from fracjax._diagnose._score import Residual
from fracjax._diagnose._sentence import advice, next_experiment, sentence_of, where_of
from fracjax._fit import prepare

STEP = 0.01
PERIOD = 250
TIMES = STEP * np.arange(8 * PERIOD)
PHASE = 360 * np.arange(TIMES.size) / PERIOD % 360
DRIVE = 50 - 50 * np.cos(np.deg2rad(PHASE))
RATES = 50 * np.sin(np.deg2rad(PHASE)) * 2 * np.pi / (PERIOD * STEP)
SINCE = PHASE % 180 / 360 * PERIOD * STEP
KNOWN = fj.Noise(1.0, "um", "specification", np.ones(1), 1.0)
TAKEN = prepare(
    [fj.Recording(DRIVE, 0.1 * DRIVE, STEP, "V", "um")], noise=KNOWN, history="constant", settling=0
)


def axes_of(residual: np.ndarray) -> dict[str, Axis]:
    problems = TAKEN.problems()
    whitened = np.zeros(problems[0].response.shape[0])
    whitened[: residual.size] = residual
    found = locate(TAKEN, problems, Residual(whitened, np.zeros((whitened.size, 0))), 1e9)
    return {axis.axis: axis for axis in found}


def white(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(TIMES.size)


@pytest.mark.parametrize(
    ("name", "unit", "bins", "planted", "low", "high"),
    [
        ("time", "s", 16, (TIMES > 10) & (TIMES < 11.8), 10, 11.8),
        ("level", "V", 12, np.abs(DRIVE - 62.5) < 4, 58.5, 66.5),
        ("rate", "V/s", 10, RATES > 115, 115, 126),
        ("reversal", "s", 10, np.sign(RATES) * (SINCE < 0.05), 0.005, 0.06),
        ("phase", "deg", 24, np.abs(PHASE - 240) < 15, 225, 255),
        ("harmonics", "1", 10, np.sin(5 * np.deg2rad(PHASE) + 1) / 2, 4.5, 5.5),
        ("frequency", "Hz", 14, np.sin(2 * np.pi * 31 * TIMES), 26, 36),
    ],
)
def test_what_is_planted_at_a_place_is_found_there(name, unit, bins, planted, low, high):
    axis = axes_of(white(0) + planted)[name]
    assert axis.unit == unit
    assert axis.p_value < 1e-6
    assert axis.strength.size == bins
    strongest = int(np.argmax(axis.strength))
    assert axis.edges[strongest] < high
    assert axis.edges[strongest + 1] > low
    assert any(a < high and b > low for a, b in axis.intervals)


def test_what_a_place_takes_is_told_beyond_what_noise_would_give_it():
    planted = 2.0 * ((TIMES > 10) & (TIMES < 11.8))
    gone = float(np.sum(planted**2))
    assert 0.7 * gone < axes_of(white(0) + planted)["time"].excess < 1.1 * gone
    assert axes_of(white(0))["time"].excess == 0


def test_on_noise_no_place_stands_out():
    draws = [axes_of(white(seed)) for seed in range(10)]
    for name in draws[0]:
        p_values = np.array([axes[name].p_value for axes in draws])
        # A bound, by twice the smaller of two tests: never more often than it says.
        assert p_values.min() > 1e-3, name
        assert 0.15 < np.median(p_values) < 1, name


# In words -----------------------------------------------------------------------------------------


def axis(name: str, unit: str, p_value: float, *intervals: tuple[float, float]) -> Axis:
    return Axis(name, unit, np.arange(3.0), np.ones(2), 3.0, intervals, p_value)


AXES = [
    axis("level", "V", 1e-9, (1.0, 2.0), (4.0, 5.5)),
    axis("time", "s", 0.2, (0.0, 1.0)),
    axis("harmonics", "1", 1e-3, (1.5, 2.5)),
]
BASE: Any = SimpleNamespace(model=SimpleNamespace(name="foh"))
HELD_OUT = HeldOut("stretches", 0.3, 0.1, (0.3,), (0.1,), "a.csv")


def test_the_first_place_that_stands_out_is_told():
    assert where_of(AXES, "missing") == (
        "The mismatch stands out along level, at 1 to 2, 4 to 5.5 V; it also shows along harmonics."
    )
    assert where_of(AXES[2:], "missing") == (
        "The mismatch stands out along harmonics, at 1.5 to 2.5."
    )
    nowhere = "Nowhere does the residual stand out from the noise."
    assert where_of(AXES, "none") == nowhere
    assert where_of(AXES[1:2], "missing") == nowhere


def said(verdict, effects=(), adopted=(), axes=AXES, noise=KNOWN) -> str:
    candidates = [
        Candidate("creep", "series", 1.0, 0.0, 0.25, 0.9, ""),
        Candidate("resonance", "series", 1.0, 0.0, 0.5, 0.3, ""),
    ]
    return sentence_of(verdict, effects, adopted, candidates, axes, BASE, noise, HELD_OUT)


def named(*confusable_with: str) -> NamedEffect:
    return NamedEffect("creep", "series", 0.9, 0.95, (), confusable_with)


def test_a_verdict_of_none_names_what_could_be_hidden():
    assert said("none") == (
        "foh and the recording agree within the noise floor of 1 um (specification); best hidden "
        "would be creep, seen only if it changes the response by more than 0.25 um rms."
    )
    residual = fj.Noise(1.0, "um", "residual", np.ones(1), 1.0)
    assert "a mismatch cannot be excluded" in said("none", noise=residual)


def test_what_is_missing_is_told_with_what_it_brings():
    law = fj.EFFECTS["creep"].sentence
    falls = " With it the error on data held out falls from 0.3 to 0.1 um (noise floor 1 um)."
    assert said("missing", [named()]) == f"foh leaves out creep ({law}).{falls}"
    assert said("confusable", [named("resonance", "delay")]) == (
        f"foh leaves out creep ({law}), or what this drive cannot tell from it: delay, resonance."
        f"{falls}"
    )
    beyond = "foh and the recording differ beyond noise"
    unknown = "and no effect of the catalogue explains it."
    place = "along level, at 1 to 2, 4 to 5.5 V; it also shows along harmonics"
    assert said("unexplained") == f"{beyond} {place}, {unknown}"
    assert said("unexplained", adopted=("creep",)) == (
        f"{beyond} {place}, {unknown} It is partly creep-like.{falls}"
    )
    assert said("unexplained", axes=AXES[1:2]) == (
        f"{beyond} all over, nowhere in particular, {unknown}"
    )


@pytest.mark.parametrize(("chance", "sure"), [(0.5, True), (0.49, False)])
def test_the_next_experiment_promises_no_more_than_its_chance(chance, sure):
    drive = Drive("a sine of 3 Hz", np.zeros(2), STEP)
    told = next_experiment(["creep", "thermal_drift"], Proposal(drive, chance))
    assert told.separates == ("creep", "thermal_drift")
    assert told.sentence == "Record a sine of 3 Hz: " + (
        "it tells creep from thermal_drift with a probability of 0.50."
        if sure
        else "of the drives within the limits it is the best to tell creep from thermal_drift, but "
        "succeeds only with a probability of 0.49. Better would be "
        f"{fj.EFFECTS['creep'].separated_by['thermal_drift']}."
    )


def test_advice_is_found_whichever_effect_holds_it():
    law = fj.EFFECTS["creep"].separated_by["drive_lag"]
    assert advice("creep", "drive_lag") == law
    assert advice("drive_lag", "creep") in {law, fj.EFFECTS["drive_lag"].separated_by.get("creep")}
    assert advice("creep", "creep") is None
