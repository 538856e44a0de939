"""The colour of a misfit."""

import numpy as np
import pytest
from scipy.signal import lfilter

from fracjax._diagnose._colour import colour_of


def test_a_coloured_series_is_whitened_to_unit_variance():
    white = np.random.default_rng(0).standard_normal(20_000)
    coloured = 3 * np.asarray(lfilter([1.0], [1.0, -1.4, 0.6], white))
    taps = colour_of(coloured)
    whitened = np.asarray(lfilter(taps, [1.0], coloured))[20:]
    assert whitened.std() == pytest.approx(1.0, rel=0.02)
    assert abs(np.corrcoef(whitened[1:], whitened[:-1])[0, 1]) < 0.02
    np.testing.assert_allclose(3 * taps[:3], [1.0, -1.4, 0.6], atol=0.05)


def test_a_line_of_the_drive_is_part_of_it():
    times = np.arange(4000)
    taps = colour_of(np.sin(0.02 * times) + 0.01 * np.random.default_rng(1).standard_normal(4000))
    slow = np.sin(0.02 * times)
    assert np.asarray(lfilter(taps, [1.0], slow))[50:].std() < 0.3 * taps[0] * slow.std()


def test_white_noise_has_none():
    taps = colour_of(2 * np.random.default_rng(2).standard_normal(3000))
    assert taps.size == 1
    assert taps[0] == pytest.approx(0.5, rel=0.05)
