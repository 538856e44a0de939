"""What linear dynamics add to a signal, against closed forms and SciPy."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import lsim

from fracjax._path import _kernels as kernels
from fracjax._path._drive import unresolved

STEP = 2e-3
TIMES = STEP * np.arange(600)
SIGNAL = np.interp(TIMES, [0, 0.1, 0.3, 0.5, 0.8, 1.2], [2.0, 2.0, 5.0, 1.0, 1.0, 3.0])
FINE = STEP / 50 * np.arange(50 * 600)


def smooth(t: np.ndarray) -> np.ndarray:
    """A signal that starts at rest and is resolved by its samples."""
    return 2.0 + (1 - np.exp(-((t / 0.1) ** 2))) * (np.sin(23 * t) + 0.3 * np.cos(71 * t))


def added(integral, signal=SIGNAL, *, periodic=False):
    return kernels.Convolution(signal, STEP, periodic=periodic).with_departure(integral)


LAG = ([1.0], [0.03, 1.0])
MODE = ([(80 * np.pi) ** 2], [1.0, 2 * 0.05 * 80 * np.pi, (80 * np.pi) ** 2])


@pytest.mark.parametrize(
    ("departure", "system"),
    [
        (kernels.lag(0.03, STEP), LAG),
        (kernels.lag(2e-4, STEP), ([1.0], [2e-4, 1.0])),
        (kernels.lag(0.01, STEP, 4), ([1.0], np.poly([-100.0] * 4) / 1e8)),
        (kernels.mode(40.0, 0.05, STEP), MODE),
        (
            kernels.shared(kernels.lag(0.03, STEP), kernels.mode(40.0, 0.05, STEP), 0.3),
            (
                np.polyadd(0.7 * np.array(MODE[1]), 0.3 * MODE[0][0] * np.array(LAG[1])),
                np.polymul(LAG[1], MODE[1]),
            ),
        ),
    ],
)
def test_a_recursion_is_the_system_between_the_samples_too(departure, system):
    exact = 2.0 + lsim(system, smooth(FINE) - 2.0, FINE, interp=True)[1][::50]
    signal = smooth(TIMES)
    error = np.abs(signal + added(departure, signal) - exact)[:-1].max()
    # A line between the samples would be wrong by (71 h)²/8 of the faster tone.
    assert error < 0.1 * 0.3 * (STEP * 71) ** 2 / 8


def test_a_corner_between_samples_moves_a_lag_by_as_much_as_is_said_not_to_be_known():
    """Over all places of a corner the error is of the size that `unresolved` states."""
    lag, errors, stated = ([1.0], [0.05, 1.0]), [], []
    for place in np.linspace(0, 1, 21):
        corner = (300 + place) * STEP
        exact = lsim(lag, np.maximum(FINE - corner, 0), FINE, interp=True)[1][::50]
        drive = np.maximum(TIMES - corner, 0)
        error = drive + added(kernels.lag(0.05, STEP), drive) - exact
        # An area of the drive that is not known decays behind the lag as e^(-t/τ).
        errors.append(error[310] * 0.05 / STEP * np.exp(10 * STEP / 0.05))
        stated.append(unresolved(drive).max())
    assert 0.3 < np.sqrt(np.mean(np.square(errors))) / np.mean(stated) < 1.3


def test_a_delay_shifts():
    late = np.concatenate([np.full(7, SIGNAL[0]), SIGNAL[:-7]])
    np.testing.assert_allclose(SIGNAL + added(kernels.delay(7 * STEP)), late, atol=1e-12)
    half = 0.5 * (SIGNAL + np.concatenate([SIGNAL[:1], SIGNAL[:-1]]))
    np.testing.assert_allclose(SIGNAL + added(kernels.delay(STEP / 2)), half, atol=1e-12)


@pytest.mark.parametrize(
    ("integral", "departure", "accuracy"),
    [
        (kernels.creep(0.01), lambda t: np.log10(1 + t / 0.01), 1e-10),
        (kernels.yielding(0.02, 0.4), lambda t: -1 / (1 + (t / 0.02) ** 0.4), 1e-3),
        (kernels.yielding(0.5, 0.15), lambda t: -1 / (1 + (t / 0.5) ** 0.15), 1e-3),
    ],
)
def test_an_integral_is_that_of_its_departure(integral, departure, accuracy):
    for end in (STEP, 0.1, 1.0):
        grid = np.array([0.0, STEP, end])
        exact = quad(departure, 0.0, end, epsabs=1e-12, limit=200)[0]
        assert integral(grid)[-1] == pytest.approx(exact, rel=accuracy)


@pytest.mark.parametrize("integral", [kernels.lag(0.2, STEP), kernels.mode(7.0, 0.1, STEP)])
def test_steady_cycles_are_the_end_of_many_passes(integral):
    cycle = np.sin(2 * np.pi * np.arange(500) / 500) + 0.3 * np.cos(
        8 * np.pi * np.arange(500) / 500
    )
    many = added(integral, np.tile(cycle, 12))[-500:]
    np.testing.assert_allclose(added(integral, cycle, periodic=True), many, atol=1e-3)


def test_a_constant_signal_gains_nothing():
    assert np.abs(added(kernels.creep(0.01), np.full(50, 3.0))).max() < 1e-12
