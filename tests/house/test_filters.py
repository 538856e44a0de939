"""Filters and tests of a distribution against SciPy's, which take long to import."""

import numpy as np
import pytest
from scipy import signal, stats

from fracjax._filters import moving_sum, solve_recursion
from fracjax._fit._distribution import (
    excess_kurtosis,
    p_of_equal_spread,
    p_of_normality,
    skewness,
)
from fracjax._solve._interpolation import _spread

TAPS = np.array([1.0, -1.6, 0.8, 0.1])


@pytest.mark.parametrize("shape", [(500,), (500, 3), (2,)])
def test_filters_are_those_of_scipy(shape):
    x = np.random.default_rng(0).normal(size=shape)
    expected = signal.lfilter(TAPS, 1.0, x, axis=0)
    assert moving_sum(TAPS, x) == pytest.approx(np.asarray(expected), abs=1e-12)
    expected = signal.lfilter([1.0], TAPS, x, axis=0)
    assert solve_recursion(TAPS, x) == pytest.approx(np.asarray(expected), abs=1e-10)


@pytest.mark.parametrize("skewed", [0.0, 0.02, 0.5])
def test_tests_of_a_distribution_are_those_of_scipy(skewed):
    rng = np.random.default_rng(1)
    sample = rng.normal(size=3000)
    sample += skewed * sample**2
    assert skewness(sample) == pytest.approx(float(stats.skew(sample)))
    assert excess_kurtosis(sample) == pytest.approx(float(stats.kurtosis(sample)))
    expected = float(stats.normaltest(sample).pvalue)
    assert p_of_normality(sample) == pytest.approx(expected, rel=1e-9)
    parts = np.split(sample * np.linspace(1, 1 + skewed / 4, sample.size), [100, 900, 2000])
    expected = float(stats.levene(*parts, center="median").pvalue)
    assert p_of_equal_spread(parts) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("dimensions", range(1, 7))
def test_points_are_those_of_scipy(dimensions):
    expected = stats.qmc.Sobol(dimensions, scramble=False).random(256)
    np.testing.assert_array_equal(_spread(256, dimensions), expected)
