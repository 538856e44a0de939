"""The covariance of an autoregression, compared with closed forms."""

import numpy as np
import pytest
from scipy.signal import lfilter

from fracjax._prepare._autoregression import _covariance, autoregressions, removed_power


def test_the_covariance_of_white_noise_is_its_variance():
    np.testing.assert_allclose(_covariance((np.ones(1), 0.5), 5), [0.25, 0, 0, 0, 0])


@pytest.mark.parametrize("coefficient", [0.9, -0.4, 0.9999])
def test_the_covariance_of_one_coefficient_is_a_power(coefficient):
    found = _covariance((np.array([1.0, -coefficient]), 2.0), 50)
    exact = 4 / (1 - coefficient**2) * coefficient ** np.arange(50)
    np.testing.assert_allclose(found, exact, rtol=1e-10)


def test_the_covariance_of_an_oscillation_solves_its_recursion_at_every_lag():
    taps = np.real(np.poly([0.95 * np.exp(0.7j), 0.95 * np.exp(-0.7j), 0.5]))
    covariance = _covariance((taps, 1.5), 400)
    both = np.concatenate([covariance[:0:-1], covariance])
    sums = np.convolve(both, taps)[399:-3]  # at lags 0, 1, …
    assert sums[0] == pytest.approx(1.5**2)
    np.testing.assert_allclose(sums[1:], 0, atol=1e-9 * covariance[0])


def test_a_mean_that_was_removed_took_its_variance_with_it():
    size, coefficient = 64, 0.7
    constant = np.full((size, 1), size**-0.5)
    lags = np.arange(-size + 1, size)
    exact = np.sum((1 - np.abs(lags) / size) * coefficient ** np.abs(lags)) / (1 - coefficient**2)
    assert removed_power((np.array([1, -coefficient]), 1.0), constant) == pytest.approx(exact)


@pytest.mark.parametrize("samples", [2_000, 50_000])
def test_white_noise_has_no_colour_however_long_it_is(samples):
    """The order is chosen by BIC, which errs more rarely the more samples there are."""
    draws = np.random.default_rng(1).standard_normal((60, samples))
    coloured = [taps.size > 1 for taps, _ in autoregressions([[draw] for draw in draws])]
    assert np.mean(coloured) < 0.15


def test_a_colour_of_long_noise_is_its_own():
    draws = np.random.default_rng(2).standard_normal((20, 50_000))
    found = autoregressions([[np.asarray(lfilter([1.0], [1.0, -0.3], draw))] for draw in draws])
    first = [taps[1] for taps, _ in found]
    # Four standard errors, of which the smoothed periodogram has 1.44 times a mean's.
    np.testing.assert_allclose(first, -0.3, atol=4 * 1.44 * np.sqrt((1 - 0.3**2) / 50_000))
    assert np.mean([taps.size == 2 for taps, _ in found]) > 0.8
