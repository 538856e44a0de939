"""A skewed clock reads the drive at other times."""

import numpy as np
import pytest

from fracjax._blocks import ClockSkew
from fracjax._operators import Grid
from tests.blocks.motion import GRID, STEP, TIMES, motion
from tests.helpers import respond


@pytest.mark.parametrize("skew", [-8e-4, 8e-4])
def test_a_skewed_clock_reads_the_drive_at_other_times(skew):
    found = respond(ClockSkew(skew), motion(TIMES), GRID)
    np.testing.assert_allclose(found[:-3], motion(TIMES * (1 + skew))[:-3], rtol=0, atol=2e-5)


def test_a_skewed_clock_in_a_periodic_record_reads_on_into_the_next_period():
    times = np.arange(500) * STEP  # motion has the period 1 s
    found = respond(ClockSkew(9e-4), motion(times), Grid(STEP, "periodic"))
    np.testing.assert_allclose(found, motion(times * (1 + 9e-4)), rtol=0, atol=2e-5)
