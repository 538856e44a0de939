"""Truths drawn from the prior lie evenly in their posteriors."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import fracjax as fj
from benchmarks.concealed.truth import BASES, OVER
from fracjax._posterior import Logarithmic, Normal, TruncatedNormal
from tests.helpers import specified
from tests.posterior.helpers import DRIVE, SAMPLES, STEP, by_name, fit_of, recording_of


class Exponential(fj.AbstractBlock):
    """One shape and no gain: y = (exp(-γ u/50) - 1)/γ."""

    gamma: fj.Parameter

    def __init__(self):
        self.gamma = fj.Parameter(0.5, lower=0.05, upper=3.0, plausible=(0.2, 1.5))

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive, grid):
        return jnp.expm1(-self.gamma.value * drive / 50) / self.gamma.value


@pytest.mark.slow
def test_the_truth_of_a_short_recording_is_within_the_posterior():
    """LFDH simulated by other numerics on a finer grid, 240 samples."""
    law = {"chi": 0.2, "mu": 0.4, "delta": 0.08, "g": 0.03, "g_kappa": 0.12}
    fine = np.arange((SAMPLES - 1) * OVER + 1) * STEP / OVER
    drive = 40 + 15 * np.sin(2 * np.pi * 2.3 * fine) + 9 * np.sin(2 * np.pi * 9.1 * fine + 1)
    clean = BASES["lfdh"].response(drive, STEP / OVER, law)[::OVER]
    noise = np.random.default_rng(1).standard_normal(SAMPLES)
    recording = fj.Recording(DRIVE, clean + 1 + 0.02 * noise, STEP, "V", "um")
    fit = fj.fit(
        fj.parse_model("lfdh"), recording, noise=specified(0.02), fixed={"mu": 0.4}, starts=1
    )
    found = fj.sample_posterior(fit, noise_model=fj.WhiteNoise(), steps=800)
    true = {"chi": 0.2, "delta": 0.08, "k_0": 0.03, "k_delta": 0.12, "noise.sigma": 0.02}
    assert by_name(found).keys() == true.keys()
    for name, value in true.items():
        low, high = np.quantile(found.samples[name], [0.001, 0.999])
        assert low < value < high, name
    assert by_name(found)["noise.sigma"].sd == pytest.approx(0.02 / np.sqrt(2 * SAMPLES), rel=0.2)


@pytest.mark.slow
def test_ranks_are_uniform_where_truths_are_drawn_from_the_prior():
    """Simulation-based calibration (Talts et al. 2018) of one shape and the noise, 20 draws."""
    priors = {
        "gamma": TruncatedNormal(0.8, 0.3, 0.05, 3.0),
        "noise.sigma": Logarithmic(Normal(np.log(0.05), 0.3)),
    }
    generator = np.random.default_rng(3)
    ranks = []
    for seed in range(20):
        truth = {n: float(p.value(generator.standard_normal())) for n, p in priors.items()}
        block = eqx.tree_at(lambda b: b.gamma.value, Exponential(), np.asarray(truth["gamma"]))
        fit = fit_of(Exponential(), recording_of(block, truth["noise.sigma"], seed), 0.05)
        found = fj.sample_posterior(
            fit, noise_model=fj.WhiteNoise(), priors=priors, walkers=16, steps=200, seed=seed
        )
        ranks.append([np.mean(found.samples[name] < truth[name]) for name in priors])
    for column in np.array(ranks).T:
        assert stats.kstest(column, "uniform").pvalue > 0.01
