"""The exam's design, seal and cases; and the grading, on made-up diagnoses."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from . import separability
from .answers import Answer, covered, read_answer
from .build import Spec, build
from .design import LEVELS, design, subset
from .exam import canonical, describe, is_concealed, part_of, plain, seal, write_exam
from .grade import by_effect, concealed, failures, load, main, table
from .measures import calibration, confidently_wrong, heldout, measure_all, wilson
from .separability import unexplained, unexplained_by
from .survey import look
from .truth import BASES, NAMES, NOISES, name_of

SPECS = design(5)
EASY = Spec(
    "main", ("saturation",), (1.0,), "foh", "ladder", 1000.0, 2000, "white", 1e-3, 3, "sine"
)


def test_design_is_balanced() -> None:
    assert design(5) == SPECS
    assert design(6) != SPECS
    kinds = Counter(s.kind for s in SPECS)
    assert len(SPECS) >= 1000
    assert kinds["null"] >= 300
    assert kinds["concealed"] >= 300
    mine = [s for s in SPECS if s.kind == "main"]
    cells = Counter((name_of(s.effects[0]), s.levels[0], s.base) for s in mine)
    assert set(cells) == {(e, v, b) for e in NAMES for v in LEVELS for b in BASES}
    for e in NAMES:
        assert len({s.drive for s in mine if name_of(s.effects[0]) == e}) >= 5
    nulls = Counter((s.noise, s.base) for s in SPECS if s.kind == "null")
    assert set(nulls) == {(n, b) for n in NOISES for b in BASES}
    assert len({s.seed for s in SPECS}) == len(SPECS)
    assert 0.28 < np.mean([s.holdout is not None for s in SPECS]) < 0.4
    ci = subset(SPECS)
    assert len(set(ci)) == 100
    assert set(Counter(SPECS[k].kind for k in ci)) == set(kinds)


def test_seal() -> None:
    labels = [plain({"b": 1 / 3, "a": (1, 2)}), plain({"x": None})]
    assert canonical(labels) == '[{"a":[1,2],"b":0.33333333},{"x":null}]'
    assert seal(labels) == seal(json.loads(json.dumps(labels)))
    assert seal(labels) != seal(labels[::-1])


def test_case_is_what_it_says() -> None:
    """Level, concealment, files' columns; the same seed gives the same case."""
    made = build(EASY)
    truth = made.label["effects"][0]
    assert truth["level"] == pytest.approx(1.0, abs=0.1)
    assert truth["separable"]
    assert truth["spot"]["axis"] == "level"
    assert made.recording.shape == (made.label["samples"], 3)
    assert made.holdout is not None
    sd = made.label["noise_sd_um"]
    assert made.label["oracle_rmse_um"] == pytest.approx(sd, rel=0.1)
    assert 1 < made.label["oracle_fit_rmse_um"] / made.label["oracle_rmse_um"] < 1.1
    assert sd == pytest.approx(1e-3 * made.label["stroke_um"])
    assert max(made.label["between_samples"].values()) < 0.5
    still = made.recording[:, 0] < 0.2  # the rest before the drive moves shows the noise alone
    assert np.std(made.recording[still, 2]) == pytest.approx(sd, rel=0.25)
    again = build(EASY)
    assert np.array_equal(again.recording, made.recording)


@pytest.mark.parametrize("base", list(BASES))
def test_null_is_absorbed(base: str) -> None:
    made = build(replace(EASY, kind="null", effects=(), levels=(), base=base, noise="ar"))
    assert made.label["level"] < 0.01
    assert made.label["effects"] == []
    assert made.label["R2"] > 0.9999


def test_look_alikes() -> None:
    """Lags on a slow sine pass for each other, never for mains hum, and the base hides them."""
    lag = replace(EASY, effects=("delay",), drive="sine", base="bouc_wen", holdout=None)
    made = build(lag)
    truth = made.label["effects"][0]
    assert {"drive_lag", "sensor_lag"} <= set(truth["look_alikes"])
    assert "mains_interference" not in truth["look_alikes"]
    assert not truth["separable"]
    assert made.label["concealment"] > 0.9
    rows = {r["effect"]: r for r in look("bouc_wen", "sine", "mid", samples=1000)}
    assert rows["delay"]["concealment"] > 0.9
    assert rows["mains_interference"]["concealment"] < 0.1


def test_look_alikes_of_a_law_that_the_refit_has_left_far_behind(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where about the refit nothing comes near the truth, not its own law, all are compared about
    the actuator's own."""
    monkeypatch.setattr(separability, "unexplained_by", lambda _, truth, __: float(truth @ truth))
    lag = replace(EASY, effects=("drive_lag",), base="foh", drive="wander", holdout=None)
    truth = build(replace(lag, samples=1000)).label["effects"][0]
    assert "delay" in truth["look_alikes"]
    assert truth["least_lambda"] < 0.01 * truth["power"]


def test_what_creeps_back_is_no_creep() -> None:
    """Two draws of a law span its shapes; the sign of their sum is its amplitude's."""
    rng = np.random.default_rng(5)
    one, two, other = np.linalg.qr(rng.standard_normal((200, 3)))[0].T
    draws = np.column_stack([2 * one + 0.5 * two, one - 0.4 * two])
    for sign, left, name in ((1, 1, "creep"), (-1, 10, "creep"), (-1, 1, "viscoelastic_layer")):
        assert unexplained_by(name, sign * 3 * one + other, draws) == pytest.approx(left)
    bent = draws @ [1.2, -0.2]  # beyond a draw, by less than half of their distance
    assert unexplained_by("creep", bent, draws) == pytest.approx(0, abs=1e-12)


def test_a_difference_of_two_cubes_is_no_cube() -> None:
    x = np.linspace(-1, 1, 201)
    cubes = np.column_stack([(x - 0.05) ** 3, -((x + 0.05) ** 3)])
    cubes, square = cubes - cubes.mean(axis=0), x**2 - np.mean(x**2)
    assert unexplained(square, cubes) < 1e-9 * (square @ square)
    assert unexplained_by("cubic_nonlinearity", square, cubes) > 0.9 * (square @ square)
    assert unexplained_by("cubic_nonlinearity", -(x**3), cubes) < 0.01 * np.sum(x**6)


@pytest.mark.slow
def test_quantised_and_double_cases() -> None:
    coarse = build(replace(EASY, effects=("quantisation",), levels=(3.0,)))
    lsb = coarse.label["effects"][0]["parameters"]["lsb"]
    codes = coarse.recording[:, 2] / lsb
    assert np.ptp((codes - codes[0]) - np.round(codes - codes[0])) < 1e-6
    assert coarse.label["effects"][0]["level"] == pytest.approx(3, rel=0.05)
    pair = replace(
        EASY, kind="two", effects=("saturation", "mains_interference"), levels=(1.0, 3.0)
    )
    both = build(pair).label
    assert [e["name"] for e in both["effects"]] == ["saturation", "mains_interference"]
    assert both["level"] == pytest.approx(np.hypot(1, 3), rel=0.1)


def test_exam_is_written_and_sealed(tmp_path: Path) -> None:
    labels = write_exam(tmp_path, [(0, EASY), (41, replace(EASY, effects=(), levels=()))])
    assert [x["case"] for x in labels] == ["case_0001", "case_0042"]
    for name in ("case_0001", "case_0001.holdout", "case_0042"):
        text = (tmp_path / f"{name}.csv").read_text().splitlines()
        assert text[0] == "time_s,voltage_V,displacement_um"
        assert len(text) > 1900
    assert len(load(tmp_path, tmp_path)) == 2
    assert [x["case"] for x, _ in load(tmp_path, tmp_path, part_of("1:"))] == ["case_0042"]
    altered = [labels[0] | {"base": "lfdh"}, labels[1]]
    (tmp_path / "labels.json").write_text(json.dumps(altered))
    with pytest.raises(SystemExit, match="sealed hash"):
        load(tmp_path, tmp_path)


# ---- grading -----------------------------------------------------------------------------------


def label(case: int, name: str | None = "backlash", **more) -> dict:
    effect = {
        "name": name, "key": name, "catalogued": True, "level": 1.0, "capped": False,
        "separable": True, "look_alikes": [], "power": 4000.0, "least_lambda": 900.0,
        "axes": ["reversal"], "spot": None, "parameters": {"radius": 0.02, "weight": 1.0},
    }  # fmt: skip
    effects = [effect | {k: v for k, v in more.items() if k in effect}] if name else []
    whole = {
        "case": f"case_{case:04d}", "kind": "main" if name else "null", "effects": effects,
        "level": 1.0, "concealment": 0.5, "R2": 0.9999, "base": "foh", "noise": "white",
        "oracle_rmse_um": None, "oracle_fit_rmse_um": None, "spec": {"drive": "sine"},
    }  # fmt: skip
    return whole | {k: v for k, v in more.items() if k in whole}


def said(name: str, probability: float = 0.95, also: tuple[str, ...] = (), **parameters) -> dict:
    return {
        "name": name, "probability": probability, "confusable_with": list(also),
        "parameters": parameters,
    }  # fmt: skip


def answer(*effects: dict, verdict: str = "missing", axis: str = "reversal", **more) -> Answer:
    axes = ({"axis": axis, "p_value": 1e-9, "intervals": [[0, 1]]},
            {"axis": "time", "p_value": 0.5, "intervals": []})  # fmt: skip
    return Answer(verdict, effects, axes, **more)


def value(pairs: list, start: str) -> tuple[float, int]:
    m = next(m for m in measure_all(pairs) if m.name.startswith(start))
    return m.value, m.n


def test_wilson() -> None:
    """Against the published example of 81 out of 263 (Newcombe 1998)."""
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson(0, 0) == (0.0, 1.0)


def test_false_alarms_and_confident_errors() -> None:
    pairs = [
        (label(1, None), answer(verdict="none")),
        (label(2, None), answer(said("delay"))),
        (label(3, None), answer(verdict="unexplained")),
        (label(4, None), Answer("failed")),
        (label(5), answer(said("delay", 0.99))),
        (label(6), answer(said("delay", 0.99, ("backlash",)), verdict="confusable")),
        (label(7), answer(said("delay", 0.6))),
        (label(8), answer(said("backlash", 0.99))),
    ]
    assert value(pairs, "false alarms") == (0.75, 4)
    assert value(pairs, "confident and wrong") == (2 / 8, 8)
    assert [confidently_wrong(*p) for p in pairs] == [0, 1, 0, 0, 1, 0, 0, 0]


def test_names_and_sets() -> None:
    pairs = [
        (label(1), answer(said("backlash"))),
        (label(2), answer(said("delay", 0.6, ("backlash", "creep")), verdict="confusable")),
        (label(3, level=0.1), answer(said("backlash"))),
        (label(4, level=0.1), answer(verdict="none")),
        (label(5, separable=False, look_alikes=["delay"]), answer(said("backlash"))),
        (label(6, separable=False, look_alikes=["delay"]),
         answer(said("delay", 0.5, ("backlash",)), verdict="confusable")),
        (label(7, level=0.01), answer(verdict="none")),
        (label(8, level=0.1, power=9.0), answer(verdict="none")),
    ]  # fmt: skip
    assert value(pairs, "first name right, separable, visible >=") == (0.5, 2)
    assert value(pairs, "first name right, separable, visible .1") == (1 / 3, 3)
    assert value(pairs, "truth in the reported set, all") == (5 / 7, 7)
    assert value(pairs, "truth in the reported set, det") == (5 / 6, 6)
    assert value(pairs, "mean size of the reported set, visible") == (7 / 4, 4)
    assert value(pairs, "mean size of the reported set, sep") == (2, 2)
    assert value(pairs, "mean size of the truth's own set") == (3 / 2, 4)
    assert value(pairs, "inseparable") == (0.5, 2)
    rows = by_effect(pairs)
    assert rows[0]["separable"] == 5
    assert rows[0]["in_set"] == 5


def test_after_the_recommended_record() -> None:
    """Judged by the second answer, where there is a folder for one."""
    look_alikes = ["creep"]
    both = said("creep", 0.6, ("backlash",))
    right, undecided = answer(said("backlash")), answer(both, verdict="confusable")
    pairs = [
        (label(k, look_alikes=look_alikes), answer(both, chance=chance, after=after))
        for k, chance, after in (
            (1, 0.99, right), (2, 0.5, undecided), (3, 0.1, right), (4, 0.2, Answer("failed")),
            (5, 0.9, answer(said("creep"))), (6, 0.9, None),
        )
    ]  # fmt: skip
    pairs.append((label(7), answer(both, chance=0.9, after=right)))
    assert value(pairs, "right after the recommended") == (2 / 5, 5)
    assert value(pairs, "right after a record said") == (1 / 3, 3)
    assert value(pairs, "truth in the set after") == (3 / 5, 5)
    rows = {r["case"]: r for r in failures(measure_all(pairs), pairs) if "after" in r["measure"]}
    assert set(rows) == {"case_0002/after", "case_0004/after", "case_0005/after"}
    assert rows["case_0002/after"]["confusable_with"] == "backlash"
    assert rows["case_0004/after"]["verdict"] == "failed"


def test_concealed_tier() -> None:
    """The same measures on the cases that the exam counts as concealed, where it has any."""
    hidden = {"concealment": 0.95, "R2": 0.9995}
    two = {"effects": label(5)["effects"] * 2}
    labels = [
        label(1) | hidden, label(2) | hidden, label(3) | hidden | {"R2": 0.99}, label(4),
        label(5) | hidden | two, label(6, None) | hidden,
    ]  # fmt: skip
    assert [is_concealed(x) for x in labels] == [True, True, False, False, False, False]
    assert describe(labels).endswith(": 2")
    named = ["backlash", "creep", *["backlash"] * 4]
    pairs = [(x, answer(said(name))) for x, name in zip(labels, named, strict=True)]
    rows = {m.name: (m.value, m.n) for m in concealed(pairs)}
    assert rows["first name right, separable, visible >= .3"] == (0.5, 2)
    assert "false alarms on nulls" not in rows
    assert "two effects, both named" not in rows


def test_places_and_outsiders() -> None:
    spot = {"axis": "reversal", "value": 0.5}
    nameless = {"kind": "outside", "catalogued": False}
    pairs = [
        (label(1, spot=spot), answer(said("backlash"))),
        (label(2, spot=spot | {"value": 3.0}), answer(said("backlash"))),
        (label(3), answer(said("backlash"), axis="frequency")),
        (label(4, "jumps", **nameless), answer(verdict="unexplained")),
        (label(5, "jumps", **nameless), answer(said("creep"))),
        (label(6, "jumps", **nameless, least_lambda=10.0), answer(said("creep"))),
    ]
    assert value(pairs, "right axis") == (5 / 6, 6)
    assert value(pairs, "right bin") == (0.5, 2)
    assert value(pairs, "out of catalogue") == (0.5, 2)


def test_two_effects() -> None:
    both = label(1)
    both["effects"].append(label(2, "delay")["effects"][0])
    right, half = answer(said("delay"), said("backlash")), answer(said("delay"))
    assert value([(both, right), (both, half)], "two effects") == (0.5, 2)


def test_heldout_ratio() -> None:
    known = {"oracle_rmse_um": 0.01, "oracle_fit_rmse_um": 0.0125}
    pairs = [(label(k, **known), answer(holdout_um=0.01 * r))
             for k, r in enumerate((1.0, 1.02, 1.04, 1.2, 3.0))]  # fmt: skip
    fit, fit_close, median, close = heldout([*pairs, (label(9, **known), Answer("failed"))])
    assert (median.value, median.n) == (pytest.approx(1.04), 5)
    assert (close.value, close.n) == (0.5, 6)
    assert (fit.value, fit_close.value) == (pytest.approx(0.832), pytest.approx(4 / 6))


def test_parameters_and_units() -> None:
    def number(v: float, low: float, high: float, unit: str) -> dict:
        return {"value": v, "low": low, "high": high, "unit": unit}

    effect = label(1)["effects"][0]
    assert covered(effect, said("backlash", r=number(19, 15, 25, "nm"))) == {"radius": True}
    assert covered(effect, said("backlash", r=number(0.03, 0.025, 0.035, "um"))) == {
        "radius": False
    }
    assert covered(effect, said("backlash", r=number(1, 0, 2, "V"))) == {}
    mode = {"name": "resonance", "key": "resonance", "parameters": {"period": 0.005, "zeta": 0.02}}
    got = covered(mode, said("resonance", f0=number(1200, 1250, 1260, "rad/s")))
    assert got == {"frequency": True}
    pairs = [(label(1), answer(said("backlash", radius=number(0.02, 0.01, 0.03, "um")))),
             (label(2), answer(said("delay", radius=number(0.02, 0.01, 0.03, "um"))))]  # fmt: skip
    assert value(pairs, "parameter in") == (1.0, 1)


def test_calibration() -> None:
    pairs = [(label(k), answer(said("backlash" if k % 5 else "delay", 0.8))) for k in range(50)]
    found, exact = calibration(pairs)
    assert found.value == pytest.approx(0.0, abs=1e-12)
    # The mean size of a binomial's deviation, 50 cases of probability 0.8, over 50.
    assert exact.value == pytest.approx(np.sqrt(2 / np.pi * 0.8 * 0.2 / 50), rel=0.1)
    sure = [(x, answer(said(a.first, 1.0))) for x, a in pairs]
    assert calibration(sure)[0].value == pytest.approx(0.2)


def test_diagnosis_file_is_read(tmp_path: Path) -> None:
    d = {
        "verdict": "missing", "effects": [said("creep")],
        "where": {"axes": [{"axis": "time", "p_value": 0.01, "intervals": []}], "summary": ""},
        "fit": {"unit": "nm", "base": {"holdout_rmse": 30.0}, "extended": {"holdout_rmse": 10.0}},
    }  # fmt: skip
    file = tmp_path / "diagnosis.json"
    file.write_text(json.dumps(d))
    a = read_answer(file)
    assert (a.first, a.holdout_um) == ("creep", pytest.approx(0.01))
    assert a.axis is not None
    assert a.axis["axis"] == "time"
    assert (a.chance, a.after) == (None, None)
    assert read_answer(tmp_path / "no.json").verdict == "failed"
    second = tmp_path / "after" / "diagnosis.json"
    second.parent.mkdir()
    file.write_text(json.dumps(d | {"next_experiment": {"probability": 0.7}}))
    a = read_answer(file)
    assert (a.chance, a.after) == (0.7, Answer("failed"))
    second.write_text(json.dumps(d | {"verdict": "none"}))
    after = read_answer(file).after
    assert after is not None
    assert after.verdict == "none"


def test_tables() -> None:
    pairs = [(label(1), answer(said("delay", 0.99))), (label(2, None), answer(verdict="none"))]
    measures = measure_all(pairs)
    rows = failures(measures, pairs)
    assert {r["case"] for r in rows} == {"case_0001"}
    assert rows[0]["truth"] == "backlash"
    assert rows[0]["said"] == "delay"
    assert [r["measure"] for r in table(measures)] == [m.name for m in measures]


def test_tables_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The concealed cases' table is that of the whole on them alone, beside it and after it."""
    labels = [label(1), label(2, concealment=0.95)]
    (tmp_path / "labels.json").write_text(json.dumps(labels))
    (tmp_path / "labels.sha256").write_text(f"{seal(labels)}  labels")
    told = ["--exam", str(tmp_path), "--answers", str(tmp_path), "--to", str(tmp_path / "marks")]
    monkeypatch.setattr("sys.argv", ["grade", *told])
    main()
    whole, hidden = (
        (tmp_path / "marks" / f"{name}.csv").read_text().splitlines()
        for name in ("grade", "concealed")
    )
    assert hidden[0] == whole[0]
    assert '"first name right, separable, visible >= .3",>= .97,0.0000,0.0000,0.7935,1' in hidden
    assert 1 < len(hidden) < len(whole)
    printed, printed_hidden = capsys.readouterr().out.split("\nconcealed (C >= .9, R2 > .999):\n")
    assert len(printed.splitlines()) == len(whole) - 1
    assert len(printed_hidden.splitlines()) == len(hidden) - 1
