"""The interval of a prediction, beside the textbook's of a straight line."""

import numpy as np
import pytest

import fracjax as fj
from fracjax._fit import interval_errors, interval_errors_beyond

SIGMA = 0.05


def recording(drive: np.ndarray, seed: int) -> fj.Recording:
    noise = np.random.default_rng(seed).normal(0, SIGMA, drive.size)
    return fj.Recording(drive, 0.2 * drive + 1 + noise, 0.01, "V", "um")


def test_a_gain_has_the_interval_of_a_straight_line():
    drive = np.random.default_rng(0).uniform(0, 100, 60)
    fit = fj.fit("gain", recording(drive, 1), noise=f"{SIGMA} um")
    centred = drive - drive.mean()
    # Draper & Smith, Applied Regression Analysis (1998), eq. 3.1.6.
    variance = 1 + 1 / drive.size + centred**2 / (centred @ centred)
    scale = fit.noise.sigma / SIGMA
    (errors,) = interval_errors(fit, 3)
    assert errors == pytest.approx(scale * SIGMA * np.sqrt(variance), rel=0.02)


def test_beyond_the_fit_the_zero_is_that_of_the_first_samples():
    drive = np.random.default_rng(0).uniform(0, 100, 400)
    fit = fj.fit("gain", recording(drive, 1), noise=f"{SIGMA} um")
    other = recording(np.linspace(0, 300, 400), 2)
    errors = interval_errors_beyond(fit, other)
    slope = fit.parameters["k"].standard_error
    lever = other.drive - other.drive[np.argmin(errors)]
    variance = errors.min() ** 2 + (slope * lever) ** 2
    assert errors**2 == pytest.approx(variance, rel=0.01)
    # Of new samples 95 % lie in it.
    off = np.abs(other.response - fit.predict(other))
    assert np.mean(off <= 1.96 * errors) == pytest.approx(0.95, abs=0.03)
