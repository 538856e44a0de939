"""The prior of path curves against dense matrices."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from fracjax._path import Whitening, log_likelihood, square_at
from fracjax._path._law import ROUGHNESSES, PathLaw, Settled
from tests.path.helpers import through

DRIVES = [through([0.0, 1.0, 0.2, 0.9, 0.3], [16] * 4), through([0.1, 0.8, 0.2], [15] * 2)]
RNG = np.random.default_rng(5)
SIZE = sum(d.size for d in DRIVES)
WEIGHTS = [np.where(np.arange(d.size) == 20, 0.0, 1.0) for d in DRIVES]
WHITENING = Whitening([np.array([1.0, -0.6]) / 0.02, np.array([1 / 0.03])], WEIGHTS)
RESPONSE = np.concatenate([d + 0.1 * d**2 for d in DRIVES]) + 0.02 * RNG.standard_normal(SIZE)
COLUMNS = RNG.standard_normal((SIZE, 3))
ROUGHNESS, FADING = 0.3, 0.03


@pytest.fixture(scope="module")
def settled() -> Settled:
    return Settled(PathLaw.of(DRIVES, WHITENING, 1.2), ROUGHNESS, FADING)


@pytest.fixture(scope="module")
def matrices(settled):
    """The prior covariance of the whitened curve, and the covariance of the response."""
    law = settled.law
    normal = law.bends.toarray() / ROUGHNESS**2 + np.eye(law.bends.shape[0]) / law.span**2
    within = np.linalg.inv(normal)
    dense = np.concatenate([law.fading * FADING * law.span, law.own], axis=1)
    basis = law.curves.basis.toarray()
    curve = basis @ within @ basis.T + dense @ dense.T
    white = WHITENING(np.eye(SIZE))
    return within, curve, np.eye(SIZE) + white @ curve @ white.T


def test_inner_products_and_determinant_are_those_of_the_covariance(settled, matrices):
    covariance = matrices[-1]
    columns, white = WHITENING(COLUMNS), WHITENING(RESPONSE)
    inner = settled.prior.inner(columns, white)
    solved = np.linalg.solve(covariance, np.column_stack([columns, white]))
    np.testing.assert_allclose(inner.columns, columns.T @ solved[:, :-1], rtol=1e-7)
    np.testing.assert_allclose(inner.along, columns.T @ solved[:, -1], rtol=1e-6, atol=1e-6)
    assert inner.square == pytest.approx(white @ solved[:, -1], rel=1e-7)
    assert inner.log_determinant == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-9)


def test_columns_in_the_covariance_are_those_of_a_larger_covariance(settled, matrices):
    columns, white = WHITENING(COLUMNS), WHITENING(RESPONSE)
    chosen, sizes = np.array([0, 2]), np.array([0.5, 2.0])
    given = settled.prior.inner(columns, white).given(chosen, sizes)
    within = columns[:, chosen] * sizes
    covariance = matrices[-1] + within @ within.T
    solved = np.linalg.solve(covariance, white)
    assert given.square == pytest.approx(white @ solved, rel=1e-7)
    assert given.log_determinant == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-9)
    np.testing.assert_allclose(given.along, columns.T @ solved, rtol=1e-6, atol=1e-6)


def test_the_curve_is_the_mean_of_the_posterior(settled, matrices):
    within, curve, covariance = matrices
    white = WHITENING(np.eye(SIZE))
    solved = white.T @ np.linalg.solve(covariance, WHITENING(RESPONSE))
    own, before, slope, at = settled.curve(RESPONSE)
    np.testing.assert_allclose(own, curve @ solved, atol=1e-7)
    np.testing.assert_array_equal(before, own)
    curves = settled.law.curves
    exact = curves.slope.toarray() @ within @ (curves.basis.T @ solved)
    np.testing.assert_allclose(slope, exact, atol=1e-6 * np.abs(exact).max())
    np.testing.assert_allclose(at(np.concatenate(DRIVES)), own, atol=1e-7)


def test_the_fading_alone_changes_without_new_factors(settled):
    white = WHITENING(RESPONSE)
    other = settled.with_fading(0.3).prior.inner(np.zeros((SIZE, 0)), white)
    anew = Settled(settled.law, ROUGHNESS, 0.3).prior.inner(np.zeros((SIZE, 0)), white)
    assert other.square == pytest.approx(anew.square)
    assert other.log_determinant == pytest.approx(anew.log_determinant)


def test_the_likelihood_is_that_of_a_normal_distribution(matrices):
    covariance = matrices[-1]
    white = WHITENING(RESPONSE)
    square = white @ np.linalg.solve(covariance, white)
    determinant = np.linalg.slogdet(covariance)[1]
    exact = multivariate_normal(np.zeros(SIZE), covariance).logpdf(white)
    # With more samples than χ² the variance is that of the noise.
    count = 2 * square
    constant = 0.5 * SIZE * np.log(2 * np.pi)
    assert log_likelihood(square, determinant, count) - constant == pytest.approx(exact)
    # With fewer it is what makes them most likely.
    kappas = np.linspace(1.0, 8.0, 2001)
    likelihoods = -0.5 * (SIZE * np.log(kappas) + 3 * SIZE / kappas + determinant)
    assert log_likelihood(3 * SIZE, determinant, SIZE) == pytest.approx(likelihoods.max())


@pytest.mark.parametrize("square", [0.5 * SIZE, SIZE, 1.01 * SIZE, 1e4 * SIZE])
def test_the_square_at_a_likelihood_is_that_which_has_it(square):
    value = float(log_likelihood(square, 7.0, SIZE))
    assert square_at(value, 7.0, SIZE) == pytest.approx(square, rel=1e-9)


def test_the_smoothest_curve_that_reaches_the_noise_is_settled_on():
    drive = through([0.0, 1.0, 0.0], [400] * 2)
    law = PathLaw.of([drive], Whitening([np.array([50.0])], [np.ones(drive.size)]), 1.2)
    response = drive + 0.02 * RNG.standard_normal(drive.size)
    smooth, rough = law.settled(response), law.settled(response + 0.5 * np.sin(150 * drive))
    assert smooth.roughness == ROUGHNESSES[0] * law.noise < rough.roughness
