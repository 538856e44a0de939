"""Rayleigh's law: parabolas between turning points."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fracjax._blocks import AmplitudeDependence, Backlash, CubicNonlinearity, SensorNonlinearity
from fracjax._operators import Grid
from tests.blocks.linear import GRID, STARTS, smooth
from tests.helpers import respond

ALPHA, SPAN = 0.3, 80.0
rayleigh = AmplitudeDependence(ALPHA, span=SPAN)
GRAIN = 2.5e-4 * ALPHA * SPAN  # of the sum over radii, for each turning point kept


def parabolas(path, start: float) -> float:
    """Rayleigh's response at the end of a path of turning points: a chain of parabolas.

    A chain holds the farthest point from the virgin state and the ever smaller swings after it.
    """
    chain: list[float] = []
    for level in path:
        while True:
            if len(chain) >= 2 and (level - chain[-1]) * (chain[-1] - chain[-2]) >= 0:
                chain.pop()
            elif len(chain) >= 2 and abs(level - chain[-1]) >= abs(chain[-1] - chain[-2]):
                del chain[-2:]
            elif len(chain) == 1 and abs(level - start) >= abs(chain[0] - start):
                chain.pop()
            else:
                break
        if not chain or level != chain[-1]:
            chain.append(level)
    virgin = 2 * (chain[0] - start) * abs(chain[0] - start)
    branches = sum((b - a) * abs(b - a) for a, b in pairwise(chain))
    return ALPHA / SPAN * (virgin + branches)


levels = st.floats(0, SPAN, width=32)


@given(levels, st.lists(levels, min_size=1, max_size=15))
def test_rayleigh_remembers_turning_points_as_a_chain_of_parabolas(start, path):
    drive = np.array([start, *path] + [path[-1]] * (15 - len(path)))
    found = respond(rayleigh, drive, GRID) - drive - 4 * ALPHA * start
    for count, response in enumerate(found[1 : len(path) + 1], start=1):
        assert abs(response - parabolas(path[:count], start)) <= count * GRAIN


def test_rayleigh_starts_on_the_virgin_parabola():
    drive = np.linspace(0, SPAN, 300)
    for history in STARTS:
        found = respond(rayleigh, drive, Grid(1e-3, history)) - drive
        np.testing.assert_allclose(found, 2 * ALPHA * drive**2 / SPAN, atol=GRAIN)


@pytest.mark.parametrize(("exercised", "share"), [(0.0, 1.0), (0.5, 2 / 3), (1.0, 0.5)])
def test_rayleigh_of_an_exercised_actuator_starts_on_a_later_branch(exercised, share):
    """Come down from beyond its range it rises as from any turning point, by half the virgin
    parabola; and where it comes back to, it does as before."""
    rise = np.linspace(0, SPAN, 300)
    drive = np.concatenate([rise, rise[::-1], rise])
    block = AmplitudeDependence(ALPHA, exercised, span=SPAN)
    found = respond(block, drive, GRID) - drive
    first = found[:300] - found[0]
    np.testing.assert_allclose(first, 2 * share * ALPHA * rise**2 / SPAN, atol=2 * GRAIN)
    again = found[600:] - found[600]
    np.testing.assert_allclose(again, ALPHA * rise**2 / SPAN, atol=2 * GRAIN)


@pytest.mark.parametrize("width", [10.0, 20.0, 40.0, 80.0])
def test_rayleigh_loops_are_parabolas_with_area_as_the_cube(width):
    rise = np.linspace(0, width, 400, endpoint=False)
    low = 40 - width / 2
    drive = low + np.concatenate([rise, width - rise])
    found = respond(rayleigh, drive, Grid(1e-3, "periodic")) - drive
    up, down = found[:400], found[400:]
    np.testing.assert_allclose(up - up[0], ALPHA * rise**2 / SPAN, atol=2 * GRAIN)
    np.testing.assert_allclose(down - down[0], -ALPHA * rise**2 / SPAN, atol=2 * GRAIN)
    assert (down[0] - up[0]) / width == pytest.approx(ALPHA * width / SPAN, abs=2 * GRAIN / width)
    opening = down[200] - up[200]
    assert opening == pytest.approx(ALPHA * width**2 / (2 * SPAN), abs=2 * GRAIN)
    area = np.sum(down[::-1][:-1] - up[1:]) * width / 400
    assert area == pytest.approx(ALPHA * width**3 / (3 * SPAN), abs=2 * GRAIN * width)


def test_laws_of_plays_and_powers_do_not_see_the_clock():
    drive = smooth(np.arange(300) * 5e-3)
    for block in (
        rayleigh,
        Backlash(0.5, 0.3, span=8.0),
        CubicNonlinearity(0.2, low=3.0, high=8.0),
        SensorNonlinearity(0.02, 0.01, centre=5.0, span=8.0),
    ):
        np.testing.assert_array_equal(
            respond(block, drive, Grid(1.0, "constant")),
            respond(block, drive, Grid(1e-5, "constant")),
        )
