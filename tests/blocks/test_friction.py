"""Dahl's and LuGre's friction beside their differential equations."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fracjax._operators import Grid
from fracjax._parameters import set_values
from tests.blocks.motion import GRID, STEP, TIMES, friction, lubricated, motion, rate_of_motion
from tests.helpers import respond


def test_friction_is_dahls_differential_equation():
    def slope(t, z):
        speed = rate_of_motion(t)
        return speed * (1 - z * np.sign(speed)) / 0.7

    solution = solve_ivp(
        slope, (0, 1.2), [0.0], t_eval=TIMES, rtol=1e-10, atol=1e-12, max_step=STEP
    )
    wanted = motion(TIMES) - 0.4 * solution.y[0]
    np.testing.assert_allclose(respond(friction, motion(TIMES), GRID), wanted, rtol=0, atol=2e-5)


def test_friction_is_exact_where_the_motion_turns_at_samples():
    """Closed form from turning point to turning point, and a plain loop in between."""
    turns, z = [0.0, 5.0, -1.0, -0.5, 3.0], 0.0
    path = np.concatenate([np.linspace(a, b, 8)[:-1] for a, b in pairwise(turns)])
    ends = []
    for a, b in pairwise(turns):
        sign = np.sign(b - a)
        z = sign + (z - sign) * np.exp(-abs(b - a) / 0.7)
        ends.append(b - 0.4 * z)
    found = respond(friction, np.append(path, turns[-1]), GRID)
    np.testing.assert_allclose(found[7::7], ends, rtol=0, atol=1e-14)


def test_friction_widens_a_large_loop_by_twice_its_deflection():
    angle = np.linspace(0, 6 * np.pi, 1201)
    loop = respond(friction, 20 * np.sin(angle), GRID) - 20 * np.sin(angle)
    rising, falling = loop[800], loop[1000]  # both through the middle
    assert falling - rising == pytest.approx(0.8, abs=1e-9)


def test_friction_after_a_reversal_has_turned_round_after_its_presliding_length():
    """From 1 to -1: at the presliding length z = 2/e - 1."""
    found = respond(friction, np.array([0.0, 50.0, 50.0 - 0.7]), GRID)
    assert found[2] == pytest.approx(50 - 0.7 - 0.4 * (2 / np.e - 1), abs=1e-12)


def test_lugres_friction_is_its_differential_equation():
    """The motion that it sees is the one that it holds back: dx = dy - a dz."""

    def slope(t, z):
        speed = rate_of_motion(t)
        left = 1 - z * np.sign(speed) / (1 + 0.5 * np.exp(-((speed / 20.0) ** 2)))
        return speed * left / (0.7 + 0.4 * left)

    solution = solve_ivp(
        slope, (0, 1.2), [0.0], t_eval=TIMES, rtol=1e-10, atol=1e-12, max_step=STEP
    )
    wanted = motion(TIMES) - 0.4 * solution.y[0]
    errors = []
    for finer in (1, 4, 16):
        fine = np.arange(600 * finer + 1) * STEP / finer
        found = respond(lubricated, motion(fine), Grid(STEP / finer, "constant"))[::finer]
        errors.append(np.abs(found - wanted).max())
    assert errors[0] < 5e-5
    assert errors[1] < 0.4 * errors[0]
    assert errors[2] < 0.4 * errors[1]


def test_lugres_friction_of_stiff_guides_is_dahls_and_of_sticking_ones_a_play():
    plain = {"excess": 0.0, "presliding": 0.7}
    stiff = set_values(lubricated, plain | {"amplitude": 1e-5})
    dahl = set_values(friction, {"amplitude": 1e-5})
    held = motion(TIMES) - respond(dahl, motion(TIMES), GRID)
    np.testing.assert_allclose(
        motion(TIMES) - respond(stiff, motion(TIMES), GRID), held, rtol=0, atol=1e-9
    )
    sticking = set_values(lubricated, {"excess": 0.0, "presliding": 1.6e-3, "amplitude": 0.4})
    play, wanted = 0.0, []
    for y in motion(TIMES):
        play = np.clip(play, y - 0.4, y + 0.4)
        wanted.append(play)
    np.testing.assert_allclose(respond(sticking, motion(TIMES), GRID), wanted, rtol=0, atol=0.02)


def test_lugres_friction_is_larger_in_slow_motion():
    """Pulled steadily it holds back by a g, and a once the pull is fast."""
    for speed, force in ((0.02, 1.5), (200.0, 1.0)):
        pulled = speed * TIMES * 1e3
        found = pulled - respond(lubricated, pulled, Grid(STEP * 1e3, "constant"))
        assert found[-1] == pytest.approx(0.4 * force, rel=1e-3)
