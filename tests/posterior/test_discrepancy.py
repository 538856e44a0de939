"""A model that is not right: discrepancies as Gaussian processes."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import fracjax as fj
from fracjax._posterior import Normal, Term, Uniform, target_of
from fracjax._posterior._discrepancy import discrepancy_of
from fracjax._posterior._marginal import figures, marginal_of
from fracjax._posterior._posterior import _starts
from tests.posterior.helpers import DRIVE, SAMPLES, Cubic, by_name, fit_of, recording_of


@pytest.fixture(scope="module")
def saturating() -> fj.Fit:
    """Truth: a = 0.1, b = 0, and a response that gives way above 50 V, which no cubic does."""
    recording = recording_of(Cubic(), 0.02)
    response = recording.response - 0.15 * np.clip(DRIVE - 50, 0, None)
    return fit_of(Cubic(), replace(recording, response=response), 0.02)


@pytest.mark.slow
def test_a_discrepancy_is_the_multivariate_normal_of_its_covariance(saturating):
    """Beside σ² of the noise, τ² Z Zᵀ and those of the gains; the offset's variance all but ∞."""
    found = discrepancy_of(saturating)
    target, terms = target_of(saturating, fj.WhiteNoise(), {}, found)
    marginal, _ = marginal_of(target, _starts(terms))
    assert [t.name for t in terms] == ["a", "b", "discrepancy.size", "noise.sigma"]
    standard = jnp.array([0.1, -0.2])
    tau, sigma = (float(v) for v in marginal.values(standard))
    gains = np.stack([DRIVE * target.priors[0].sd, DRIVE**3 * target.priors[1].sd], axis=1)  # type: ignore[attr-defined]
    mismatch, wide = found.columns[0][:SAMPLES], 1e4
    covariance = (
        sigma**2 * np.eye(SAMPLES) + gains @ gains.T + tau**2 * mismatch @ mismatch.T + wide
    )
    response = saturating.preparation.takes[0].recording.response
    _, size = np.linalg.slogdet(covariance)
    square = response @ np.linalg.solve(covariance, response)
    likelihood = -(size + square + (SAMPLES - 1) * np.log(2 * np.pi) - np.log(wide)) / 2
    wanted = likelihood + stats.norm.logpdf(standard).sum()
    assert float(marginal.log_posterior(standard)) == pytest.approx(wanted, rel=1e-5)


def test_a_discrepancy_is_split_beside_and_along_the_jacobian(saturating):
    (columns,) = discrepancy_of(saturating).columns
    jacobian = np.stack([DRIVE, DRIVE**3, np.ones(SAMPLES)], axis=1)
    basis, _ = np.linalg.qr(jacobian / np.linalg.norm(jacobian, axis=0))
    beside, along = columns[:SAMPLES, :-2], columns[:SAMPLES, -2:]
    lengths = np.linalg.norm(beside, axis=0)
    assert np.abs(basis.T @ beside / lengths).max() < 1e-6
    np.testing.assert_allclose(basis @ (basis.T @ along), along, atol=1e-9)


MISMATCHES = {
    "gives way above 45 V": -0.15 * np.clip(DRIVE - 45, 0, None),
    "gives way above 50 V": -0.15 * np.clip(DRIVE - 50, 0, None),
    "gives way above 55 V": -0.15 * np.clip(DRIVE - 55, 0, None),
    "five waves": 0.3 * np.sin(DRIVE / 5),
    "four waves": 0.3 * np.sin(DRIVE / 6),
    "three waves": 0.3 * np.sin(DRIVE / 7 + 1),
    "a step": np.tanh((DRIVE - 45) / 5),
    "a dead band": 0.1 * np.clip(np.abs(DRIVE - 40) - 5, 0, None),
}


@pytest.mark.slow
def test_intervals_of_a_model_that_is_wrong_hold_only_with_a_discrepancy():
    """a = 0.1 V⁻¹ beside eight mismatches: in no interval without, in six or more of 95 % with."""
    apart = []
    for mismatch in MISMATCHES.values():
        recording = recording_of(Cubic(), 0.02)
        wrong = fit_of(Cubic(), replace(recording, response=recording.response + mismatch), 0.02)
        for beyond in (None, discrepancy_of(wrong)):
            target, terms = target_of(wrong, fj.WhiteNoise(), {}, beyond)
            means, sds = figures(*marginal_of(target, _starts(terms)))
            apart.append(abs(means[0] - 0.1) / sds[0])
    plain, honest = np.array(apart).reshape(-1, 2).T
    assert np.all(plain > 4)
    assert np.sum(honest < 1.96) >= 6
    assert np.all(honest < 3)


@pytest.mark.slow
def test_a_discrepancy_is_sampled_and_predicted(saturating):
    white = fj.WhiteNoise()
    found = fj.sample_posterior(saturating, noise_model=white, discrepancy=True, steps=1000)
    low, high = by_name(found)["a"].interval
    assert low < 0.1 < high
    assert found.converged
    assert "white noise and a discrepancy" in found.sentence
    (band,) = found.bands
    inside = (band.response > band.predictive[0]) & (band.response < band.predictive[1])
    assert inside.mean() > 0.85


def test_a_discrepancy_that_is_not_there_widens_nothing(cubic):
    wide = []
    for found in (None, discrepancy_of(cubic)):
        target, terms = target_of(cubic, fj.WhiteNoise(), {}, found)
        wide.append(figures(*marginal_of(target, _starts(terms)))[1][:2])
    np.testing.assert_allclose(wide[1], wide[0], rtol=0.1)


def test_a_discrepancy_goes_with_normal_noise(cubic):
    with pytest.raises(fj.InputError, match=r"expected normal noise with it, found Student-t"):
        fj.sample_posterior(cubic, noise_model=fj.StudentNoise(), discrepancy=True)


def test_terms_have_starts_within_reach(cubic):
    far = (Term("a", "1", Uniform(0.0, 1.0), 1.0), Term("b", "1", Normal(0.0, 1.0), 1e9))
    np.testing.assert_array_equal(_starts(far), [4.0, 4.0])
