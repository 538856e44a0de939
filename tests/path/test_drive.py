"""A measured drive without most of its noise."""

import numpy as np
import pytest

from fracjax._path import denoised

TIMES = np.arange(4000) / 4000
SINE = 50 + 40 * np.sin(2 * np.pi * 4 * TIMES)
TRIANGLE = 50 + 40 * np.interp((4 * TIMES) % 1, [0, 0.25, 0.75, 1], [0.0, 1.0, -1.0, 0.0])


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("drive", [SINE, TRIANGLE])
@pytest.mark.parametrize("level", [0.02, 0.1])
def test_most_noise_goes_and_what_is_left_is_known(drive, level):
    noise = level * np.random.default_rng(1).standard_normal(drive.size)
    smooth, error = denoised(drive + noise)
    assert rms(smooth - drive) < 0.45 * level
    assert rms(error) == pytest.approx(rms(smooth - drive), rel=0.3)


def test_corners_are_kept():
    level = 0.05
    noise = level * np.random.default_rng(2).standard_normal(TRIANGLE.size)
    smooth, error = denoised(TRIANGLE + noise)
    corners = np.flatnonzero(np.abs(np.diff(TRIANGLE, 2)) > 1e-3) + 1
    assert corners.size == 8
    assert np.abs(smooth - TRIANGLE)[corners].max() < 4 * level
    assert error[corners].min() > rms(error)


@pytest.mark.parametrize("drive", [SINE, TRIANGLE, np.round(TIMES)])
def test_a_computed_drive_stays_as_it_is(drive):
    smooth, error = denoised(drive)
    assert smooth is drive
    assert not error.any()
