"""Gains that are integrated out."""

from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import fracjax as fj
from fracjax._posterior import Logarithmic, Normal, TruncatedNormal, Uniform, target_of
from fracjax._posterior._marginal import Marginal, _candidates, _linear, figures, marginal_of
from fracjax._posterior._posterior import _starts
from tests.posterior.helpers import DRIVE, SAMPLES, SHARP, fit_of, recording_of


class Following(fj.AbstractBlock):
    """Two gains beside a recursion, y = a u + b x, x a low-pass of u."""

    a: fj.Parameter
    b: fj.Parameter
    share: fj.Parameter

    def __init__(self):
        self.a = fj.Parameter(0.1, "response/drive", gain=True)
        self.b = fj.Parameter(0.1, "response/drive", gain=True)
        self.share = fj.Parameter(0.1, lower=0.01, upper=0.99, plausible=(0.05, 0.5))

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive, grid):
        def one(state, u):
            state = state + self.share.value * (u - state)
            return state, state

        return self.a.value * drive + self.b.value * jax.lax.scan(one, drive[0], drive)[1]


@pytest.mark.parametrize(
    ("noise", "numbers"), [(fj.WhiteNoise(), [0.3]), (fj.ARNoise(2), [0.2, -0.1, 0.3])]
)
def test_the_marginal_density_times_the_gains_is_the_joint_one(cubic, noise, numbers):
    """ln p(v) + ln p(z | v) = ln p(v, z), at gains drawn by any normal numbers."""
    target, terms = target_of(cubic, noise, {})
    marginal, _ = marginal_of(target, _starts(terms))
    assert marginal.integrated == (0, 1)
    for normals in ([0.0, 0.0], [0.4, -2.8]):
        standard = jnp.array(numbers)
        values = np.asarray(marginal.complete(standard, jnp.array(normals)))
        pairs = zip(target.priors, values, strict=True)
        joint = target.log_posterior(jnp.array([float(p.standard(v)) for p, v in pairs]))
        factor = marginal._eliminated(marginal._centred(standard)).factor
        given = stats.norm.logpdf(normals).sum() + np.log(np.diag(factor)).sum()
        found = float(marginal.log_posterior(standard)) + given
        assert found == pytest.approx(float(joint), abs=1e-8)


def test_shapes_are_simulated_once_for_all_gains():
    """A recursion does not run once more for every gain beside it."""
    block = Following()
    fit = fit_of(block, recording_of(block, 0.02), 0.02)
    target, _ = target_of(fit, fj.WhiteNoise(), {})
    gains = _candidates(target)
    marginal = Marginal(target, _linear(target, gains), gains)
    assert len(marginal.integrated) == 2

    def recursions(jaxpr: Any) -> Iterator[Any]:
        for equation in jaxpr.eqns:
            if equation.primitive.name == "scan":
                yield equation
            for inner in jax.tree_util.tree_leaves(list(equation.params.values())):
                yield from recursions(inner.jaxpr) if hasattr(inner, "jaxpr") else ()

    traced = jax.make_jaxpr(marginal.log_posterior)(jnp.zeros(len(marginal.sampled)))
    longest = max(recursions(traced.jaxpr), key=lambda found: found.params["length"])
    assert longest.params["length"] >= DRIVE.size - 1
    assert all(out.aval.ndim <= 1 for out in longest.outvars)


def test_gains_near_a_bound_stay_in_the_chain(cubic):
    near = {"a": TruncatedNormal(0.0, 1.0, 0.0995, 9.0), "b": TruncatedNormal(0.0, 1.0, -1.0, 1.0)}
    target, terms = target_of(cubic, fj.WhiteNoise(), near)
    assert marginal_of(target, _starts(terms))[0].integrated == (1,)


def test_only_gains_that_are_normal_or_flat_are_integrated_out(cubic):
    def candidates(noise, **priors) -> tuple[int, ...]:
        return _candidates(target_of(cubic, noise, priors)[0])

    logarithmic = Logarithmic(Normal(-2.0, 1.0))
    assert candidates(fj.MeasuredNoise(), a=Uniform(0.0, 1.0)) == (0, 1)
    assert candidates(fj.MeasuredNoise(), a=logarithmic) == (1,)
    assert candidates(fj.StudentNoise()) == ()


def test_a_flat_prior_leaves_the_least_squares_estimate(cubic):
    priors = SHARP | {"a": Uniform(-9.0, 9.0), "b": Uniform(-1.0, 1.0)}
    target, terms = target_of(cubic, fj.WhiteNoise(), priors)
    means, sds = figures(*marginal_of(target, _starts(terms)))
    columns = np.stack([DRIVE, DRIVE**3, np.ones(SAMPLES)], axis=1)
    response = cubic.preparation.takes[0].recording.response
    wanted = np.linalg.lstsq(columns, response, rcond=None)[0]
    covariance = 0.05**2 * np.linalg.inv(columns.T @ columns)
    np.testing.assert_allclose(means[:2], wanted[:2], rtol=1e-8)
    np.testing.assert_allclose(sds[:2], np.sqrt(np.diag(covariance))[:2], rtol=1e-5)
