"""Loop shapes: plays, and that they span rate-independent hysteresis and no more."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fracjax._diagnose._nuisance import loop_shapes, plays

TIMES = np.linspace(0, 6, 1500)
NESTED = 0.5 + 0.5 * np.sin(2 * np.pi * TIMES) * np.cos(0.7 * TIMES)


def one_play(drive: np.ndarray, radius: float, state: float) -> np.ndarray:
    """A play, sample by sample."""
    states = []
    for level in drive:
        state = min(max(state, level - radius), level + radius)
        states.append(state)
    return np.array(states)


@pytest.mark.parametrize("begins", [0.0, 0.4, 2.0])
def test_plays_over_whole_stretches_are_those_of_each_sample(begins):
    drive = np.concatenate([NESTED, np.full(20, NESTED[-1]), NESTED[::-1]])
    radii = np.array([0.01, 0.1, 0.4])
    states = plays(drive, radii, np.full(3, begins))
    wanted = np.stack([one_play(drive, r, begins) for r in radii], axis=1)
    np.testing.assert_allclose(states, wanted, atol=1e-15)


def test_a_second_pass_begins_where_the_first_has_ended():
    radii = np.array([0.05, 0.3])
    again = plays(NESTED, radii, np.zeros(2), again=True)
    first = plays(NESTED, radii, np.zeros(2))
    np.testing.assert_allclose(again, plays(NESTED, radii, first[-1]))


def shapes_of(drive: np.ndarray, history: str = "constant") -> np.ndarray:
    setting = SimpleNamespace(drive_low=drive.min(), drive_span=np.ptp(drive), response_span=1.0)
    take = SimpleNamespace(recording=SimpleNamespace(drive=drive), history=history)
    problem = SimpleNamespace(response=np.zeros(drive.size))
    prepared: Any = SimpleNamespace(setting=setting, takes=[take], problems=lambda: [problem])
    return loop_shapes(prepared)


def share_outside(shapes: np.ndarray, signal: np.ndarray, noise: float = 1e-4) -> float:
    """The rms of a signal minus shapes of unit prior sd, over its own."""
    design = np.column_stack([np.ones(len(shapes)), shapes])
    gram = design.T @ design + noise**2 * np.eye(design.shape[1])
    error = signal - design @ np.linalg.solve(gram, design.T @ signal)
    return float(error.std() / signal.std())


def test_a_preisach_plane_lies_in_their_span():
    drive = 100 * (NESTED - NESTED.min()) / np.ptp(NESTED)
    scaled, response = drive / 100, np.zeros(drive.size)
    for radius in (np.arange(40) + 0.5) / 80:
        state = one_play(scaled, radius, scaled[0])
        response += np.exp(-radius / 0.15) * np.tanh((state - 0.4) / 0.25)
    assert share_outside(shapes_of(drive), response) < 2e-3


def test_a_memory_that_fades_along_the_drive_lies_in_their_span():
    """Duhem's model, dx = a |du| (b u - x) + c du, which has no memory of its turning points."""
    angle = 2 * np.pi * TIMES
    drive = 0.5 + 0.3 * np.sin(angle) + 0.2 * np.sin(3.3 * angle)
    drive = (drive - drive.min()) / np.ptp(drive)
    response = np.zeros(drive.size)
    for k in range(1, drive.size):
        step, x = drive[k] - drive[k - 1], response[k - 1]
        response[k] = x + 4.0 * abs(step) * (0.9 * drive[k - 1] - x) + 0.3 * step
    assert share_outside(shapes_of(drive), response) < 2e-3


@pytest.mark.parametrize(("tau", "outside"), [(0.02, 0.05), (0.5, 0.003)])
def test_a_lag_in_time_is_outside_it(tau, outside):
    """Where the drive has more than one rate; a slow one less than a fast one."""
    fast = 0.5 + 0.3 * np.sin(2 * np.pi * TIMES) + 0.2 * np.sin(14.6 * np.pi * TIMES)
    lagged, keep = np.zeros(fast.size), np.exp(-(TIMES[1] - TIMES[0]) / tau)
    for k in range(1, fast.size):
        lagged[k] = keep * lagged[k - 1] + (1 - keep) * fast[k]
    assert share_outside(shapes_of(fast), lagged - fast) > outside


def test_a_line_that_does_not_follow_the_drive_is_outside_it():
    assert share_outside(shapes_of(NESTED), np.sin(100 * np.pi * TIMES)) > 0.9
