"""What a posterior predicts for another drive, beside Bayesian linear regression."""

import numpy as np
import pytest

import fracjax as fj
from tests.posterior.helpers import DRIVE, SAMPLES, STEP

SIGMA = 0.05
OTHER = np.linspace(0.0, 90.0, 40)


def test_mean_and_interval_are_those_of_linear_regression(sampled, cubic):
    """y = a u + b u³ + c with white noise of known size, under flat priors."""
    measured = cubic.preparation.takes[0].recording.response
    columns = np.stack([DRIVE, DRIVE**3, np.ones(SAMPLES)], axis=1)
    covariance = SIGMA**2 * np.linalg.inv(columns.T @ columns)
    coefficients = covariance @ columns.T @ measured / SIGMA**2
    other = np.stack([OTHER, OTHER**3, np.ones(OTHER.size)], axis=1)
    sd = np.sqrt(np.einsum("ij,jk,ik->i", other, covariance, other))
    prediction = sampled.predict(OTHER)
    # 200 draws: the mean is uncertain by sd/14, the ends of the interval by about 0.18 sd.
    assert np.abs((prediction.mean - other @ coefficients) / sd).max() < 0.3
    low, high = prediction.interval
    assert np.abs((high - low) / (2 * 1.96 * sd) - 1).max() < 0.35
    assert np.mean((high - low) / (2 * 1.96 * sd)) == pytest.approx(1, abs=0.15)


def test_a_recording_has_its_own_step_and_must_have_the_same_units(sampled):
    recording = fj.Recording(DRIVE, DRIVE, STEP / 2, "V", "um")
    np.testing.assert_array_equal(sampled.predict(recording).mean, sampled.predict(DRIVE).mean)
    with pytest.raises(fj.InputError, match="expected the units of"):
        sampled.predict(fj.Recording(DRIVE, DRIVE, STEP, "V", "nm"))


def test_a_loaded_posterior_predicts_the_same_if_its_name_builds_the_model(sampled, tmp_path):
    sampled.save(tmp_path)
    with pytest.raises(fj.InputError, match="found one of a class of its own"):
        fj.load_posterior(tmp_path).predict(OTHER)


@pytest.mark.slow
def test_a_named_model_predicts_the_same_after_loading(tmp_path):
    generator = np.random.default_rng(3)
    recording = fj.Recording(
        DRIVE, 0.1 * DRIVE + 1 + generator.normal(0, SIGMA, SAMPLES), STEP, "V", "um"
    )
    fit = fj.fit("prandtl_ishlinskii", recording, noise=SIGMA, fixed={"q": 0.0}, starts=1)
    posterior = fj.sample_posterior(fit, noise_model=fj.WhiteNoise(), steps=60)
    posterior.save(tmp_path)
    expected, loaded = (p.predict(OTHER) for p in (posterior, fj.load_posterior(tmp_path)))
    np.testing.assert_array_equal(loaded.mean, expected.mean)
    np.testing.assert_array_equal(loaded.interval, expected.interval)
