"""Linear oracles of more than one block."""

import numpy as np
from scipy import signal
from scipy.integrate import solve_ivp

from fracjax._blocks import SecondMode
from fracjax._operators import Grid
from fracjax._operators._grid import History
from tests.helpers import respond

GRID = Grid(1e-3, "constant")
STARTS: tuple[History, ...] = ("rest", "constant")


def smooth(times):
    """A drive that leaves 3 V as t⁶, so that a quadrature shows its full order."""
    return 3 + 5 * np.sin(9 * times) ** 6


def solved(numerator, denominator, times) -> np.ndarray:
    """The law's response to `smooth`, at rest at its first value, by an adaptive solver."""
    a, b, c, d = signal.tf2ss(numerator, denominator)
    excursion = solve_ivp(
        lambda t, state: a @ state + b[:, 0] * (smooth(t) - 3),
        (0, times[-1]),
        np.zeros(len(a)),
        "DOP853",
        times,
        rtol=1e-12,
        atol=1e-12,
    ).y
    gain = numerator[-1] / denominator[-1]
    return gain * 3 + c[0] @ excursion + d[0, 0] * (smooth(times) - 3)


def order_of(block, numerator, denominator, samples: int) -> tuple[float, float]:
    """Largest error against the solver on the finest of three grids, and the order it shows."""
    errors = []
    for steps in (samples, 2 * samples, 4 * samples):
        times = np.linspace(0, 1, steps + 1)
        found = respond(block, smooth(times), Grid(1 / steps, "constant"))
        errors.append(np.abs(found - solved(numerator, denominator, times)).max())
    return errors[-1], float(np.log2(errors[-2] / errors[-1]))


def gains(numerator, denominator, frequencies) -> np.ndarray:
    s = 2j * np.pi * frequencies
    return np.polyval(numerator, s) / np.polyval(denominator, s)


def chain(order: int, corner: float) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator of equal low-passes that together have their corner there."""
    pole = 2 * np.pi * corner / np.sqrt(2 ** (1 / order) - 1)
    denominator = np.poly(np.full(order, -pole))
    return denominator[-1:], denominator


BOTH_SIGNS = [SecondMode(8.0, 1.6, p, 0.05, 0.1) for p in (0.4, -0.3)]
