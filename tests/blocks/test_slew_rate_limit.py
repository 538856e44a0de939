"""The slew limit: the plain recursion and its closed form on a sine."""

import numpy as np
from scipy.optimize import brentq

from fracjax._blocks import SlewRateLimit
from fracjax._operators import Grid
from tests.blocks.motion import GRID, STEP, TIMES, errors_of, motion
from tests.helpers import respond


def test_a_slew_limit_is_the_plain_recursion():
    drive = np.random.default_rng(2).uniform(-10, 10, 300)
    voltage, wanted = drive[0], []
    for command in drive:
        voltage += np.clip(command - voltage, -1.5, 1.5)
        wanted.append(voltage)
    found = respond(SlewRateLimit(1.5 / STEP, top=1e4), drive, GRID)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)


def limited_sine(limit: float, times):
    """sin(2πt), followed from t = 0 until its rate falls to the limit's, by the closed form.

    From rest at 0 the voltage rises at the limit R until it meets the sine again, follows it to
    where the sine falls faster than R, and so on in half periods.
    """
    onset = np.arccos(limit / (2 * np.pi)) / (2 * np.pi)  # rate falls below R; mirrored beyond 1/4
    level = np.sin(2 * np.pi * onset)

    def follow(start, value, sign, stop):
        def gap(t):
            return value + sign * limit * (t - start) - np.sin(2 * np.pi * t)

        return brentq(gap, start + 1e-6, stop)

    first = follow(0.0, 0.0, 1, 0.5)
    wanted, t0 = np.sin(2 * np.pi * times), 0.0
    limited = times <= first
    wanted[limited] = limit * times[limited]
    for k in range(1, 3):  # the falling stretch about t = 1/2, the rising one about t = 1
        t0, sign = k / 2 - onset, (-1) ** k
        value = -sign * level
        meet = follow(t0, value, sign, k / 2 + 0.25)
        limited = (times > t0) & (times < meet)
        wanted[limited] = value + sign * limit * (times[limited] - t0)
    return wanted


def test_a_slew_limit_on_a_sine_is_its_closed_form_to_second_order():
    limit = 0.8 * 2 * np.pi
    block = SlewRateLimit(limit, top=10.0)

    def simulate(t):
        return respond(block, np.sin(2 * np.pi * t), Grid(t[1], "constant"))

    errors = errors_of(simulate, lambda t: limited_sine(limit, t), (150, 600, 2400))
    assert errors[0] < 2e-3
    assert errors[1] < errors[0] / 8
    assert errors[2] < errors[1] / 8


def test_a_slew_limit_never_reached_is_exactly_nothing():
    drive = motion(TIMES)
    np.testing.assert_array_equal(respond(SlewRateLimit(100.0, top=100.0), drive, GRID), drive)
