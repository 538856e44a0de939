"""Noise models beside closed forms and SciPy."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, stats
from scipy.linalg import solve_triangular, toeplitz

import fracjax as fj
from fracjax._posterior import ar_noise_of, laplace, target_of
from fracjax._posterior._noise_models import autoregressive, partial_autocorrelations
from fracjax._posterior._posterior import _starts
from tests.posterior.helpers import DRIVE, SAMPLES, Cubic, fit_of, recording_of


def log_integral(log_density, centre: float, width: float) -> float:
    """ln ∫ exp(log_density(c)) dc by quadrature about its top."""
    top = log_density(centre)
    ends = centre - 40 * width, centre + 40 * width
    area, _ = integrate.quad(
        lambda c: np.exp(log_density(c) - top), *ends, points=[centre], epsabs=0, limit=500
    )
    return top + np.log(area)


def ar_covariance(coefficients: np.ndarray, sigma: float, size: int) -> np.ndarray:
    """Of a stationary process, from its impulse response."""
    response = np.zeros(size + 4000)
    response[0] = 1.0
    for t in range(1, response.size):
        past = response[max(0, t - coefficients.size) : t][::-1]
        response[t] = coefficients[: past.size] @ past
    lags = [response[: response.size - k] @ response[k:] for k in range(size)]
    return sigma**2 * toeplitz(lags)


@pytest.mark.parametrize("order", [0, 2])
def test_normal_noise_is_the_multivariate_normal_with_its_offset_integrated(cubic, order: int):
    """By quadrature over the offset, of the density given the first `order` samples."""
    noise = fj.ARNoise(order) if order else fj.WhiteNoise()
    target, _ = target_of(cubic, noise, {})
    values = np.array([0.1, 1e-6, *([0.5, -0.3] if order else []), 0.06])
    coefficients = np.asarray(autoregressive(jnp.asarray(values[2:-1])))
    residual = cubic.preparation.takes[0].recording.response - 0.1 * DRIVE - 1e-6 * DRIVE**3
    covariance = ar_covariance(coefficients, values[-1], SAMPLES)
    factor = np.linalg.cholesky(covariance)

    def given_first(offset: float) -> float:
        white = solve_triangular(factor, residual - offset, lower=True)[order:]
        return stats.norm.logpdf(white).sum() - np.log(np.diag(factor)[order:]).sum()

    wanted = log_integral(given_first, residual.mean(), 0.01)
    assert float(target.log_likelihood(jnp.asarray(values))) == pytest.approx(wanted, abs=1e-6)


def test_measured_noise_is_the_measured_filter_times_a_scale(cubic):
    """AR(1) measured before, φ = 0.6 at twice its level, is AR(1) sampled at that value."""
    filter_ = np.array([1.0, -0.6])
    coloured = replace(
        cubic,
        preparation=cubic.preparation.with_noises([fj.Noise(0.05, "um", "repeats", filter_, 0.04)]),
    )
    measured, _ = target_of(coloured, fj.MeasuredNoise(), {})
    sampled, _ = target_of(coloured, fj.ARNoise(1), {})
    one = measured.log_likelihood(jnp.array([0.1, 1e-6, 2.0]))
    other = sampled.log_likelihood(jnp.array([0.1, 1e-6, 0.6, 0.08]))
    assert float(one) == pytest.approx(float(other), abs=1e-8)


def test_student_noise_is_that_of_scipy(cubic):
    target, terms = target_of(cubic, fj.StudentNoise(), {})
    assert [t.name for t in terms[2:]] == ["noise.scale", "noise.degrees_of_freedom", "offset"]
    assert terms[-1].start == pytest.approx(2.0, abs=0.1)
    residual = cubic.preparation.takes[0].recording.response - 0.1 * DRIVE - 1.9
    wanted = stats.t.logpdf(residual, 4.0, scale=0.05 * 1.5).sum()
    found = target.log_likelihood(jnp.array([0.1, 0.0, 1.5, 4.0, 1.9]))
    assert float(found) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.slow
def test_outliers_move_a_student_posterior_less():
    recording = recording_of(Cubic(), 0.05)
    response = recording.response.copy()
    response[DRIVE > 60] += np.random.default_rng(2).choice([0.0, 3.0], (DRIVE > 60).sum())
    fit = fit_of(Cubic(), replace(recording, response=response), 0.05)
    apart = []
    for noise in (fj.WhiteNoise(), fj.StudentNoise()):
        target, terms = target_of(fit, noise, {})
        found = laplace(target, _starts(terms))
        assert found.converged
        curve = np.asarray(target.values(jnp.asarray(found.mode)))[:2] @ [DRIVE, DRIVE**3]
        apart.append(np.std(curve - 0.1 * DRIVE))
    assert apart[1] < 0.3 * apart[0]


@given(st.lists(st.floats(-0.95, 0.95), min_size=1, max_size=6))
def test_partial_autocorrelations_are_all_stationary_processes(partials: list[float]):
    coefficients = np.asarray(autoregressive(jnp.array(partials)))
    roots = np.roots([1.0, *-coefficients])
    assert np.all(np.abs(roots) < 1)
    np.testing.assert_allclose(partial_autocorrelations(coefficients), partials, atol=1e-6)


def test_the_order_of_autoregressive_noise_is_found():
    """AR(1) with φ = 0.8."""
    white = np.random.default_rng(0).standard_normal(SAMPLES)
    noise = np.zeros(SAMPLES)
    for t in range(1, SAMPLES):
        noise[t] = 0.8 * noise[t - 1] + 0.05 * white[t]
    recording = recording_of(Cubic(), 0.0)
    fit = fit_of(Cubic(), replace(recording, response=recording.response + noise), 0.08)
    target, terms = target_of(fit, ar_noise_of(fit), {})
    mode = np.asarray(target.values(jnp.asarray(laplace(target, _starts(terms)).mode)))
    found = dict(zip([t.name for t in terms], mode, strict=True))
    assert found["noise.partial[1]"] == pytest.approx(0.8, abs=0.12)
    assert found["noise.sigma"] == pytest.approx(0.05, rel=0.15)
