"""Drives on finer grids: samples kept, stairs held, triangles straight, sines smooth."""

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator

from fracjax._operators import interpolate
from tests.operators.helpers import WALK, triangle


def sine(positions: np.ndarray) -> np.ndarray:
    return np.sin(2 * np.pi * positions / 33)


COARSE, FINE = np.arange(301.0), np.arange(300 * 4 + 1) / 4
STAIRS = np.repeat(np.random.default_rng(1).uniform(0, 10, 6), 50)
DRIVES = {"triangle": triangle(COARSE), "stairs": STAIRS, "sine": sine(COARSE), "walk": WALK}


@pytest.mark.parametrize("oversampling", [1, 2, 3, 7, 8])
@pytest.mark.parametrize("name", DRIVES)
def test_samples_are_kept_exactly(name, oversampling):
    drive = DRIVES[name]
    fine, _ = interpolate(drive, oversampling)
    assert fine.shape == ((drive.size - 1) * oversampling + 1,)
    np.testing.assert_allclose(fine[::oversampling], drive, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("oversampling", [2, 3, 5, 8])
def test_a_staircase_is_held(oversampling):
    fine, method = interpolate(STAIRS, oversampling)
    assert method == "hold"
    np.testing.assert_array_equal(fine, np.repeat(STAIRS, oversampling)[: fine.size])


@pytest.mark.parametrize(("first_corner", "length"), [(0, 24), (1, 24), (0, 25)])
def test_a_triangle_is_straight(first_corner, length):
    """Also one that turns at even samples and at odd ones, of which each half of them misses
    corners."""
    fine, method = interpolate(triangle(COARSE, first_corner, length), 4)
    assert method == "linear"
    np.testing.assert_allclose(fine, triangle(FINE, first_corner, length), rtol=0, atol=1e-12)


def test_a_sine_is_smooth():
    fine, method = interpolate(sine(COARSE), 4)
    assert method == "cubic"
    np.testing.assert_allclose(fine, sine(FINE), rtol=0, atol=1e-4)


def test_a_clipped_sine_is_interpolated_as_by_scipy_s_akima():
    """As MATLAB modified it, from the first sample to the last."""
    clipped = np.clip(30 * sine(COARSE), -20, 20)
    fine, method = interpolate(clipped, 4)
    assert method == "akima"
    wanted = Akima1DInterpolator(COARSE, clipped, method="makima")(FINE)
    np.testing.assert_allclose(fine, wanted, rtol=0, atol=1e-12)
