"""The cubic nonlinearity: harmonics, and no fold."""

import numpy as np
import pytest

from fracjax._blocks import CubicNonlinearity
from fracjax._parameters import set_values
from tests.blocks.linear import GRID
from tests.helpers import respond


def harmonics(response) -> np.ndarray:
    """Real amplitudes of the cosines in one period."""
    return 2 * np.real(np.fft.rfft(response)) / response.size


def test_cubic_nonlinearity_makes_the_harmonics_of_a_cube():
    """cos³ = (3 cos + cos 3)/4, and about another point the square of electrostriction."""
    cosine = np.cos(2 * np.pi * np.arange(64) / 64)
    block = CubicNonlinearity(0.4, low=20.0, high=100.0)
    for amplitude in (10.0, 40.0):
        found = harmonics(respond(block, 60 + amplitude * cosine, GRID))
        size = 0.4 * amplitude**3 / 80**2
        np.testing.assert_allclose(found[1:5], [amplitude + 0.75 * size, 0, size / 4, 0], atol=1e-9)
    moved = set_values(block, {"centre": 48.0})
    found = harmonics(respond(moved, 60 + 40 * cosine, GRID))
    assert found[2] == pytest.approx(0.5 * 3 * 0.4 * 12 * 40**2 / 80**2, rel=1e-9)
    assert respond(block, np.array([100.0]), GRID)[0] == pytest.approx(
        100 + 0.4 * 80 / 8, rel=1e-14
    )


def test_cubic_nonlinearity_rises_within_its_bounds():
    drive = np.linspace(20, 100, 200)
    for q in (-1.0, 1.0):
        assert np.all(np.diff(respond(CubicNonlinearity(q, low=20.0, high=100.0), drive, GRID)) > 0)
