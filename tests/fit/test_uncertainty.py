"""Intervals where noise is coloured, and parameters at their bounds."""

import numpy as np
import pytest

import fracjax as fj
from fracjax._fit._uncertainty import (
    Evidence,
    _coloured,
    _estimates,
    uncertainties_of,
    uncertainty_of,
)
from fracjax._prepare._conditions import FreeParameter
from tests.fit.creep import CLEAN, DRIVE, SAMPLES, SIGMA, STEP, TRUE, fit, record
from tests.helpers import by_name


def coloured(seed: int, phi: float) -> np.ndarray:
    """AR(1) noise of unit variance."""
    white = np.random.default_rng(seed).standard_normal(SAMPLES)
    noise = np.empty(SAMPLES)
    noise[0] = white[0]
    for t in range(1, SAMPLES):
        noise[t] = phi * noise[t - 1] + np.sqrt(1 - phi**2) * white[t]
    return noise


@pytest.mark.slow
@pytest.mark.parametrize("phi", [0.0, 0.8])
def test_intervals_cover_the_truth_though_the_noise_was_called_white(phi):
    """60 fits: of two parameters each, whose errors are far from independent, at least 52 within.

    52 of 60 is the 1 % point of the binomial at 95 %.  In coloured noise errors by JᵀJ alone fail.
    """
    covered, alone, orders = {"k_c": 0, "mu": 0}, {"k_c": 0, "mu": 0}, []
    for seed in range(60):
        recording = fj.Recording(DRIVE, CLEAN + SIGMA * coloured(seed, phi), STEP, "V", "um")
        found = fit(recording)
        orders.append(found.residual_order)
        naive = uncertainty_of(
            (found.model.block,), found.preparation.problems(), found.preparation.conditions,
            units=("V", "um"), inflation=1.0,
        ).estimates  # fmt: skip
        for counts, estimates in ((covered, found.estimates), (alone, naive)):
            for estimate in estimates:
                low, high = estimate.interval
                counts[estimate.name] += low <= TRUE[estimate.name] <= high
    assert min(covered.values()) >= 52, covered
    assert max(alone.values()) < 48 if phi else min(alone.values()) >= 52, alone
    assert np.mean(orders) < 0.5 if phi == 0 else min(orders) >= 1


def test_colour_widens_or_narrows_as_theory_says():
    """Of a mean of AR(1) noise the variance is (1 + φ)/(1 - φ) times that of white noise."""
    phi = 0.6
    ones = np.ones((4000, 1)) / np.sqrt(4000)
    found = float(np.sum(_coloured(ones, np.array([1.0, -phi])) ** 2))
    assert found == pytest.approx((1 + phi) / (1 - phi), rel=1e-3)
    # And against the matrix itself, for columns of any kind.
    columns = np.random.default_rng(0).standard_normal((60, 3))
    lags = np.abs(np.subtract.outer(np.arange(60), np.arange(60)))
    matrix = columns.T @ phi**lags @ columns
    square = _coloured(columns, np.array([1.0, -phi]))
    np.testing.assert_allclose(square.T @ square, matrix, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("end", [0, 1])
def test_a_parameter_that_ends_on_either_bound_says_so(end):
    bounds = ((0.05, 0.06), (0.001, 0.002))[end]
    found = by_name(fit(record(CLEAN), bounds={"mu": bounds}))["mu"]
    assert found.value == pytest.approx(bounds[end], rel=1e-3)
    assert found.at_bound


def test_a_parameter_between_its_bounds_is_at_none():
    assert not by_name(fit(record(CLEAN), bounds={"mu": (0.001, 0.1)}))["mu"].at_bound


def test_a_gain_is_identified_to_a_twentieth_of_the_response():
    block = fj.parse_model("creep").block
    gain = FreeParameter("k_c", "k_c", 0, None)
    fits = [Evidence((block,), (), 1.0, np.zeros((0, 1)))] * 2
    shares = np.array([0.049, 0.051])
    found = _estimates(gain, True, fits, np.array([0.01, 0.01]), shares, ("V", "um"))
    assert [estimate.identified for estimate in found] == [True, False]


def test_fits_together_have_the_uncertainty_of_each_alone():
    found = fit(record(CLEAN))
    problems, conditions = found.preparation.problems(), found.preparation.conditions
    generator, size = np.random.default_rng(4), len(problems[0].response)
    residuals = [np.resize(coloured(seed, phi), size) for seed, phi in ((0, 0.0), (1, 0.8))]
    blocks, derivatives = (found.model.block,), generator.standard_normal((2, size, 4))
    fits = [Evidence(blocks, problems, 1.0 + k, derivatives[k], (residuals[k],)) for k in range(2)]
    together = uncertainties_of(fits, conditions, ("V", "um"))
    assert [uncertainty.order > 0 for uncertainty in together] == [False, True]
    for uncertainty, one in zip(together, fits, strict=True):
        (alone,) = uncertainties_of([one], conditions, ("V", "um"))
        np.testing.assert_allclose(uncertainty.curvature, alone.curvature, rtol=1e-10)
        np.testing.assert_allclose(uncertainty.correlation, alone.correlation, atol=1e-10)
        errors = [[e.standard_error for e in each.estimates] for each in (uncertainty, alone)]
        np.testing.assert_allclose(*errors, rtol=1e-10)
