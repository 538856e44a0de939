"""Posteriors: closed forms, densities beside SciPy's, chains that survive kill -9, calibration."""

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import arviz
import equinox as eqx
import h5py
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, stats
from scipy.linalg import solve_triangular, toeplitz

import fracjax as fj
import fracjax._fit
from benchmarks.concealed.truth import BASES, OVER
from fracjax._cli import run
from fracjax._posterior import (
    AbstractPrior,
    Logarithmic,
    Normal,
    Row,
    Term,
    TruncatedNormal,
    Uniform,
    ar_noise_of,
    laplace,
    prior_of,
    split_r_hat,
    target_of,
)
from fracjax._posterior._discrepancy import discrepancy_of
from fracjax._posterior._doubt import doubt_of
from fracjax._posterior._marginal import Marginal, _candidates, _linear, figures, marginal_of
from fracjax._posterior._noise_models import autoregressive, partial_autocorrelations
from fracjax._posterior._posterior import _starts
from fracjax._posterior._prior import values_of
from fracjax._posterior._sample import ChainFile, run_ensemble
from tests.helpers import specified

STEP = 4e-3
SAMPLES = 240
TIMES = STEP * np.arange(SAMPLES)
DRIVE = 40 + 15 * np.sin(2 * np.pi * 2.3 * TIMES) + 9 * np.sin(2 * np.pi * 9.1 * TIMES + 1)


class Cubic(fj.AbstractBlock):
    """Two gains, y = a u + b u³: a linear model, whose posterior is known."""

    a: fj.Parameter
    b: fj.Parameter

    def __init__(self):
        self.a = fj.Parameter(0.1, "response/drive", gain=True)
        self.b = fj.Parameter(0.0, "response/drive^3", gain=True)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive, grid):
        return self.a.value * drive + self.b.value * drive**3


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


def recording_of(block: fj.AbstractBlock, sigma: float, seed: int = 0) -> fj.Recording:
    clean = np.asarray(block(jnp.asarray(DRIVE), fj.Grid(STEP)))
    noise = np.random.default_rng(seed).standard_normal(SAMPLES)
    return fj.Recording(DRIVE, clean + 2.0 + sigma * noise, STEP)


def fit_of(block: fj.AbstractBlock, recording: fj.Recording, sigma: float) -> fj.Fit:
    model = fj.Model(block, "law")
    return fj.fit(model, recording, noise=specified(sigma), history="constant", starts=1)


@pytest.fixture(scope="module")
def cubic() -> fj.Fit:
    return fit_of(Cubic(), recording_of(Cubic(), 0.05), 0.05)


def by_name(posterior: fj.Posterior) -> dict[str, Row]:
    return {row.name: row for row in posterior.summary}


# Priors -------------------------------------------------------------------------------------------

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


# Noise models -------------------------------------------------------------------------------------


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


# The closed form ----------------------------------------------------------------------------------

SHARP = {"noise.sigma": Logarithmic(Normal(np.log(0.05), 1e-9))}


@pytest.fixture(scope="module")
def sampled(cubic, tmp_path_factory) -> fj.Posterior:
    """The linear model with its noise known, sampled to the end."""
    return fj.sample_posterior(
        cubic,
        noise_model=fj.WhiteNoise(),
        priors=SHARP,
        chain=tmp_path_factory.mktemp("chain") / "chain.h5",
        steps=4000,
    )


def test_a_linear_model_has_the_posterior_in_closed_form(cubic, sampled):
    target, _ = target_of(cubic, fj.WhiteNoise(), SHARP)
    prior_sd = np.array([float(prior.sd) for prior in target.priors[:2]])  # type: ignore[attr-defined]
    columns = np.stack([DRIVE, DRIVE**3], axis=1)
    columns -= columns.mean(axis=0)
    response = cubic.preparation.takes[0].recording.response
    precision = columns.T @ columns / 0.05**2 + np.diag(prior_sd**-2.0)
    covariance = np.linalg.inv(precision)
    mean = covariance @ columns.T @ (response - response.mean()) / 0.05**2
    sd = np.sqrt(np.diag(covariance))
    assert sampled.converged
    for k, name in enumerate("ab"):
        row = by_name(sampled)[name]
        assert abs(row.mean - mean[k]) < 0.05 * sd[k], name
        assert row.sd == pytest.approx(sd[k], rel=0.05)
        assert row.laplace_mean == pytest.approx(mean[k], abs=1e-4 * sd[k])
        assert row.laplace_sd == pytest.approx(sd[k], rel=1e-4)
        assert row.interval == pytest.approx(
            (mean[k] - 1.96 * sd[k], mean[k] + 1.96 * sd[k]), abs=0.3 * sd[k]
        )
        assert row.agrees
    assert "agrees" in sampled.sentence


def test_the_predictive_band_holds_what_was_measured(sampled):
    (band,) = sampled.bands
    inside = (band.response > band.predictive[0]) & (band.response < band.predictive[1])
    assert 0.9 < inside.mean() < 0.99
    assert np.all(band.model[0] >= band.predictive[0])
    width = np.mean(band.predictive[1] - band.predictive[0])
    assert width == pytest.approx(2 * 1.96 * 0.05, rel=0.05)


def test_what_is_saved_is_loaded_without_loss(sampled, tmp_path):
    sampled.save(tmp_path)
    loaded = fj.load_posterior(tmp_path)
    assert loaded.to_dict() == sampled.to_dict()
    assert loaded.summary == sampled.summary
    for name, draws in sampled.samples.items():
        np.testing.assert_array_equal(loaded.samples[name], draws)
        np.testing.assert_array_equal(loaded.prior[name], sampled.prior[name])
    for one, other in zip(loaded.bands, sampled.bands, strict=True):
        for field in ("times", "drive", "response", "used", "median", "model", "predictive"):
            np.testing.assert_array_equal(getattr(one, field), getattr(other, field))
    told = json.loads((tmp_path / "posterior.json").read_text(encoding="utf-8"))
    assert told["schema"] == "fracjax.posterior/1"
    assert told["parameters"]["a"]["unit"] == "um/V"


def test_arviz_reads_it(sampled, tmp_path):
    sampled.save(tmp_path)
    groups = arviz.from_netcdf(str(tmp_path / "posterior.nc"))
    found = groups["posterior"]["a"]
    assert found.dims == ("chain", "draw")
    assert found.attrs["units"] == "um/V"
    assert np.asarray(found).mean() == pytest.approx(by_name(sampled)["a"].mean, rel=1e-12)
    groups.close()  # type: ignore[call-arg]


@pytest.mark.parametrize("content", [None, "", "{}", '{"schema": "fracjax.posterior/99"}'])
def test_what_is_no_posterior_is_refused(content, sampled, tmp_path):
    sampled.save(tmp_path)
    if content is None:
        (tmp_path / "posterior.nc").unlink()
    else:
        (tmp_path / "posterior.json").write_text(content, encoding="utf-8")
    with pytest.raises(fj.InputError, match=r"expected a (folder|posterior).*found"):
        fj.load_posterior(tmp_path)


def test_the_page_shows_it_all(sampled, tmp_path):
    fj.write_report(sampled, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 5
    for text in (
        "noise.sigma",
        "not modelled",
        "What the data tell",
        "Traces",
        "split R-hat",
        sampled.sentence,
    ):
        assert text in page
    assert not re.search(r'(src|href)="(?!data:|#)', page.replace("xlink:href", "href"))


def test_precision_is_left_alone(cubic, sampled, float32_default):
    again = fj.sample_posterior(cubic, noise_model=fj.WhiteNoise(), priors=SHARP, steps=200)
    assert jnp.ones(1).dtype == np.float32
    assert again.samples["a"].dtype == np.float64
    assert by_name(again)["a"].laplace_sd == pytest.approx(by_name(sampled)["a"].laplace_sd)


# Gains integrated out -----------------------------------------------------------------------------


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


# What the model leaves out ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def saturating() -> fj.Fit:
    """Truth: a = 0.1, b = 0, and a response that gives way above 50 V, which no cubic does."""
    recording = recording_of(Cubic(), 0.02)
    response = recording.response - 0.15 * np.clip(DRIVE - 50, 0, None)
    return fit_of(Cubic(), replace(recording, response=response), 0.02)


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
    with pytest.raises(fj.InputError, match=r"expected normal noise beside it, found Student-t"):
        fj.sample_posterior(cubic, noise_model=fj.StudentNoise(), discrepancy=True)


def diagnosis_file(folder: Path, **fields) -> Path:
    told = {"schema": "fracjax.diagnosis/1", "model": "law", "verdict": "none", "effects": []}
    path = folder / "diagnosis.json"
    path.write_text(json.dumps(told | fields), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("verdict", "names", "others", "told"),
    [
        ("none", [], [], ""),
        ("missing", ["creep", "backlash"], [], "leaves creep and backlash unexplained"),
        ("confusable", ["delay"], ["drive_lag"], "leaves delay or drive_lag unexplained"),
        ("unexplained", [], [], "leaves part of the response unexplained"),
    ],
)
def test_a_posterior_carries_the_verdict_of_a_diagnosis(tmp_path, verdict, names, others, told):
    effects = [{"name": name, "confusable_with": others} for name in names]
    doubt = doubt_of(diagnosis_file(tmp_path, verdict=verdict, effects=effects), "law")
    assert told in doubt
    assert doubt.endswith("intervals hold only if the model is right.") == bool(told)


def test_a_diagnosis_of_something_else_is_refused(tmp_path, cubic):
    with pytest.raises(fj.InputError, match=r"expected a diagnosis of law, found one of foh"):
        fj.sample_posterior(cubic, diagnosis=diagnosis_file(tmp_path, model="foh"))
    for content in ("", "[]", '{"schema": "fracjax.fit/1"}'):
        (tmp_path / "diagnosis.json").write_text(content, encoding="utf-8")
        with pytest.raises(fj.InputError, match=r"expected a diagnosis .* found something else"):
            fj.sample_posterior(cubic, diagnosis=tmp_path / "diagnosis.json")


# Laplace ------------------------------------------------------------------------------------------


def test_where_the_data_tell_nothing_the_prior_stands(cubic):
    """Noise a million times the signal."""
    priors = {"noise.sigma": Logarithmic(Normal(np.log(5e4), 1e-9))}
    target, terms = target_of(cubic, fj.WhiteNoise(), priors)
    found = laplace(target, _starts(terms))
    assert found.converged
    np.testing.assert_allclose(found.factor @ found.factor.T, np.eye(3), atol=1e-2)


def test_disagreement_has_limits():
    row = Row("a", "1", 0.0, 1.0, (-2, 2), 900.0, 1.0, 0.0, 1.0, (-9, 9))
    assert row.agrees
    assert not replace(row, mean=0.51).agrees
    assert not replace(row, sd=1.26).agrees
    assert not replace(row, sd=0.79).agrees


# The chain ----------------------------------------------------------------------------------------

SETTINGS = {"model": "bowl"}


def bowl(points: np.ndarray) -> np.ndarray:
    return -np.sum(points**2, axis=1) / 2 - 0.1 * np.sum(points**4, axis=1)


def run_bowl(
    path: Path, steps: int = 300, *, resume: bool = False, settings=SETTINGS, density=bowl
):
    return run_ensemble(
        density,
        walkers=16,
        size=3,
        steps=steps,
        seed=5,
        file=ChainFile(path),
        resume=resume,
        settings=settings,
        watch=lambda chain: None,
    )


def test_a_walker_that_never_moves_is_no_error(tmp_path):
    """It stands on a needle; of it there is no autocorrelation time."""
    needle = []

    def with_needle(points: np.ndarray) -> np.ndarray:
        if not needle and len(np.unique(points, axis=0)) > 1:
            needle.append(points[0].copy())
        on_it = np.all(points == needle[0], axis=1) if needle else np.zeros(len(points), bool)
        return bowl(points) + 1e9 * on_it

    found = run_bowl(tmp_path / "chain.h5", 120, density=with_needle)
    assert not found.converged
    assert np.all(np.isfinite(found.autocorrelation))
    assert found.autocorrelation.max() >= len(found.kept)


KILLED = """
import sys, time
from pathlib import Path
import numpy as np
from fracjax._posterior._sample import ChainFile, run_ensemble

def slowly(points):
    time.sleep(0.002)
    return -np.sum(points**2, axis=1) / 2 - 0.1 * np.sum(points**4, axis=1)

run_ensemble(slowly, walkers=16, size=3, steps=300, seed=5, file=ChainFile(Path(sys.argv[1])),
             resume=False, settings={"model": "bowl"}, watch=lambda chain: None)
"""


def test_a_killed_chain_goes_on_as_if_nothing_had_happened(tmp_path):
    whole = run_bowl(tmp_path / "whole.h5")
    path = tmp_path / "killed.h5"
    root = Path(fj.__file__).parents[1]
    worker = subprocess.Popen([sys.executable, "-c", KILLED, str(path)], cwd=root)
    deadline = time.monotonic() + 60
    while not path.exists() and worker.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.1)  # into the second block
    worker.send_signal(signal.SIGKILL)
    assert worker.wait() == -signal.SIGKILL
    with h5py.File(path) as file:
        assert file["mcmc"].attrs["iteration"] in (100, 200)
    assert (tmp_path / ".killed.h5.part").exists()
    (tmp_path / ".killed.h5.part").write_bytes(b"torn")
    resumed = run_bowl(path, resume=True)
    np.testing.assert_array_equal(resumed.coordinates, whole.coordinates)
    with h5py.File(path) as file:
        assert file["mcmc"].attrs["iteration"] == 300
    assert {p.name for p in tmp_path.iterdir()} == {"whole.h5", "killed.h5"}


def test_a_finished_chain_is_taken_as_it_is_and_made_longer(tmp_path):
    first = run_bowl(tmp_path / "chain.h5", 200)
    same = run_bowl(tmp_path / "chain.h5", 200, resume=True)
    np.testing.assert_array_equal(same.coordinates, first.coordinates)
    longer = run_bowl(tmp_path / "chain.h5", 300, resume=True)
    np.testing.assert_array_equal(longer.coordinates[:200], first.coordinates)
    assert len(longer.coordinates) == 300
    anew = run_bowl(tmp_path / "chain.h5", 100)
    assert len(anew.coordinates) == 100


def test_a_chain_of_another_call_is_refused(tmp_path):
    run_bowl(tmp_path / "chain.h5", 100)
    with pytest.raises(fj.InputError, match=r"expected a chain with model vase, found one with"):
        run_bowl(tmp_path / "chain.h5", resume=True, settings={"model": "vase"})
    (tmp_path / "chain.h5").write_bytes(b"no chain")
    with pytest.raises(fj.InputError, match=r"expected a chain saved by fracjax"):
        run_bowl(tmp_path / "chain.h5", resume=True)


def test_an_interrupt_keeps_the_blocks_that_are_done(tmp_path, capsys):
    calls = []

    def interrupted(points):
        calls.append(1)
        if len(calls) > 350:
            raise KeyboardInterrupt
        return bowl(points)

    with pytest.raises(KeyboardInterrupt):
        run_bowl(tmp_path / "chain.h5", density=interrupted)
    with h5py.File(tmp_path / "chain.h5") as file:
        assert file["mcmc"].attrs["iteration"] == 100
    assert [p.name for p in tmp_path.iterdir()] == ["chain.h5"]
    assert capsys.readouterr() == ("", "")


def test_walkers_do_not_begin_where_the_density_is_nothing(tmp_path):
    def cliff(points):
        return np.where(np.abs(points[:, 0]) < 0.5, bowl(points), -np.inf)

    chain = run_bowl(tmp_path / "chain.h5", 100, density=cliff)
    assert np.isfinite(chain.log_density).all()


def test_r_hat_sees_a_drift():
    draws = np.random.default_rng(0).standard_normal((400, 16, 2))
    draws[:, :, 1] += np.linspace(0, 1, 400)[:, None]
    still, drifting = split_r_hat(draws)
    assert still < 1.01 < drifting


# Calls --------------------------------------------------------------------------------------------


def test_unusable_calls_are_refused(cubic):
    with pytest.raises(fj.InputError, match=r'prior of "wumpus": expected one of a, b, noise'):
        fj.sample_posterior(cubic, priors={"wumpus": Normal(0.0, 1.0)})
    for walkers in (4, 33):
        with pytest.raises(fj.InputError, match=r"walkers: expected an even number of at least 6"):
            fj.sample_posterior(cubic, walkers=walkers)
    with pytest.raises(fj.InputError, match=r"steps: expected at least 40, found 3"):
        fj.sample_posterior(cubic, steps=3)


def test_the_command_says_when_a_chain_has_not_converged(tmp_path, cubic, capsys, monkeypatch):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "")
    monkeypatch.setattr(fracjax._fit, "fit", lambda model, recordings, **options: cubic)
    recording = cubic.preparation.takes[0].recording
    columns = np.stack([TIMES, recording.drive, recording.response], axis=1)
    path, out = tmp_path / "loop.csv", tmp_path / "out"
    head = "time_s,voltage_V,displacement_um"
    np.savetxt(path, columns, delimiter=",", header=head, comments="")
    call = ["posterior", str(path), "--model", "creep", "--out", str(out), "--quiet"]
    assert run([*call, "--noise-model", "white", "--steps", "100"]) == 3
    _, err = capsys.readouterr()
    assert "did not converge in 100 steps" in err
    assert err.count("\n") == 1
    assert not fj.load_posterior(out).converged
    doubted = diagnosis_file(tmp_path, verdict="unexplained")
    again = [*call, "--noise-model", "white", "--resume", "--json", "--diagnosis", str(doubted)]
    assert run([*again, "--steps", "4000"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["converged"]
    assert "intervals hold only if the model is right" in told["sentence"]
    assert told["doubt"] in (out / "report.html").read_text(encoding="utf-8")
    assert 100 < told["steps"] < 4000
    names = {"posterior.nc", "posterior.json", "report.html", "fit.json", "chain.h5"}
    assert {p.name for p in out.iterdir()} == names
    assert run([*again, "--noise-model", "measured"]) == 2
    assert (
        "expected a chain with noise model measured, found one with white"
        in capsys.readouterr().err
    )


# Recovery and calibration -------------------------------------------------------------------------


def test_the_truth_of_a_short_recording_is_within_the_posterior():
    """LFDH simulated by other numerics on a finer grid, 240 samples."""
    law = {"chi": 0.2, "mu": 0.4, "delta": 0.08, "g": 0.03, "g_kappa": 0.12}
    fine = np.arange((SAMPLES - 1) * OVER + 1) * STEP / OVER
    drive = 40 + 15 * np.sin(2 * np.pi * 2.3 * fine) + 9 * np.sin(2 * np.pi * 9.1 * fine + 1)
    clean = BASES["lfdh"].response(drive, STEP / OVER, law)[::OVER]
    noise = np.random.default_rng(1).standard_normal(SAMPLES)
    recording = fj.Recording(DRIVE, clean + 1 + 0.02 * noise, STEP)
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


def test_terms_have_starts_within_reach(cubic):
    far = (Term("a", "1", Uniform(0.0, 1.0), 1.0), Term("b", "1", Normal(0.0, 1.0), 1e9))
    np.testing.assert_array_equal(_starts(far), [4.0, 4.0])
