"""The lag of a sensor, and its filters, beside SciPy."""

from typing import Any

import jax
import numpy as np
import pytest
from scipy import signal
from scipy.optimize import brentq, least_squares
from scipy.special import gammainc

from fracjax._blocks import DriveLag, SensorFilter, SensorLag, frequency_response, step_response
from tests.blocks.linear import GRID, chain, gains, order_of, smooth
from tests.helpers import respond


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_sensor_lag_is_a_chain_of_low_passes(order):
    block = SensorLag(40.0, order)
    numerator, denominator = chain(order, 40.0)
    frequencies = np.geomspace(0.1, 4000, 50)
    wanted = gains(numerator, denominator, frequencies)
    np.testing.assert_allclose(frequency_response(block, frequencies), wanted, rtol=1e-10)
    assert abs(frequency_response(block, 40.0)[0]) == pytest.approx(1 / np.sqrt(2), rel=1e-12)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_sensor_lag_is_its_differential_equation_to_fourth_order(order):
    numerator, denominator = chain(order, 6.0)
    error, shown = order_of(SensorLag(6.0, order), numerator, denominator, 500)
    assert error < 1e-7
    assert shown == pytest.approx(4, abs=0.2)


@pytest.mark.parametrize(("order", "damping"), [(2, 0.8660254037844386), (2, 0.5**0.5), (4, 1.0)])
def test_a_sensor_filter_is_bessels_butterworths_or_a_chain(order, damping):
    block = SensorFilter(40.0, order, damping)
    pair = np.array([1, 2 * damping, 1.0])
    pole = float(block.frequency)
    denominator = np.array([1.0])
    for _ in range(order // 2):
        denominator = np.polymul(denominator, pair * [1 / pole**2, 1 / pole, 1.0])
    frequencies = np.geomspace(0.1, 4000, 50)
    wanted = gains(np.ones(1), denominator, frequencies)
    np.testing.assert_allclose(frequency_response(block, frequencies), wanted, rtol=1e-10)
    assert abs(frequency_response(block, 40.0)[0]) == pytest.approx(1 / np.sqrt(2), rel=1e-12)


ANALOG: dict[str, Any] = {
    "bessel": lambda order: signal.bessel(order, 100.0, analog=True),
    "butter": lambda order: signal.butter(order, 100.0, analog=True),
}


@pytest.mark.parametrize(
    ("design", "order", "limit"),
    [("bessel", 3, 1e-4), ("bessel", 4, 8e-4), ("butter", 3, 1e-3), ("butter", 4, 6e-3)],
)
def test_a_sensor_filter_comes_close_to_those_of_unlike_pairs(design, order, limit):
    numerator, denominator = ANALOG[design](order)
    frequencies = np.geomspace(0.1, 0.5 * corner_of(numerator, denominator), 200)
    wanted = gains(numerator, denominator, frequencies)

    def miss(numbers: np.ndarray) -> np.ndarray:
        block = SensorFilter(numbers[0], numbers[1], numbers[2])
        change = frequency_response(block, frequencies) - wanted
        return np.concatenate([np.real(change), np.imag(change)])

    bounds = ([5.0, 1.01, 0.66], [50.0, 3.999, 0.99])
    found = least_squares(miss, [16.0, 3.0, 0.8], bounds=bounds, x_scale=[10, 1, 0.1])
    assert np.sqrt(2 * found.cost / frequencies.size) < limit


def corner_of(numerator, denominator) -> float:
    """Where the gain is 1/√2, in Hz."""
    root: Any = brentq(lambda f: np.abs(gains(numerator, denominator, f)) - np.sqrt(0.5), 0.1, 100)
    return root


@pytest.mark.parametrize("order", [1.3, 2.0, 3.6])
def test_a_step_through_a_sensor_of_any_order_is_a_gamma_distribution(order):
    block = SensorLag(5.0, order)
    times = np.arange(2001) * 1e-4
    with jax.enable_x64(True):
        wanted = gammainc(order, times / float(block.time_constant))
    found = step_response(block, times)
    assert np.abs(found - wanted)[10:].max() < 2e-3
    assert np.abs(found - wanted)[200:].max() < 1e-5


def test_a_sensor_of_first_order_is_a_lag_of_the_drive():
    drive = smooth(np.arange(500) * 1e-3)
    wanted = respond(DriveLag(1 / (2 * np.pi * 7)), drive, GRID)
    np.testing.assert_allclose(respond(SensorLag(7.0, 1.0), drive, GRID), wanted, rtol=1e-12)
