"""The design, a case and its label; the oracle and the rivals; the grading, on made-up answers."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ..actuator import rms
from ..answer import cases_of
from ..answers import Answer
from ..build import Made
from ..exam import plain, seal
from ..separability import SEPARABLE
from ..truth import EFFECTS
from .case import DETECTABLE, SEEN, build, draw_stage
from .design import BELIEVED, DECK, HALVES, Spec, design
from .exam import DIGITS, SEED, describe, make
from .grade import by_group, failures, main
from .kinds import FAMILIES, kind_of
from .measures import calibration, measure_all
from .noises import Noise, draw_noise
from .oracle import Oracle, span
from .rivals import Rivals, beyond_shape, look_alikes, off
from .signals import BOTTOM
from .stage import Stage

SPEC = Spec(7, "development", "duhem", "foh", "two", "two_sines", 500.0, 2000, True, 11)


@pytest.fixture(scope="module")
def case() -> Made:
    return build(SPEC)


@pytest.fixture(scope="module")
def stage() -> Stage:
    return draw_stage(SPEC)[0]


def test_design_is_balanced() -> None:
    specs = design(SEED)
    assert specs == design(SEED)
    assert specs != design(SEED + 1)
    assert [s.number for s in specs] == list(range(1, 289))
    assert len({s.seed for s in specs}) == 288
    cells = Counter((s.half, s.law, s.believed) for s in specs)
    assert set(cells.values()) == {6}
    assert {b for _, _, b in cells} == set(BELIEVED)
    for half in HALVES:
        assert Counter(s.content for s in specs if s.half == half) == DECK


def test_case_is_what_its_label_says(case: Made, stage: Stage) -> None:
    label = case.label
    sealed = plain(label, DIGITS)
    assert json.loads(json.dumps(sealed, allow_nan=False)) == sealed
    assert (label["case"], label["holdout"]) == ("case_0007", "case_0007.holdout.csv")
    first, second = label["effects"]
    assert first["kind"] == "dynamic"
    assert kind_of(second["name"]) == second["kind"]
    assert min(e["level"] for e in label["effects"]) >= SEEN
    for e in label["effects"]:
        assert e["separable"] == (e["power"] >= DETECTABLE and not e["look_alikes"])
        assert set(e["look_alikes"]) <= set(e["nine_tenths"]) or e["power"] * 0.1 < SEPARABLE
        assert e["beyond_shape"]["level"] <= np.sqrt(e["power"] / label["samples"]) + 1e-9
    pairs = [(EFFECTS[e["key"]], e["parameters"]) for e in label["effects"]]
    noise = case.recording[:, 2] - stage.recorded(pairs)
    assert rms(noise) == pytest.approx(label["noise"]["total_um"], rel=0.15)
    assert case.holdout is not None
    assert case.holdout[0, 1] == pytest.approx(case.recording[0, 1], abs=1e-6)
    assert SPEC.drive not in BOTTOM


def test_same_seed_same_case(case: Made, tmp_path: Path) -> None:
    label = make(SPEC, tmp_path)
    assert label == plain(case.label, DIGITS)
    recording = np.loadtxt(tmp_path / "case_0007.csv", delimiter=",", skiprows=1)
    assert np.allclose(recording, case.recording, rtol=1e-7, atol=1e-7)
    assert (tmp_path / "case_0007.holdout.csv").exists()
    other = build(replace(SPEC, seed=12, content="none", held_out=False))
    assert other.holdout is None
    assert other.label["effects"] == []
    assert not np.allclose(other.recording[:50, 2], case.recording[:50, 2])


def test_oracle_takes_up_its_own_law(stage: Stage) -> None:
    """Another gain, offset and shapes of the law itself leave next to nothing; a mode does not."""
    noise = Noise("white", 1e-3 * stage.scene.stroke, 0.0)
    oracle = Oracle(stage, noise)
    params = {k: v * 1.03 for k, v in stage.params.items()}
    changed = 1.05 * stage.with_params(params).recorded([]) + 0.3
    plain = stage.recorded([])
    assert rms(oracle.left(changed)) < 1e-3 * rms(changed - plain)
    assert rms(oracle.left(plain)) < 1e-12 * stage.scene.stroke
    mode = EFFECTS["mains_interference"]
    line = mode.parameters(0.01, mode.shape(np.random.default_rng(0)), stage.scene)
    y = stage.recorded([(mode, line)])
    assert rms(oracle.left(y)) > 0.95 * rms(y - plain)


def test_rivals(stage: Stage) -> None:
    """An effect of the simulator explains itself; lag and delay explain each other, not mains."""
    noise = Noise("white", 1e-3 * stage.scene.stroke, 0.0)
    oracle, rivals = Oracle(stage, noise), Rivals(stage, noise, 3)
    e = EFFECTS["delay"]
    pair = (e, e.parameters(0.3, {}, stage.scene))
    mark = noise.whiten(oracle.left(stage.recorded([pair])))
    power = float(mark @ mark)
    apart = rivals.separation(mark, oracle.basis, "")
    assert apart["delay"] < 0.01 * power
    assert apart["drive_lag"] < 0.1 * power
    assert apart["mains_interference"] > 0.9 * power
    assert "delay" not in rivals.separation(mark, oracle.basis, "delay")
    assert look_alikes({"b": 24.9, "a": 1.0, "c": 25.1}) == ["a", "b"]
    wide = beyond_shape(stage.drive(stage.drive.times), oracle.tangent, noise)
    v = stage.drive(stage.drive.times)
    assert rms(off(wide, noise.whiten(v**3))) < 1e-6 * rms(noise.whiten(v**3))


def test_span_drops_what_repeats() -> None:
    x = np.random.default_rng(0).standard_normal((50, 3))
    assert span(np.column_stack([x, x[:, 0] + x[:, 1]])).shape == (50, 3)


@pytest.mark.parametrize(("colour", "order"), [("white", 0), ("ar", 0.8), ("pink", 0.9)])
def test_noise(colour: str, order: float) -> None:
    """Size, and whitening back to independent samples of variance 1."""
    noise = Noise(colour, 0.01, order)
    x = np.column_stack([noise.sample(4000, np.random.default_rng(k)) for k in range(12)])
    assert rms(x) == pytest.approx(0.01, rel=0.12)
    white = noise.whiten(x)[1:]
    assert rms(white) == pytest.approx(1, rel=0.02)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.02
    assert np.allclose(noise.whiten(x[:, 3]), noise.whiten(x)[:, 3], rtol=0, atol=1e-9)


def test_rounding() -> None:
    noise = Noise("quantised", 0.01, 3.0)
    y = noise.recorded(noise.sample(20000, np.random.default_rng(0)) + np.linspace(0, 5, 20000))
    assert np.allclose(y / 0.03, np.round(y / 0.03), rtol=0, atol=1e-9)
    assert rms(y - np.linspace(0, 5, 20000)) == pytest.approx(noise.total, rel=0.02)
    colours = {draw_noise(np.random.default_rng(k), 10.0).colour for k in range(40)}
    assert colours == {"white", "ar", "pink", "quantised"}


def test_kinds() -> None:
    names = [name for family in FAMILIES.values() for name in family]
    assert len(names) == len(set(names)) == 17
    assert [kind_of(k) for k in ("creep", "saturation", "backlash", "jumps")] == [
        "dynamic", "static", "shape", "dynamic",
    ]  # fmt: skip


def label(number: int, *effects: dict, **more: object) -> dict:
    return {
        "case": f"case_{number:04d}", "half": "sealed", "base": "duhem", "believed": "foh",
        "drive": "sine", "effects": list(effects), "own_rate": None, "floor": "rest",
        "noise": {"colour": "white"}, "samples": 2000, "holdout": None,
    } | more  # fmt: skip


def effect(name: str, **more: object) -> dict:
    return {
        "name": name, "kind": kind_of(name), "level": 3.0, "power": 900.0, "separable": True,
        "look_alikes": [], "nine_tenths": [], "beyond_shape": {"level": 2.0, "look_alikes": []},
    } | more  # fmt: skip


def said(name: str, probability: float = 0.9, with_: tuple[str, ...] = ()) -> dict:
    return {"name": name, "probability": probability, "confusable_with": list(with_)}


def answer(*effects: dict, verdict: str = "missing") -> Answer:
    return Answer(verdict, effects)


RATE = {"level": 3.0, "power": 900.0, "alike": ["drive_lag"]}
ALIKE = effect("creep", separable=False, look_alikes=["thermal_drift"])
PAIRS = [
    (label(1), answer(verdict="none")),
    (label(2), answer(said("hysteresis_shape"))),
    (label(3), answer(said("second_mode"))),
    (label(4), answer(said("saturation"), said("backlash"))),
    (label(5, own_rate=RATE), answer(said("drive_lag"))),
    (label(6, own_rate=RATE | {"power": 9.0}), answer(said("drive_lag"))),
    (label(7, effect("creep")), answer(said("creep"))),
    (label(8, effect("creep")), answer(said("delay", 0.5, ("creep", "drive_lag")),
                                       verdict="confusable")),
    (label(9, effect("creep")), answer(said("delay", 0.5, ("creep", "slew_rate_limit", "jumps")),
                                       verdict="confusable")),
    (label(10, ALIKE), answer(said("thermal_drift"))),
    (label(11, effect("creep"), effect("saturation")), answer(said("hysteresis_shape"))),
    (label(12, effect("delay", nine_tenths=["drive_lag"])), answer(said("drive_lag"))),
    (label(13, effect("creep", beyond_shape={"level": 0.3, "look_alikes": []})), Answer("failed")),
]  # fmt: skip


def value(name: str) -> tuple[float, int]:
    m = next(m for m in measure_all(PAIRS) if m.name.startswith(name))
    return m.value, m.n


def test_measures() -> None:
    assert value("physics named") == (5 / 13, 13)
    assert value("the same, static curves too") == (6 / 13, 13)
    assert value("the same, but for what explains") == (4 / 13, 13)
    assert value("dynamic effect first or") == (2 / 6, 6)
    assert value("the same, visible >= 1") == (2 / 5, 5)
    assert value("dynamic effect in any set") == (3 / 6, 6)
    assert value("no dynamics: none named") == (4 / 6, 6)
    assert value("no dynamics, law without rate") == (3 / 4, 4)
    assert value("static curve named") == (1, 1)
    assert value("no answer") == (1 / 13, 13)


def test_calibration() -> None:
    pairs = [(label(k), answer(said("delay" if k % 5 else "backlash", 0.2))) for k in range(50)]
    every, _, dynamic, _ = calibration(pairs)
    assert every.value == pytest.approx(0.0, abs=1e-12)
    assert dynamic.value == pytest.approx(0.2)
    assert dynamic.n == 40


def test_groups_and_failures() -> None:
    rows = failures(measure_all(PAIRS), PAIRS)
    wrong = {r["case"] for r in rows if r["measure"].startswith("physics named")}
    assert wrong == {f"case_{k:04d}" for k in (3, 6, 8, 9, 12)}
    assert "case_0009:creep" in {r["case"] for r in rows if "set of 3" in r["measure"]}
    row = next(r for r in rows if r["case"] == "case_0003")
    assert (row["truth"], row["said"]) == ("none", "second_mode")
    other = [(label(20, base="lugre"), answer(verdict="none"))]
    rows = [r for r in by_group([*PAIRS, *other]) if r["measure"].startswith("physics named")]
    assert {(r["by"], r["group"]): r["n"] for r in rows} == {
        ("base", "duhem"): 13, ("base", "lugre"): 1, ("drive", "sine"): 14, ("believed", "foh"): 14,
        ("floor", "rest"): 14,
    }  # fmt: skip
    effects = {r["group"]: r["n"] for r in by_group(PAIRS) if r["by"] == "effect"}
    assert effects == {"creep": 5, "delay": 1}
    assert "{0: 6, 1: 6, 2: 1}; dynamic 7, separable 6" in describe([x for x, _ in PAIRS])


def test_tables_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    labels = [label(1), label(2, effect("creep")), label(3, half="development")]
    (tmp_path / "labels.json").write_text(json.dumps(labels))
    (tmp_path / "labels.sha256").write_text(f"{seal(labels)}  labels\n")
    (tmp_path / "case_0001").mkdir()
    (tmp_path / "case_0001" / "seconds.txt").write_text("3.5\n")
    folder = tmp_path / "marks"
    told = ["--exam", str(tmp_path), "--answers", str(tmp_path), "--to", str(folder)]
    monkeypatch.setattr("sys.argv", ["grade", *told, "--half", "sealed"])
    main()
    table = (folder / "grade.csv").read_text()
    assert "physics named that is not there,<= .03,0.0000,0.0000,0.6576,2" in table
    assert '"seconds, median",,3.5,,,1' in table
    assert (folder / "labels.sha256").read_text().startswith(seal(labels))
    printed = capsys.readouterr().out
    assert "by believed:" in printed
    assert cases_of(tmp_path, slice(1))[0] == {
        "case": "case_0001", "holdout": None, "samples": 2000, "base": "foh",
    }  # fmt: skip
