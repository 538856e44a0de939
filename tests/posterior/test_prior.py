"""Priors beside SciPy's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

import fracjax as fj
from fracjax._posterior import (
    AbstractPrior,
    Logarithmic,
    Normal,
    TruncatedNormal,
    Uniform,
    prior_of,
)
from fracjax._posterior._prior import values_of

PRIORS = [
    (Normal(2.0, 3.0), stats.norm(2.0, 3.0)),
    (Uniform(-1.0, 4.0), stats.uniform(-1.0, 5.0)),
    (TruncatedNormal(0.0, 0.3, -0.95, 0.95), stats.truncnorm(-0.95 / 0.3, 0.95 / 0.3, 0.0, 0.3)),
    (TruncatedNormal(0.1, 1.0, 0.0, 9.0), stats.truncnorm(-0.1, 8.9, 0.1, 1.0)),
    (Logarithmic(Normal(1.0, 0.5)), stats.lognorm(0.5, scale=np.e)),
]


@pytest.mark.parametrize(("prior", "peer"), PRIORS)
def test_priors_are_those_of_scipy(prior: AbstractPrior, peer):
    values = peer.ppf(np.linspace(0.001, 0.999, 41))
    np.testing.assert_allclose(prior.log_density(values), peer.logpdf(values), rtol=1e-10)
    standard = stats.norm.ppf(np.linspace(0.001, 0.999, 41))
    np.testing.assert_allclose(prior.value(standard), values, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(prior.standard(values), standard, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(("prior", "peer"), PRIORS[1:])
def test_nothing_is_likely_beyond_the_bounds(prior: AbstractPrior, peer):
    low, high = peer.support()
    outside = [low - 1e-6, high + 1e-6] if np.isfinite(high) else [low - 1e-6, -3.0]
    assert np.all(np.isneginf(prior.log_density(np.array(outside))))
    # Where a search would begin there, it begins far out, not nowhere.
    ends = [-np.inf, np.inf] if np.isfinite(high) else [-np.inf, -np.inf]
    np.testing.assert_array_equal(prior.standard(np.array(outside)), ends)


@given(st.floats(-9, 9), st.sampled_from([prior for prior, _ in PRIORS]))
def test_values_keep_within_bounds_and_their_slope(v: float, prior: AbstractPrior):
    """The density carried by the map: p(x) dx/dv = φ(v), in the middle and far out."""
    value, slope = jax.value_and_grad(prior.value)(jnp.asarray(v))
    assert np.isfinite(value)
    assert np.isfinite(slope)
    if abs(v) < 5:
        carried = prior.log_density(value) + jnp.log(slope)
        assert float(carried) == pytest.approx(stats.norm.logpdf(v), rel=1e-6, abs=1e-6)


def test_priors_of_several_kinds_are_evaluated_in_order():
    priors = [prior for prior, _ in PRIORS]
    standard = jnp.linspace(-1, 1, len(priors))
    wanted = [prior.value(v) for prior, v in zip(priors, standard, strict=True)]
    np.testing.assert_allclose(values_of(priors, standard), wanted, rtol=1e-14)


def test_a_plausible_range_holds_95_percent():
    chi = fj.blocks.LFDH().chi
    prior = prior_of(chi, 0, 1.0)
    assert isinstance(prior, Logarithmic)
    ends = prior.value(jnp.array([-1.959964, 1.959964]))
    np.testing.assert_allclose(ends, [1e-2, 3.0], rtol=1e-4)
    gain = prior_of(fj.blocks.FOH().k_l, 0, 0.2)
    assert isinstance(gain, Normal)
    assert float(gain.sd) == pytest.approx(2.0)
