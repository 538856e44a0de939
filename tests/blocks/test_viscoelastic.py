"""Fractional materials: closed forms in time against the transfer function, and their limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import erfcx, rgamma

from fracjax._blocks import (
    FractionalKelvinVoigt,
    FractionalMaxwell,
    FractionalZener,
    Springpot,
    step_response,
)
from fracjax._blocks.viscoelastic import mittag_leffler

MATERIALS = {
    "springpot": Springpot(2.0, 0.3),
    "maxwell": FractionalMaxwell(2.0, 0.05, 0.4),
    "kelvin_voigt": FractionalKelvinVoigt(2.0, 0.05, 0.4),
    "zener": FractionalZener(1.5, 4.0, 0.05, 0.4),
}


def integral(of) -> float:
    """Over the logarithm of time, by the trapezoidal rule, which converges fast there."""
    nodes = np.linspace(-50, 3, 1500)
    return float(np.trapezoid([of(q) for q in nodes], nodes))


def test_mittag_leffler_is_known_at_one_half():
    x = np.array([0.0, 1e-3, 0.1, 1.0, 5.0, 40.0])
    np.testing.assert_allclose(mittag_leffler(0.5, x), erfcx(x), rtol=1e-8)
    np.testing.assert_allclose(mittag_leffler(1.0, x), np.exp(-x), rtol=1e-12)


@pytest.mark.parametrize("order", [0.15, 0.4, 0.7, 0.95])
def test_mittag_leffler_is_its_power_series_and_its_asymptotic_one(order):
    x, k = np.array([1e-4, 0.1, 0.5, 0.9])[:, None], np.arange(400)
    series = ((-x) ** k * rgamma(1 + order * k)).sum(axis=1)
    np.testing.assert_allclose(mittag_leffler(order, x[:, 0]), series, rtol=0, atol=1e-9)
    x, k = np.array([1e5, 1e7])[:, None], np.arange(1, 4)
    series = (-((-x) ** -k) * rgamma(1 - order * k)).sum(axis=1)
    np.testing.assert_allclose(mittag_leffler(order, x[:, 0]), series, rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", MATERIALS)
def test_a_material_is_ideal_at_an_order_of_one(name):
    """A spring, a damper, or Maxwell's, Kelvin and Voigt's and Zener's solids."""
    modulus, time, t = 2.0, 0.05, np.array([1e-3, 0.03, 0.2])
    fading = np.exp(-t / time)
    slower = np.exp(-t / (time * 4.0 / 1.5))
    material, relaxation, compliance = {
        "springpot": (Springpot(modulus, 0.02), None, None),
        "maxwell": (
            FractionalMaxwell(modulus, time, 1.0), modulus * fading, (1 + t / time) / modulus
        ),
        "kelvin_voigt": (
            FractionalKelvinVoigt(modulus, time, 1.0), modulus + 0 * t, (1 - fading) / modulus
        ),
        "zener": (
            FractionalZener(1.5, 4.0, time, 1.0), 1.5 + 2.5 * fading,
            1 / 1.5 + (1 / 4.0 - 1 / 1.5) * slower,
        ),
    }[name]  # fmt: skip
    if relaxation is None:  # almost a spring
        relaxation, compliance = modulus + 0 * t, 1 / modulus + 0 * t
    rtol = 0.15 if name == "springpot" else 1e-12
    np.testing.assert_allclose(material.relaxation(t), relaxation, rtol=rtol)
    np.testing.assert_allclose(material.compliance(t), compliance, rtol=rtol)


@pytest.mark.parametrize("name", MATERIALS)
def test_the_modulus_transforms_to_the_transfer_function(name):
    """∫ (G(t) - G(∞)) e^(-st) dt + G(∞)/s = G(s)/s at real s, G(∞) the static gain."""
    block, s = MATERIALS[name], 7.0
    limit = float(np.asarray(block.static_gain()))

    def weighted(q: float) -> float:
        return float(block.relaxation([np.exp(q)])[0] - limit) * np.exp(q - s * np.exp(q))

    total = integral(weighted)
    with jax.enable_x64(True):
        wanted = complex(block.symbol(jnp.asarray([s + 0j]))[0]).real / s
    assert total + limit / s == pytest.approx(wanted, rel=1e-5)


@pytest.mark.parametrize("name", MATERIALS)
def test_the_compliance_is_the_inverse(name):
    block, s = MATERIALS[name], 7.0

    def weighted(q: float) -> float:
        return float(block.compliance([np.exp(q)])[0]) * np.exp(q - s * np.exp(q))

    total = integral(weighted)
    with jax.enable_x64(True):
        gain = complex(block.symbol(jnp.asarray([s + 0j]))[0]).real
    assert total == pytest.approx(1 / (s * gain), rel=1e-5)


def test_a_step_of_strain_relaxes_as_the_modulus_says():
    times = np.linspace(0, 1, 401)
    found = step_response(MATERIALS["zener"], times)
    wanted = MATERIALS["zener"].relaxation(times[40:])
    np.testing.assert_allclose(found[40:], wanted, rtol=2e-3)


def test_materials_lead():
    assert all(block.leads for block in MATERIALS.values())
