"""A sensor's curvature, as data sheets give it."""

import numpy as np
import pytest
from scipy.optimize import linprog

from fracjax._blocks import SensorNonlinearity
from tests.blocks.linear import GRID
from tests.helpers import respond


def off_the_best_line(x, z) -> float:
    """Largest distance from the straight line that makes it least, by linear programming."""
    one = np.ones_like(x)
    above, below = np.column_stack([x, one, -one]), np.column_stack([-x, -one, -one])
    return linprog(
        [0, 0, 1], np.vstack([above, below]), np.concatenate([z, -z]), bounds=(None, None)
    ).fun


def test_sensor_nonlinearity_is_that_of_the_data_sheet():
    reach = np.linspace(-30, 50, 401)
    for s_2, s_3, share in ((0.02, 0.0, 0.01), (0.0, -0.04, 0.01)):
        block = SensorNonlinearity(s_2, s_3, centre=10.0, span=80.0)
        reading = respond(block, reach, GRID)
        np.testing.assert_allclose(
            reading[[0, 200, 400]],
            [-30 + 80 * (s_2 - s_3), 10.0, 50 + 80 * (s_2 + s_3)],
            atol=1e-12,
        )
        assert off_the_best_line(reach, reading) == pytest.approx(share * 80, rel=1e-3)


def test_another_centre_is_the_same_law_at_another_gain_and_offset():
    reach, move = np.linspace(-30, 50, 101), 0.3
    one = SensorNonlinearity(0.02, 0.03, centre=10.0, span=80.0)
    other = SensorNonlinearity(0.02 - 3 * 0.03 * move, 0.03, centre=10.0 - move * 40.0, span=80.0)
    difference = respond(one, reach, GRID) - respond(other, reach, GRID)
    assert np.ptp(difference) > 0.5
    np.testing.assert_allclose(np.diff(difference, 2), 0, atol=1e-10)


def test_sensor_nonlinearity_rises_within_its_bounds():
    reach = np.linspace(-30, 50, 200)
    for s_2 in (-0.1, 0.1):
        for s_3 in (-0.1, 0.1):
            block = SensorNonlinearity(s_2, s_3, centre=10.0, span=80.0)
            assert np.all(np.diff(respond(block, reach, GRID)) > 0)
