"""Quantisation: rounding, its mean over noise, and the step that a recording shows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from fracjax._blocks import EFFECTS, Quantisation
from fracjax._diagnose._fitted import fitted
from fracjax._diagnose._views import model_view
from fracjax._prepare import prepare
from fracjax._recording import resolution
from tests.blocks.motion import BASE, DRIVE, GRID, NAMES, PLAIN, recorded
from tests.helpers import respond, specified

EFFECTS_HERE = [name for name in NAMES if name in EFFECTS]


# Quantisation -------------------------------------------------------------------------------------


def test_sharp_quantisation_is_rounding():
    block, values = Quantisation(0.3, 0.02, step=0.5), np.linspace(-7.3, 9.1, 2001)
    found = respond(block, values, GRID)
    wanted = 0.5 * (np.round(values / 0.5 - 0.3) + 0.3)
    corners = np.abs((values / 0.5 - 0.3) % 1 - 0.5) < 0.12
    np.testing.assert_allclose(found[~corners], wanted[~corners], rtol=0, atol=1e-8)
    assert corners.mean() < 0.25


@pytest.mark.parametrize("noise", [0.05, 0.2, 0.5])
def test_quantisation_is_the_mean_of_rounding_over_the_noise(noise):
    """Σ_k k P(the noisy value rounds to k), over all codes."""
    values, codes = np.linspace(-2.2, 3.1, 401), np.arange(-12, 14)
    place = values[:, None] / 0.5 - 0.3
    chance = norm.cdf((codes + 0.5 - place) / noise) - norm.cdf((codes - 0.5 - place) / noise)
    wanted = 0.5 * (chance @ codes + 0.3)
    found = respond(Quantisation(0.3, noise, step=0.5), values, GRID)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-6)


def test_noise_of_a_third_of_a_step_hides_the_steps():
    values = np.linspace(0, 5, 501)
    errors = [
        np.ptp(respond(Quantisation(0.0, noise, step=0.5), values, GRID) - values) / 0.5
        for noise in (0.02, 1 / 3, 0.5)
    ]
    assert errors[0] > 0.8
    assert errors[1] == pytest.approx(2 / np.pi * np.exp(-2 * np.pi**2 / 9), rel=0.02)
    assert errors[2] < 0.005


# What a recording says ----------------------------------------------------------------------------


@given(
    step=st.floats(1e-6, 1e3),
    origin=st.floats(-5, 5),
    noise=st.floats(0.0, 3.0),
    seed=st.integers(0, 1000),
)
def test_the_step_of_a_converter_is_found(step, origin, noise, seed):
    generator = np.random.default_rng(seed)
    codes = np.round(20 * np.sin(np.arange(400) / 9) + noise * generator.standard_normal(400))
    codes[:3] = 0, 1, 3
    assert resolution((codes + origin) * step) == pytest.approx(step, rel=1e-6)


def test_codes_that_were_scaled_and_rounded_still_lie_on_a_grid():
    codes = np.round(60 * np.sin(np.arange(900) / 40))
    assert resolution(np.round(codes * 0.0305176, 3)) == pytest.approx(0.0305176, rel=1e-3)


def test_noise_of_many_digits_lies_on_no_grid():
    generator = np.random.default_rng(5)
    assert resolution(generator.standard_normal(500)) == 0
    assert resolution(np.sin(np.arange(500.0))) == 0


# The score test -----------------------------------------------------------------------------------


def scored(name: str, response: np.ndarray, sigma: float) -> float:
    """The effect's largest |z| after FOH has been fitted to the response."""
    base = fitted([BASE], prepare([recorded(response)], noise=specified(sigma), history="constant"))
    law = model_view(base).law
    inner = law.inner
    own = [k for kind in law.kinds if kind.name == name for k in range(kind.start, kind.stop)]
    lengths = np.sqrt(np.diag(inner.columns)[own])
    return float(np.abs(inner.along[own] / np.maximum(lengths, 1e-300)).max())


NOISE = np.random.default_rng(8).standard_normal(DRIVE.size)


@pytest.mark.parametrize(("noise", "seen"), [(0.05, True), (0.2, True), (0.6, False), (1.5, False)])
def test_a_converter_is_seen_only_where_its_noise_is_below_its_step(noise, seen):
    step = 0.1
    response = step * np.round(PLAIN / step + 0.21 + noise * NOISE)
    score = scored("quantisation", response, step * np.hypot(noise, np.sqrt(1 / 12)))
    assert (score > 8) == seen
    assert seen or score < 4
