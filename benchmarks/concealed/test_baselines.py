"""The simpler ways on built cases, on planted effects, and in the table."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import EFFECTS

from .answers import read_answer
from .baselines import (
    MEANING,
    WAYS,
    Seen,
    answer,
    compared,
    correlation,
    forward,
    library_of,
    seen_of,
    sindy,
    sparse_regression,
)
from .build import build
from .exam import seal, write_exam
from .test_exam import EASY, label, said

pytestmark = pytest.mark.slow

NULL = replace(EASY, kind="null", effects=(), levels=(), holdout=None)


@cache
def fitted(effect: str | None) -> Seen:
    """The base fitted to a built case, with a few effects for the refits."""
    spec = replace(NULL, kind="main", effects=(effect,), levels=(3.0,)) if effect else NULL
    time_s, drive, response = build(spec).recording.T
    recording = fj.Recording(drive, response, float(np.diff(time_s).mean()), "V", "um")
    return seen_of(recording, "foh")


def few(known: Seen, way: str) -> Seen:
    """For refits, which are slow, three effects only."""
    names = ("electrostriction", "saturation", "thermal_drift")
    kept = {name: known.columns[name] for name in names}
    return replace(known, columns=kept) if way == "refit_all" else known


@pytest.mark.parametrize("way", WAYS)
def test_easy_case_is_named_and_null_is_quiet(way: str) -> None:
    found = WAYS[way](few(fitted("saturation"), way))
    assert found["effects"][0]["name"] == "saturation"
    assert found["verdict"] in ("missing", "confusable")
    assert WAYS[way](few(fitted(None), way)) == {"verdict": "none", "effects": []}


def planted(**sizes: float) -> Seen:
    """A null with the marks of effects in what its fit leaves, so many times the noise."""
    null = fitted(None)
    marks = sum(size * null.columns[name][0] for name, size in sizes.items())
    return replace(null, residual=null.residual + marks)


def test_sets_and_probabilities() -> None:
    found = correlation(planted(backlash=40.0))
    (first,) = found["effects"]
    assert first["name"] == "backlash"
    assert "coulomb_friction" in first["confusable_with"]
    assert first["probability"] == 1 / (1 + len(first["confusable_with"]))
    assert found["verdict"] == "confusable"
    alone = correlation(planted(mains_interference=40.0))
    assert alone["verdict"] == "missing"
    assert alone["effects"][0]["probability"] == 1.0


def test_forward_names_one_after_another() -> None:
    found = forward(planted(thermal_drift=30.0, mains_interference=60.0))
    names = [effect["name"] for effect in found["effects"]]
    assert names == ["mains_interference", "thermal_drift"]
    null = fitted(None)
    lines = null.columns["mains_interference"]
    both = forward(replace(null, residual=40 * lines[0] + 30 * lines[1]))  # of one effect
    assert [effect["name"] for effect in both["effects"]] == ["mains_interference"]
    asked = np.sqrt(10 + np.log(null.solved.samples))
    assert forward(replace(null, residual=1.01 * asked * lines[0]))["effects"]
    assert not forward(replace(null, residual=0.99 * asked * lines[0]))["effects"]


def test_alarm_without_a_name() -> None:
    odd = replace(fitted(None), unlike_noise=True)
    assert correlation(odd)["verdict"] == "unexplained"
    k = odd.terms.index("u")  # speaks for no effect
    odd = replace(odd, residual=odd.residual + 40 * odd.library[k], terms=["u"] * len(odd.terms))
    assert sindy(odd) == {"verdict": "unexplained", "effects": []}
    assert sindy(replace(odd, unlike_noise=False))["verdict"] == "none"


def test_sparse_regression() -> None:
    """Two terms of thirty are found; of noise alone none, not even in columns nearly alike."""
    generator = np.random.default_rng(1)
    columns = generator.standard_normal((30, 500))
    columns[1] = columns[0] + 1e-3 * columns[1]
    columns /= np.linalg.norm(columns, axis=1, keepdims=True)
    noise = generator.standard_normal(500)
    found = sparse_regression(columns, 30 * columns[7] - 20 * columns[20] + noise, 3.5)
    assert np.flatnonzero(found).tolist() == [7, 20]
    assert found[7] > -found[20] > 0
    assert not sparse_regression(columns, noise, 3.5).any()


def test_library_speaks_for_known_effects() -> None:
    time = np.arange(0, 4, 1e-3)
    recording = fj.Recording(np.sin(time), np.cos(time), 1e-3, "V", "um")
    terms, columns = library_of(recording, np.cos(time))
    assert set(terms) == set(MEANING)
    assert columns.shape == (len(terms), time.size)
    assert {name for meant in MEANING.values() for name in meant} <= set(EFFECTS)


def test_answers_are_read_back(tmp_path: Path) -> None:
    (case,) = write_exam(tmp_path, [(0, replace(EASY, levels=(3.0,), holdout=None))])
    ways = ["correlation", "sindy"]
    lines = answer(case, tmp_path, tmp_path, ways).splitlines()
    assert [line.split(": ")[0] for line in lines] == [f"case_0001, {way}" for way in ways]
    for way in ways:
        assert read_answer(tmp_path / way / "case_0001" / "diagnosis.json").first == "saturation"
        assert float((tmp_path / way / "case_0001" / "seconds.txt").read_text()) > 0
    assert "there already" in answer(case, tmp_path, tmp_path, ways[:1])
    assert "failed" in answer(case | {"case": "case_0002"}, tmp_path, tmp_path, ways)
    assert read_answer(tmp_path / "sindy" / "case_0002" / "diagnosis.json").verdict == "failed"


def test_table_is_of_the_same_cases(tmp_path: Path) -> None:
    labels = [label(1), label(2), label(3, None), label(4, None)]
    (tmp_path / "labels.json").write_text(json.dumps(labels))
    (tmp_path / "labels.sha256").write_text(seal(labels))
    answers = {
        "fracjax": ["backlash", "backlash", None],
        "sindy": ["delay", "backlash", "creep", None],  # the last is not fracjax's
        "forward": ["delay", "backlash"],
    }
    for way, names in answers.items():
        for case, name in zip(labels, names, strict=False):
            d = {
                "verdict": "missing" if name else "none", "effects": [said(name)] if name else [],
                "where": {"axes": []}, "fit": {"base": {}},
            }  # fmt: skip
            file = tmp_path / way / case["case"] / "diagnosis.json"
            file.parent.mkdir(parents=True)
            file.write_text(json.dumps(d))
    (tmp_path / "forward" / "case_0002" / "diagnosis.json").unlink()  # as a failure leaves it
    rows = compared(tmp_path, tmp_path / "fracjax", tmp_path)

    def measured(measure: str) -> dict[str, tuple[float, int]]:
        return {r["way"]: (float(r["value"]), r["n"]) for r in rows if r["measure"] == measure}

    nulls = measured("false alarms on nulls")
    assert list(nulls) == ["fracjax", "sindy", "forward", "fracjax, same cases as forward"]
    assert [nulls["fracjax"], nulls["sindy"]] == [(0.0, 1), (1.0, 1)]
    assert nulls["forward"][1] == 0
    firsts = measured("first name right, separable, visible >= .3")
    assert list(firsts.values()) == [(1.0, 2), (0.5, 2), (0.0, 2), (1.0, 2)]
    assert not measured("right axis, visible >= .3")
