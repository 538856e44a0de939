"""The marks of made-up answers."""

import json
from pathlib import Path

import pytest

from ..answers import Answer, read_answer
from ..measures import Measure
from .grade import failures
from .measures import cannot_show, fair, measure_all, named, wrong_names


def effect(name: str, shown: float = 50.0, *alike: str) -> dict:
    return {
        "name": name, "key": name, "size_um": 1.0, "detectability": shown,
        "detectability_any": shown, "accepted": [name, *alike], "accepted_any": [name],
    }  # fmt: skip


def label(case: str, *effects: dict, own_path: dict | None = None) -> dict:
    return {
        "case": case, "effects": list(effects), "own_path": own_path, "memory": "returning",
        "noise": {"colour": "white", "total_um": 0.1, "given": False}, "base": "maxwell_slip",
        "believed": None, "drive": "sine", "second_drive": None, "files": ["recording.csv"],
    }  # fmt: skip


def answer(*named_: tuple[str, float, tuple], can_show: tuple = (), um: float = 0.1) -> Answer:
    effects = tuple({"name": k, "probability": p, "confusable_with": s} for k, p, s in named_)
    lines = tuple({"effect": k, "size": size} for k, size in can_show)
    return Answer("missing" if effects else "none", effects, can_show=lines, rms_um=um)


def test_names() -> None:
    creep = effect("creep", 50.0, "viscoelastic_layer")
    x = label("001", creep)
    assert named(creep, answer(("creep", 0.9, ())))
    assert named(creep, answer(("delay", 0.5, ("creep", "drive_lag"))))
    assert not named(creep, answer(("delay", 0.5, ("creep", "drive_lag", "sensor_lag"))))
    assert not named(creep, answer(("viscoelastic_layer", 0.9, ())))
    wide = effect("drive_lag", 50.0, "sensor_lag", "delay", "clock_skew")
    assert named(wide, answer(("sensor_lag", 0.4, ("delay",))))
    assert not named(wide, answer(("sensor_lag", 0.4, ())))
    assert not wrong_names(x, answer(("viscoelastic_layer", 0.9, ()), ("backlash", 0.9, ())))
    assert wrong_names(x, answer(("delay", 0.9, ()))) == {"delay"}
    assert not wrong_names(x, answer(("saturation", 0.9, ())))
    assert wrong_names(x, answer(("saturation", 0.9, ())), ()) == {"saturation"}
    assert wrong_names(x, answer(("degradation", 0.9, ()))) == {"degradation"}
    worn = label("002", own_path={"detectability": 9.0, "alike": ["gain_drift"]})
    assert {"degradation", "gain_drift"} <= fair(worn)
    assert cannot_show(creep, answer(can_show=(("creep", None),)))
    assert cannot_show(creep, answer(can_show=(("delay", 0.1), ("creep", 1.2))))
    assert not cannot_show(creep, answer(can_show=(("creep", 0.8),)))
    assert not cannot_show(creep, answer())


def test_marks() -> None:
    pairs = [
        (label("001", effect("creep")), answer(("creep", 0.9, ()))),
        (label("002", effect("creep", 2.0)), answer(can_show=(("creep", None),))),
        (label("003", effect("delay", 2.0)), answer(can_show=(("creep", None),))),
        (label("004", effect("creep"), effect("delay")), answer(("creep", 0.9, ()))),
        (label("005", effect("creep"), effect("delay")),
         answer(("creep", 0.9, ()), ("delay", 0.9, ()))),
        (label("006"), answer(("delay", 0.8, ()), um=0.12)),
        (label("007"), answer(um=0.105)),
        (label("008"), Answer("failed")),
    ]  # fmt: skip
    m = {x.name.split(",")[0].split(" (")[0]: x for x in measure_all(pairs)}

    def measure(start: str) -> Measure:
        return next(v for k, v in m.items() if k.startswith(start))

    assert measure("names what is not there").failures == ["006"]
    assert measure("right").n == 5
    assert measure("not detectable").failures == ["003:delay"]
    assert measure("both of a pair").failures == ["004"]
    assert measure("nulls within").failures == ["006", "008"]
    assert measure("noise floors left").high == pytest.approx(1.2)
    assert measure("no answer").failures == ["008"]
    assert measure("calibration error of the probability").target == "<= .04"
    rows = failures(measure_all(pairs), pairs)
    assert next(r for r in rows if r["case"] == "006")["said"] == "delay(0.80)"


def test_answer_is_read_with_what_the_drive_can_show(tmp_path: Path) -> None:
    d = {
        "verdict": "none", "effects": [], "where": {"axes": []},
        "fit": {"unit": "nm", "base": {"train_rmse": 100.0, "holdout_rmse": None}},
        "can_show": [
            {"effect": "creep", "size": 50.0, "unit": "nm", "reason": ""},
            {"effect": "delay", "size": None, "unit": "nm", "reason": "every amplitude once"},
        ],
    }  # fmt: skip
    file = tmp_path / "diagnosis.json"
    file.write_text(json.dumps(d))
    a = read_answer(file)
    assert a.rms_um == pytest.approx(0.1)
    assert [x["size"] for x in a.can_show] == [pytest.approx(0.05), None]
    assert read_answer(tmp_path / "none.json").can_show == ()
