"""What a diagnosis says in words."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import fracjax as fj
from fracjax._diagnose._next_experiment import Proposal
from fracjax._diagnose._result import Axis, Candidate, HeldOut, NamedEffect, Shape
from fracjax._diagnose._sentence import (
    advice,
    afterwards,
    completed_sentence,
    is_incomplete,
    next_experiment,
    sentence_of,
    where_of,
)
from fracjax._path import Visible
from fracjax._protocol import Drive, Part

STEP = 0.01
KNOWN = fj.Noise(1.0, "um", "specification", np.ones(1), 1.0)


def axis(name: str, unit: str, p_value: float, *intervals: tuple[float, float]) -> Axis:
    return Axis(name, unit, np.arange(3.0), np.ones(2), 3.0, intervals, p_value)


AXES = [
    axis("level", "V", 1e-9, (1.0, 2.0), (4.0, 5.5)),
    axis("time", "s", 0.2, (0.0, 1.0)),
    axis("harmonics", "1", 1e-3, (1.5, 2.5)),
]
SETTING = SimpleNamespace(response_span=8.0)
BASE: Any = SimpleNamespace(
    model=SimpleNamespace(name="foh"),
    preparation=SimpleNamespace(setting=SETTING, takes=[None]),
    scores=SimpleNamespace(rmse=1.5),
)
HELD_OUT = HeldOut("stretches", 0.3, 0.1, (0.3,), (0.1,), "a.csv")


def test_the_first_place_that_stands_out_is_told():
    assert where_of(AXES, "missing") == (
        "The mismatch depends on the level of the drive, most at 1 to 2, 4 to 5.5 V; it also "
        "depends on the harmonic of the drive."
    )
    assert where_of(AXES[2:], "missing") == (
        "The mismatch depends on the harmonic of the drive, most at 1.5 to 2.5."
    )
    assert where_of([axis("frequency", "Hz", 1e-4)], "missing") == (
        "The mismatch depends on frequency."
    )
    nowhere = "The residual does not exceed the noise anywhere."
    assert where_of(AXES, "none") == nowhere
    assert where_of(AXES[1:2], "unexplained") == "The mismatch depends on nothing in particular."
    # Where none does by itself, what a named effect changes still has a place.
    assert where_of(AXES[1:2], "missing", ["creep"]) == (
        "The mismatch depends on nothing in particular; the changes by creep depend on time, most "
        "at 0 to 1 s."
    )
    assert where_of([*AXES[1:2], AXES[2]], "missing", ["creep", "delay"]) == (
        "The mismatch depends on the harmonic of the drive, most at 1.5 to 2.5; the changes by "
        "creep and delay depend on time, most at 0 to 1 s."
    )


def test_of_several_recordings_each_is_told_first_where_most_is_left():
    residuals = [("a.csv", 1.02), ("b.csv", 4.16), ("c.csv", 2.5)]
    assert where_of(AXES[2:], "missing", residuals=residuals) == (
        "The mismatch depends on the harmonic of the drive, most at 1.5 to 2.5. "
        "The residual is 4.2 times the noise in b.csv, 2.5 in c.csv, 1 in a.csv."
    )
    many = [*residuals, ("d.csv", 1.1), ("e.csv", 1.0), ("f.csv", 0.9)]
    assert where_of(AXES[2:], "missing", residuals=many).endswith(
        "in b.csv, 2.5 in c.csv, 1.1 in d.csv, 1 in a.csv, at most 1 elsewhere."
    )
    assert "times" not in where_of(AXES[2:], "missing", residuals=residuals[:1])
    assert "times" not in where_of(AXES, "none", residuals=residuals)


def inquiry(model: object = "foh", is_adequate: bool = True, path_misfit: float = 0.0) -> Any:
    return SimpleNamespace(model=model, is_adequate=is_adequate, path_misfit=path_misfit)


def said(verdict, effects=(), **others) -> str:
    candidates = [
        Candidate("creep", "series", 1.0, 0.0, 0.25, 0.9, ""),
        Candidate("resonance", "series", 1.0, 0.0, 0.5, 0.3, ""),
    ]
    findings: Any = SimpleNamespace(
        verdict=verdict,
        effects=tuple(effects),
        base_fit=BASE,
        base=SimpleNamespace(preparation=BASE.preparation),
        candidates=candidates,
        axes=AXES,
        noise=KNOWN,
        held_out=HELD_OUT,
        shape=None,
        excess=0.0,
        doubt=0.1,
        doubts=(),
        jumps="",
        follows_nothing=False,
        inquiry=inquiry(),
        extension=None,
    )
    for name, value in others.items():
        setattr(findings, name, value)
    return sentence_of(findings)


def named(*confusable_with: str, name: str = "creep") -> NamedEffect:
    return NamedEffect(name, "series", 0.9, 0.95, (), confusable_with)


def test_a_verdict_of_none_names_what_could_be_hidden(monkeypatch):
    assert said("none") == (
        "foh and the recording agree within the noise floor of 1 µm (specification); the effect "
        "that could hide best is creep, detectable only if it changes the response by more than "
        "0.25 µm rms."
    )
    elsewhere = replace(HELD_OUT, method="recording", base_rmse=40.0)
    assert said("none", held_out=elsewhere) == said("none") + (
        " But its error on the held-out recording is 40 µm, 40 times the noise: that recording "
        "shows an effect that this one does not, or this one does not determine the parameters "
        "well enough to predict it; diagnose both together."
    )
    assert said("none", held_out=replace(elsewhere, base_rmse=1.9)) == said("none")
    assert said("none", held_out=replace(elsewhere, method="stretches")) == said("none")
    monkeypatch.setattr(SETTING, "response_span", 0.2)
    assert said("none").endswith("creep, which foh absorbs completely on such a drive.")
    residual = fj.Noise(1.0, "um", "residual", np.ones(1), 1.0)
    assert "a mismatch cannot be excluded" in said("none", noise=residual)


def test_an_error_above_the_noise_is_not_called_agreement():
    assert said("none", excess=0.5).startswith(
        "No effect is significant in the residual of foh, but the residual is 1.5 µm, more than "
        "the noise floor of 1 µm (specification)."
    )
    # Whitened it may be as the noise is, and yet be far above it.
    far = SimpleNamespace(**{**vars(BASE), "scores": SimpleNamespace(rmse=2.1)})
    assert "the residual is 2.1 µm, more than" in said("none", base_fit=far)


def test_what_is_missing_is_told_with_what_it_brings():
    law = fj.EFFECTS["creep"].sentence
    falls = " With it the error on held-out data falls from 0.3 to 0.1 µm (noise floor 1 µm)."
    assert said("missing", [named()]) == f"foh leaves out creep ({law}).{falls}"
    assert said("confusable", [named("resonance", "delay")]) == (
        f"foh leaves out creep ({law}), or an effect that this drive cannot distinguish from it: "
        f"delay, resonance.{falls}"
    )
    beyond = "foh and the recording differ by more than the noise"
    unknown = "and no effect of the catalogue explains it; the difference depends on"
    assert said("unexplained") == (
        f"{beyond}, {unknown} the level of the drive, most at 1 to 2, 4 to 5.5 V; it also depends "
        "on the harmonic of the drive."
    )
    assert said("unexplained", axes=AXES[1:2]) == f"{beyond}, {unknown} nothing in particular."


def test_what_even_path_curves_leave_is_told():
    plain, beyond = said("missing", [named()]), inquiry(is_adequate=False, path_misfit=3.0)
    assert said("missing", [named()], inquiry=beyond) == plain + (
        " Beside any law of hysteresis 2 times the noise is left, which nothing here explains."
    )
    little = inquiry(is_adequate=False, path_misfit=0.5)
    assert said("missing", [named()], inquiry=little) == plain
    assert said("unexplained", inquiry=beyond).endswith("which nothing here explains.")


def test_without_a_model_the_dynamics_are_told():
    law, asked = fj.EFFECTS["creep"].sentence, inquiry(model=None, is_adequate=False)
    whatever = "Whatever law of hysteresis the actuator has, the recording shows "
    assert said("missing", [named()], inquiry=asked).startswith(f"{whatever}creep ({law})")
    assert said("none", inquiry=asked) == (
        f"{whatever}no dynamics beyond the noise floor of 1 µm (specification); what the drive "
        "could not have shown is listed."
    )
    most = inquiry(model=None, is_adequate=False, path_misfit=8.0)
    assert said("unexplained", inquiry=most) == (
        "No rate-independent law of hysteresis describes the recording, whatever its shape: 3 "
        "times the noise is left, and no effect of the catalogue explains it."
    )


def test_the_loop_s_shape_is_told_with_its_size():
    shape = Shape(0.31, "um", 0.97, "foh")
    falls = " With it the error on held-out data falls from 0.3 to 0.1 µm (noise floor 1 µm)."
    size = " The loop's shape differs from that of foh by 0.31 µm rms, 97 % of the mismatch."
    assert said("missing", [named(name="hysteresis_shape")], shape=shape) == (
        "The hysteresis loop of foh does not have the actuator's shape; no other effect is "
        f"significant.{size}{falls}"
    )
    both = said("missing", [named(), named(name="hysteresis_shape")], shape=shape)
    assert both.startswith("foh leaves out creep (")
    assert size in both


def test_jumps_are_told_at_the_end():
    jumps = "The response jumps by 2 µm at 3 s."
    assert said("unexplained", jumps=jumps) == f"{said('unexplained')} {jumps}"


def test_an_error_on_held_out_data_far_above_the_noise_is_remarked_on():
    far = HeldOut("recording", 9.0, 2.5, (9.0,), (2.5,), "b.csv")
    assert "That is still 2.5 times the noise: more is" in said("missing", [named()], held_out=far)


def test_an_error_on_held_out_data_that_rises_is_not_said_to_fall():
    worse = HeldOut("recording", 0.3, 0.31, (0.3,), (0.31,), "b.csv")
    assert "on held-out data rises from 0.3 to 0.31 µm" in said(
        "missing", [named()], held_out=worse
    )


@pytest.mark.parametrize(
    ("names", "distinguished", "all_apart", "chance", "said"),
    [
        (("creep", "thermal_drift"), (1,), True, 0.5,
         "{differs}thermal_drift{makes}0.50."),
        (("creep", "thermal_drift"), (1,), True, 0.49,
         "No drive within the limits is likely to distinguish creep from thermal_drift: the best "
         "of them, "
         "a sine of 3 Hz, does so with a probability of 0.49. Better would be {advice}."),
        (("creep", "backlash"), (1,), True, 1e-9,
         "No drive within the limits is likely to distinguish creep from backlash: the best of "
         "them, "
         "a sine of 3 Hz, does so with a probability of less than 0.01. Wider limits, less noise "
         "or a longer recording may help."),
        (("creep", "thermal_drift", "backlash"), (2,), False, 0.9,
         "{differs}backlash{makes}0.90. No single "
         "drive within the limits is likely to distinguish it from thermal_drift as well; better "
         "for that "
         "would be {advice}."),
        (("creep", "thermal_drift", "backlash"), (1,), False, 0.9,
         "{differs}thermal_drift{makes}0.90. No single "
         "drive within the limits is likely to distinguish it from backlash as well."),
        (("creep", "thermal_drift", "backlash"), (1, 2), False, 0.9,
         "{differs}thermal_drift and backlash{makes}0.90. None of the drives within the limits "
         "also distinguishes thermal_drift and "
         "backlash from each "
         "other."),
    ],
)  # fmt: skip
def test_the_next_experiment_promises_no_more_than_its_chance(
    names, distinguished, all_apart, chance, said
):
    drive = Drive("a sine of 3 Hz", np.zeros(2), STEP)
    proposed = next_experiment(names, Proposal(drive, chance, distinguished, all_apart, 0.123))
    assert proposed.separates == (names[0], *(names[k] for k in distinguished))
    differs = "Record a sine of 3 Hz: there creep differs from what "
    makes = (
        " could make of it by 0.12 noise floors rms or more, which distinguishes them with a "
        "probability of "
    )
    assert proposed.sentence == said.format(
        advice=advice("creep", "thermal_drift"), differs=differs, makes=makes
    )


@pytest.mark.parametrize(
    ("verdict", "extended", "doubts", "expected"),
    [
        ("unexplained", None, (), True),
        ("unexplained", None, ("The response leads.",), False),
        ("missing", 1.9, (), False),
        ("missing", 2.1, (), True),
        ("none", None, (), False),
    ],
)
def test_more_is_missing_where_nothing_is_named_or_far_more_than_the_noise_remains(
    verdict, extended, doubts, expected
):
    held_out = replace(HELD_OUT, extended_rmse=extended)
    findings: Any = SimpleNamespace(verdict=verdict, doubts=doubts, held_out=held_out, noise=KNOWN)
    assert is_incomplete(findings) is expected


def test_a_proposal_ends_in_the_command_for_both_recordings(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    parts = Part("rest", 0.0, 1.0, "the noise"), Part("slow path", 1.0, 2.0, "the hysteresis")
    drive = Drive("a designed drive of 2 s", np.zeros(2), STEP, parts)
    before = [Visible("creep", None, "um", "met once"), Visible("delay", 0.1, "um", "")]
    both = [Visible("creep", 0.02, "um", ""), Visible("delay", 0.09, "um", "")]
    experiment = completed_sentence(drive, before, both)
    assert experiment.sentence == (
        "Record a designed drive of 2 s (rest, slow path), whatever the hysteresis: it shows creep "
        "from 0.02 µm, peak to peak, which this recording does not."
    )
    assert (experiment.separates, experiment.probability) == ((), None)
    assert "no effect from a much smaller" in completed_sentence(drive, both, both).sentence

    def command(*sources: str) -> str:
        takes = [SimpleNamespace(recording=SimpleNamespace(source=name)) for name in sources]
        fit: Any = SimpleNamespace(
            preparation=SimpleNamespace(takes=takes), model=SimpleNamespace(name="foh >> creep")
        )
        return afterwards(experiment, fit).sentence.removeprefix(experiment.sentence)

    assert command("an array") == " Then diagnose both together."
    for name in ("a.csv", "my loop.csv"):
        (tmp_path / name).touch()
    assert command("a.csv", "my loop.csv") == (
        " Then diagnose both together: fracjax diagnose a.csv 'my loop.csv' RECORDED.csv --model "
        "'foh >> creep' --out both, with the options of this call."
    )


def test_advice_is_found_whichever_effect_holds_it():
    law = fj.EFFECTS["creep"].separated_by["drive_lag"]
    assert advice("creep", "drive_lag") == law
    assert advice("drive_lag", "creep") in {law, fj.EFFECTS["drive_lag"].separated_by.get("creep")}
    assert advice("creep", "creep") is None


def unrelated(seed: int) -> fj.Recording:
    """Drive and response are smooth, and have nothing to do with each other."""
    generator = np.random.default_rng(seed)
    drive, response = (
        lfilter([0.0025], np.convolve([1, -0.95], [1, -0.95]), generator.standard_normal(700))
        for _ in range(2)
    )
    return fj.Recording(50 * np.asarray(drive), 5 * np.asarray(response), 1e-2, "V", "um")


def test_a_model_that_follows_nothing_is_no_agreement_even_without_a_measured_noise():
    diagnosis = fj.diagnose("gain", unrelated(2))
    assert diagnosis.verdict == "unexplained"
    assert "Begin with another model: it explains only" in diagnosis.sentence


def test_a_response_that_leads_a_gain_is_said_to():
    diagnosis = fj.diagnose("gain", unrelated(0))
    assert diagnosis.verdict == "unexplained"
    assert "the response leads the drive by 29 degrees" in diagnosis.sentence
