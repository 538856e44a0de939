"""Backlash: the plain loop, and one opening at all amplitudes."""

import numpy as np
import pytest

from fracjax._blocks import Backlash
from fracjax._operators import Grid
from fracjax._parameters import set_values
from tests.blocks.linear import GRID, STARTS
from tests.helpers import respond


@pytest.mark.parametrize("start", STARTS)
def test_backlash_is_a_plain_loop(start):
    motion = np.random.default_rng(8).uniform(-3, 3, 400).cumsum()
    weight, radius = 0.7, 1.3
    joint, wanted = (0.0 if start == "rest" else motion[0]), []
    for y in motion:
        if y - joint > radius:
            joint = y - radius
        elif joint - y > radius:
            joint = y + radius
        wanted.append((1 - weight) * y + weight * joint)
    found = respond(Backlash(weight, radius, span=100.0), motion, Grid(1e-3, start))
    np.testing.assert_allclose(found, wanted, atol=1e-12)


@pytest.mark.parametrize("width", [3.0, 8.0, 20.0])
def test_backlash_has_one_opening_at_all_amplitudes(width):
    rise = np.linspace(0, width, 600, endpoint=False)
    block = Backlash(0.6, 1.0, span=20.0)
    found = respond(block, np.concatenate([rise, width - rise]), Grid(1e-3, "periodic"))
    up, down = found[:600], np.concatenate([found[600:], found[:1]])[::-1][:600]
    crossing = rise <= 2.0
    np.testing.assert_allclose((up - up[0])[crossing], 0.4 * rise[crossing], atol=1e-12)
    beyond = (rise >= 2.0) & (rise <= width - 2.0)
    np.testing.assert_allclose((down - up)[beyond], 2 * 0.6 * 1.0, atol=1e-12)


def test_backlash_passes_a_constant_on():
    motion = 5 * np.sin(np.arange(300) / 20)
    block = Backlash(0.6, 1.0, span=10.0)
    for history in ("constant", "periodic"):
        shifted = respond(block, motion + 7, Grid(1e-3, history))
        np.testing.assert_allclose(
            shifted, respond(block, motion, Grid(1e-3, history)) + 7, atol=1e-12
        )


def test_radius_moves_the_reading_by_the_weight_while_the_joint_is_closed():
    motion = 5 * np.sin(np.arange(300) / 20)
    block = Backlash(0.6, 1.0, span=10.0)
    ends = [respond(set_values(block, {"radius": 1.0 + e}), motion, GRID) for e in (1e-6, -1e-6)]
    slope = (ends[0] - ends[1]) / 2e-6
    behind = motion - respond(set_values(block, {"weight": 1.0}), motion, GRID)
    closed = np.abs(behind) > 1 - 1e-9
    assert 0.5 < closed.mean() < 1
    np.testing.assert_allclose(slope[closed], -0.6 * np.sign(behind[closed]), atol=1e-6)
