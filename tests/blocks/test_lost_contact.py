"""Lost contact and thrown loads: kinks, free fall, landing."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from fracjax._blocks import LostContact, ThrownLoad
from fracjax._operators import Grid
from tests.blocks.motion import GRID, TIMES, motion
from tests.helpers import respond


def test_a_thrown_load_falls_freely_until_it_lands_and_rides_on():
    """On 3 cos ωt it leaves on the way up, where the motion's acceleration is -300."""
    omega, step = 2 * np.pi * 2, 1e-4
    block = ThrownLoad(300.0, typical=500.0)
    leaves = 0.5 - np.arccos(300 / (3 * omega**2)) / omega

    def ridden(t):
        return 3 * np.cos(omega * t)

    def flown(t):
        speed = -3 * omega * np.sin(omega * leaves)
        return ridden(leaves) + speed * (t - leaves) - 150 * (t - leaves) ** 2

    # SciPy's types know not which of its two answers this is.
    lands: Any = brentq(lambda t: flown(t) - ridden(t), leaves + 0.2, leaves + 0.4)
    times = np.arange(0, 1.2, step)
    found = respond(block, ridden(times), Grid(step, "constant"))
    in_flight, riding = (
        (low + step < times) & (times < high - step)
        for low, high in ((leaves, lands), (lands, leaves + 0.5))
    )
    np.testing.assert_allclose(found[in_flight], flown(times[in_flight]), rtol=0, atol=3e-3)
    np.testing.assert_array_equal(found[riding], ridden(times[riding]))


def test_lost_contact_has_one_kink_wherever_the_zero_lies():
    block = LostContact(0.6, 1.5, low=0.0, span=8.0)
    for zero in (0.0, 37.0, -4.0):
        lifted = motion(TIMES) + zero
        wanted = zero + np.where(
            motion(TIMES) >= 1.5, motion(TIMES), 1.5 + 0.4 * (motion(TIMES) - 1.5)
        )
        np.testing.assert_allclose(respond(block, lifted, GRID), wanted, rtol=0, atol=1e-13)


def test_a_load_that_is_left_behind_stands_still():
    block = LostContact(1.0, 1.5, low=0.0, span=8.0)
    found = respond(block, motion(TIMES), GRID)
    assert found.min() == pytest.approx(1.5, abs=1e-13)
