"""What data fix together only."""

import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._fit._combinations import combinations_of
from tests.helpers import specified


def test_the_sum_that_a_covariance_fixes_is_found():
    """θ_1 + θ_2 known to 1e-4, θ_1 - θ_2 to 1; a third parameter has nothing to do with it."""
    axes = np.array([[1, 1], [1, -1]]) / np.sqrt(2)
    block = axes.T @ np.diag([1e-8, 1.0]) @ axes
    covariance = np.zeros((3, 3))
    covariance[:2, :2], covariance[2, 2] = block, 0.01
    units = ["um/V", "um/V*s^alpha", "1"]
    (found,) = combinations_of(["k_l", "k_h", "x"], np.array([0.3, 0.4, 1.0]), units, covariance)
    assert found.text == "k_l + k_h"
    assert found.unit == "um/V"
    assert found.value == pytest.approx(0.7)
    assert found.standard_error == pytest.approx(np.sqrt(2e-8), rel=1e-6)
    assert found.coefficients == {"k_l": 1.0, "k_h": 1.0}


def test_the_product_that_a_covariance_fixes_is_found():
    """ln k + ln a known to 1e-3, their difference to 0.2."""
    values = np.array([0.04, 0.03])
    axes = np.array([[1, 1], [1, -1]]) / np.sqrt(2)
    covariance = axes.T @ np.diag([1e-6, 0.04]) @ axes * np.outer(values, values)
    (found,) = combinations_of(["a", "k"], values[::-1], ["1", "um/V*s^a"], covariance[::-1, ::-1])
    assert found.text == "k·a"
    assert found.unit == "um/V"
    assert found.value == pytest.approx(0.0012)
    assert found.percent == pytest.approx(100 * np.sqrt(2e-6), rel=1e-6)


def test_a_group_without_any_close_pair_is_found():
    """Three gains of which only the sum is known; no two correlate beyond 0.5."""
    ones = np.ones(3) / np.sqrt(3)
    covariance = np.eye(3) - (1 - 1e-6) * np.outer(ones, ones)
    names = ["a", "b", "c"]
    correlation = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert np.abs(correlation[np.triu_indices(3, 1)]).max() < 0.51
    (found,) = combinations_of(names, np.ones(3), ["V"] * 3, covariance)
    assert found.text == "a + b + c"
    assert found.standard_error == pytest.approx(np.sqrt(3e-6), rel=1e-3)


def test_a_slow_loop_of_foh_fixes_the_sum_of_the_gains_and_the_product_with_the_order():
    times = 5e-3 * np.arange(1500)
    drive = 50 - 45 * np.cos(2 * np.pi * times) + 5 * np.sin(2 * np.pi * 3 * times)
    law = {"k_l": 0.07, "k_h": 0.04, "alpha": 0.03, "k_p": 0.0}
    clean = np.asarray(
        fj.parse_model("foh").with_values(law).block(jnp.asarray(drive), fj.Grid(5e-3))
    )
    sigma = 1e-3 * np.ptp(clean)
    noise = specified(sigma)
    recording = fj.Recording(
        drive, clean + sigma * np.random.default_rng(2).standard_normal(1500), 5e-3, "V", "um"
    )
    found = fj.fit(
        fj.parse_model("foh"), recording, noise=noise, history="constant", starts=1,
        fixed={"k_p": 0.0, "beta": -0.1},
    )  # fmt: skip
    known = {c.text: c for c in found.combinations}
    assert known["k_l + k_h"].percent < 0.05
    assert known["k_h·alpha"].percent < 2
    assert min(abs(100 * e.standard_error / e.value) for e in found.estimates) > 2
    for text, true in (("k_l + k_h", 0.11), ("k_h·alpha", 0.0012)):
        assert abs(known[text].value - true) < 4 * known[text].standard_error
    told = found.to_dict()["combinations"]
    assert {c["text"] for c in told} == set(known)
