"""What linear dynamics add to a signal, against closed forms and SciPy."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import lsim

from fracjax._path import _kernels as kernels

STEP = 2e-3
TIMES = STEP * np.arange(600)
SIGNAL = np.interp(TIMES, [0, 0.1, 0.3, 0.5, 0.8, 1.2], [2.0, 2.0, 5.0, 1.0, 1.0, 3.0])


def added(integral, signal=SIGNAL, *, periodic=False):
    return kernels.Convolution(signal, STEP, periodic=periodic).with_departure(integral)


@pytest.mark.parametrize(
    ("integral", "system"),
    [
        (kernels.lag(0.03), ([1.0], [0.03, 1.0])),
        (kernels.lag(2e-4), ([1.0], [2e-4, 1.0])),
        (
            kernels.mode(40.0, 0.05),
            ([(80 * np.pi) ** 2], [1.0, 2 * 0.05 * 80 * np.pi, (80 * np.pi) ** 2]),
        ),
    ],
)
def test_a_lag_and_a_mode_are_those_of_a_triangle_hold(integral, system):
    # Between samples a signal is a line, as SciPy's linear interpolation has it.
    exact = SIGNAL[0] + lsim(system, SIGNAL - SIGNAL[0], TIMES, interp=True)[1]
    np.testing.assert_allclose(SIGNAL + added(integral), exact, atol=1e-9)


def test_a_delay_shifts():
    late = np.concatenate([np.full(7, SIGNAL[0]), SIGNAL[:-7]])
    np.testing.assert_allclose(SIGNAL + added(kernels.delay(7 * STEP)), late, atol=1e-12)
    half = 0.5 * (SIGNAL + np.concatenate([SIGNAL[:1], SIGNAL[:-1]]))
    np.testing.assert_allclose(SIGNAL + added(kernels.delay(STEP / 2)), half, atol=1e-12)


@pytest.mark.parametrize(
    ("integral", "departure", "accuracy"),
    [
        (kernels.creep(0.01), lambda t: np.log10(1 + t / 0.01), 1e-10),
        (kernels.second_lag(0.05), lambda t: -(1 + t / 0.05) * np.exp(-t / 0.05), 1e-10),
        (kernels.yielding(0.02, 0.4), lambda t: -1 / (1 + (t / 0.02) ** 0.4), 1e-3),
        (kernels.yielding(0.5, 0.15), lambda t: -1 / (1 + (t / 0.5) ** 0.15), 1e-3),
    ],
)
def test_an_integral_is_that_of_its_departure(integral, departure, accuracy):
    for end in (STEP, 0.1, 1.0):
        grid = np.array([0.0, STEP, end])
        exact = quad(departure, 0.0, end, epsabs=1e-12, limit=200)[0]
        assert integral(grid)[-1] == pytest.approx(exact, rel=accuracy)


@pytest.mark.parametrize("integral", [kernels.lag(0.2), kernels.mode(7.0, 0.1)])
def test_steady_cycles_are_the_end_of_many_passes(integral):
    cycle = np.sin(2 * np.pi * np.arange(500) / 500) + 0.3 * np.cos(
        8 * np.pi * np.arange(500) / 500
    )
    many = added(integral, np.tile(cycle, 12))[-500:]
    np.testing.assert_allclose(added(integral, cycle, periodic=True), many, atol=1e-3)


def test_a_constant_signal_gains_nothing():
    assert np.abs(added(kernels.creep(0.01), np.full(50, 3.0))).max() < 1e-12
