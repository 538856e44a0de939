"""Gain that follows dissipated power, beside its thermal equation."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fracjax._blocks import GainDrift
from fracjax._operators import Grid
from tests.blocks.motion import GRID, STEP, TIMES, errors_of, motion, rate_of_motion
from tests.helpers import respond


@pytest.mark.parametrize("losses", [1.0, 1.6, 2.0])
def test_gain_drift_is_its_thermal_equation_to_second_order(losses):
    block = GainDrift(0.2, 2.5, 0.4, losses, speed=14.0, size=3.0)

    def power(t):
        moved = np.abs(motion(t) - motion(0.0)) / 3
        return np.abs(rate_of_motion(t) / 14) ** losses * moved ** (2 - losses)

    def exact(t):
        solution = solve_ivp(
            lambda t, warming: (power(t) - warming) / 0.4,
            (0, 1.2), [0.0], t_eval=t, rtol=1e-10, atol=1e-12, max_step=0.01,
        )  # fmt: skip
        return motion(t) + (0.2 * motion(t) + 0.5) * solution.y[0]

    # The motion counts from its first value, wherever that lies.
    errors = errors_of(lambda t: respond(block, motion(t) + 5, Grid(t[1], "constant")) - 5, exact)
    assert errors[2] < 3e-4
    assert errors[1] < errors[0] / 3.5
    assert errors[2] < errors[1] / 3.5


def test_a_ramp_warms_exactly_as_an_exponential():
    found = respond(GainDrift(1.0, 0.0, 0.4, speed=3.0, size=1.0), 3 * TIMES, GRID) - 3 * TIMES
    # No power has come before the first sample.
    np.testing.assert_allclose(found, -3 * TIMES * np.expm1(-TIMES / 0.4), rtol=0, atol=1e-12)


def test_a_gain_changes_by_its_share_in_the_long_run():
    """At its own mean power the warming goes to 1, and starts there if periodic."""
    angle = 2 * np.pi * np.arange(100) / 100
    power = float(np.mean(np.diff(np.sin(angle), append=0.0) ** 2)) / STEP**2
    block = GainDrift(0.1, 0.0, 20.0, speed=np.sqrt(power), size=1.0)
    steady = respond(block, np.sin(angle), Grid(STEP, "periodic"))
    np.testing.assert_allclose(steady, 1.1 * np.sin(angle), rtol=0, atol=1e-3)


def test_a_gain_that_follows_its_power_within_a_cycle_is_no_drift():
    """Of a sine the motion turns in 1/ω."""
    frequency = 2 * np.pi * 3.0
    fast, slow = (
        GainDrift(0.1, 0.0, tau, speed=frequency, size=1.0).time_constant for tau in (0.04, 0.06)
    )
    assert 0.04 < 1 / frequency < 0.06
    assert not fast.is_plausible
    assert slow.is_plausible


def test_a_gain_that_begins_at_rest_forgets_its_first_response():
    """Of a drive that begins with a jump a fractional law's first response depends on the step."""
    block = GainDrift(0.1, 1.0, 0.01, speed=1.0, size=1.0)
    drive = np.sin(9 * TIMES)
    jumped = np.concatenate([[100.0], drive[1:]])
    late = TIMES > 0.5
    found, other = (respond(block, d, Grid(STEP, "rest"))[late] for d in (drive, jumped))
    np.testing.assert_allclose(other, found, rtol=0, atol=1e-12)
