"""The recommended record, of which a closed form knows the truth; and how an answer is followed."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from . import follow_up as module
from .answer import NEXT
from .follow_up import amplified, follow_up, record
from .truth import noise

STEP, SD = 1e-3, 0.01
HELD = 250  # samples
LEVELS = np.array([10.0, 60.0, 30.0, 80.0])
STEPS = np.repeat(LEVELS, HELD)
# Of FOH only the proportional term: 0.07 um/V.
PLAIN = {
    "case": "case_0001", "holdout": None, "base": "foh", "effects": [], "noise": "white",
    "base_parameters": {"alpha": 0.1, "beta": -0.1, "k_l": 0.07, "k_h": 0.0, "k_p": 0.0},
    "noise_sd_um": 0.0, "spec": {"seed": 3},
}  # fmt: skip
LIMIT = {"key": "saturation", "parameters": {"u_max": 50.0, "width": 0.1}}


def test_record_is_the_base_on_the_recommended_drive() -> None:
    t, u, y = record(PLAIN, STEPS, STEP).T
    assert np.diff(t) == pytest.approx(np.full(len(STEPS) - 1, STEP))
    assert u[HELD // 2 :: HELD] == pytest.approx(LEVELS)
    assert u[HELD - 1] + u[HELD] == pytest.approx(LEVELS[0] + LEVELS[1])
    assert u.min() >= LEVELS.min() - 1e-9
    assert u.max() <= LEVELS.max() + 1e-9
    assert y == pytest.approx(0.07 * (u - u[0]), abs=1e-9)


def test_record_shows_the_effect_and_noise_of_its_own() -> None:
    label = PLAIN | {"effects": [LIMIT], "noise_sd_um": SD}
    _, u, y = record(label, STEPS, STEP).T
    left = y - 0.07 * (np.minimum(u, 50.0) - u[0])
    held = np.abs(u - 50) > 1
    assert np.std(left[held]) == pytest.approx(SD, rel=0.1)
    first = noise("white", len(y), SD, np.random.default_rng([3, 11]))
    assert abs(np.corrcoef(left[held], first[held])[0, 1]) < 0.2


def test_samples_determine_the_drive() -> None:
    """Between them a spline keeps within 1 % of the steps, which would miss a list's by 10 %."""
    drive = amplified(STEPS, STEP)
    t = np.linspace(0, STEP * (len(STEPS) - 1), 8 * len(STEPS))
    missed = CubicSpline(drive.times, drive(drive.times))(t) - drive(t)
    assert np.max(np.abs(missed)) < 0.01 * 50


def written(file: Path) -> None:
    file.write_text("{}")


def test_answer_is_followed_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The record is made once, and both recordings are asked about; a failure is a line."""
    (tmp_path / "case_0001").mkdir()
    drive = np.column_stack([STEP * np.arange(len(STEPS)), STEPS])
    np.savetxt(tmp_path / "case_0001" / NEXT, drive, delimiter=",")
    asked = []

    def ask(label: dict, exam: Path, *new: Path) -> SimpleNamespace:
        asked.append(new)
        if len(asked) == 1:
            raise ValueError("no fit")
        return SimpleNamespace(verdict="missing", effects=(), next_experiment=None, save=written)

    monkeypatch.setattr(module, "ask", ask)
    tell = [follow_up(PLAIN, tmp_path, tmp_path) for _ in range(3)]
    after = tmp_path / "case_0001" / "after"
    assert asked == [(after / "recording.csv",)] * 2
    assert tell[0] == "case_0001/after: failed, ValueError: no fit"
    assert tell[1].startswith("case_0001/after: missing")
    assert tell[2] == "case_0001/after: there already"
    assert json.loads((after / "diagnosis.json").read_text()) == {}
    columns = np.loadtxt(after / "recording.csv", delimiter=",", skiprows=1)
    assert columns == pytest.approx(record(PLAIN, STEPS, STEP), abs=1e-6)
