"""Two modes: rational function, differential equation, notch."""

import numpy as np
import pytest

from fracjax._blocks import Resonance, SecondMode, SensorLag, frequency_response, poles
from fracjax._operators import Grid
from fracjax._parameters import named_parameters
from tests.blocks.linear import BOTH_SIGNS, GRID, gains, order_of, smooth
from tests.helpers import respond


def rational(block: SecondMode) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator of the sum of the two modes, by polynomials."""
    v = {name: float(p.value) for name, p in named_parameters(block).items()}
    omega = 2 * np.pi * v["frequency"] * np.array([1, v["ratio"]])
    zeta = np.array([v["damping"], v["second_damping"]])
    first, second = ([1 / w**2, 2 * z / w, 1] for w, z in zip(omega, zeta, strict=True))
    share = v["participation"]
    numerator = np.polyadd(np.multiply(1 - share, second), np.multiply(share, first))
    return numerator, np.polymul(first, second)


@pytest.mark.parametrize("block", BOTH_SIGNS)
def test_second_mode_is_its_rational_function(block):
    numerator, denominator = rational(block)
    frequencies = np.geomspace(0.1, 100, 60)
    wanted = gains(numerator, denominator, frequencies)
    found = frequency_response(block, frequencies)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)
    roots = np.sort_complex(np.roots(denominator))
    np.testing.assert_allclose(np.sort_complex(poles(block)), roots, rtol=1e-9)


@pytest.mark.parametrize("block", BOTH_SIGNS)
def test_second_mode_is_its_differential_equation_to_third_order(block):
    numerator, denominator = rational(block)
    error, shown = order_of(block, numerator, denominator, 2000)
    assert error < 4e-6
    assert shown == pytest.approx(3, abs=0.2)


def test_the_notch_lies_where_the_modes_cancel():
    """(1-p)/(1 - f²/f_1²) + p/(1 - f²/f_2²) = 0: between the peaks, beyond both, or nowhere."""
    for share in (0.3, 0.8, -0.2):
        block = SecondMode(100.0, 2.0, share, 1e-3, 1e-3)
        notch = 100 / np.sqrt(share + (1 - share) / 4)
        assert (100 < notch < 200) if share > 0 else notch > 200
        depth, beside = np.abs(frequency_response(block, [notch, 1.2 * notch]))
        assert depth < 0.03 * beside
    none = np.abs(frequency_response(SecondMode(100.0, 2.0, -0.5), np.linspace(1, 1000, 2000)))
    slope = np.diff(np.log(none))
    assert np.count_nonzero((slope[:-1] < 0) & (slope[1:] >= 0)) == 1  # only between the peaks
    assert none[100:400].min() > 0.3


def test_second_mode_without_participation_is_one_mode():
    drive = smooth(np.arange(500) * 1e-3)
    alone = SecondMode(30.0, 2.5, 0.0, 0.04)
    np.testing.assert_allclose(
        respond(alone, drive, GRID), respond(Resonance(30.0, 0.04), drive, GRID), 1e-12
    )
    beyond = SecondMode(30.0, 100.0, 0.2, 0.04, 0.7)
    wanted = 0.8 * respond(Resonance(30.0, 0.04), drive, GRID) + 0.2 * drive
    np.testing.assert_allclose(respond(beyond, drive, GRID), wanted, atol=2e-2)


@pytest.mark.parametrize("block", [SensorLag(9.0), *BOTH_SIGNS])
def test_steady_periods_have_the_gain_of_each_harmonic(block):
    times = np.arange(400) / 400
    for harmonic in (2, 11):
        gain = frequency_response(block, harmonic)[0]
        found = respond(block, 1 + np.cos(2 * np.pi * harmonic * times), Grid(1 / 400, "periodic"))
        wanted = 1 + np.real(gain * np.exp(2j * np.pi * harmonic * times))
        np.testing.assert_allclose(found, wanted, atol=1e-10)
