"""A piezo stage simulated on its own: it imports nothing from fracjax and shares no form with it.

Hysteresis is a sum of stops (elastoplastic elements) seen through a slightly bent line, creep a
ladder of relaxations spaced so that it goes with the logarithm of time, the mechanism a mass on a
spring integrated as an ODE, and the sensor is noisy.  Everything runs 32 times faster than sampled,
on a drive held between samples as a converter holds it, then smoothed by the amplifier's lag.

The sizes of hysteresis and bend are a real stack's (piezo_dbo): a second harmonic of 1.9 % of the
first at full swing, at a half and a seventh of it a gain of 0.88 and 0.70 (here 0.83 and 0.67), and
a loop that opens less, in shares of its own height, the smaller it is.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

STEP = 4e-3  # s
STROKE = 10.0  # um over 0 to 100 V, less what the stops take of it
NOISE = 3e-3  # um rms
WEIGHT = 0.588  # of the stops: the loop from 0 to 100 V at 1 Hz opens by 19.5 % of its height
_FINER = 32
_YIELDS = np.geomspace(2.0, 60.0, 24)  # V
_FREQUENT = _YIELDS**0.5
_CREEP = 0.012  # of the stroke per decade of time
_TIMES = np.geomspace(3e-3, 3e2, 16)  # s
_BENT = 0.028  # share of the stroke that a straight line misses in the middle
_FREQUENCY, _DAMPING, _LAG = 180.0, 0.03, 1e-3  # Hz, 1, s


def _hysteresis(drive: np.ndarray, weight: float) -> np.ndarray:
    """Line less stops (N,) [V]: each stop follows the drive's changes up to its yield."""
    share = weight * _FREQUENT / np.sum(_FREQUENT)
    stops, last, out = np.zeros(_YIELDS.size), 0.0, np.empty(drive.size)
    for n, level in enumerate(drive):
        stops = np.clip(stops + level - last, -_YIELDS, _YIELDS)
        out[n] = level - share @ stops
        last = level
    return out


def measure(drive: np.ndarray, seed: int, rest: float = 4.0) -> np.ndarray:
    """The sensor's reading (N,) [um] for a drive (N,) [V], after a slow approach and a rest [s]."""
    approach = np.linspace(0.0, drive[0], round(1.0 / STEP))
    whole = np.concatenate([approach, np.full(round(rest / STEP), drive[0]), drive])
    fine, lagged = STEP / _FINER, 0.0
    held = np.repeat(whole, _FINER)
    smooth = np.empty(held.size)
    forget = np.exp(-fine / _LAG)
    for n, level in enumerate(held):
        lagged = level + (lagged - level) * forget
        smooth[n] = lagged
    force = _hysteresis(smooth, WEIGHT)
    x = force / 100
    force = STROKE * (x + 4 * _BENT * x * (x - 1))
    return _mechanism(force, fine)[::_FINER][-drive.size :] + NOISE * np.random.default_rng(
        seed
    ).standard_normal(drive.size)


def _mechanism(force: np.ndarray, step: float) -> np.ndarray:
    """Creep, then a mass on a spring (N,): exact steps of the linear ODE under a held input."""
    omega = 2 * np.pi * _FREQUENCY
    size = _TIMES.size
    ratio = np.log10(_TIMES[1] / _TIMES[0])
    a = np.zeros((size + 2, size + 2))
    a[:size, :size] = np.diag(-1 / _TIMES)
    a[size, size + 1] = 1
    a[size + 1, size:] = -(omega**2), -2 * _DAMPING * omega
    a[size + 1, :size] = omega**2 * _CREEP * ratio
    b = np.concatenate([1 / _TIMES, [0, omega**2]])
    whole = expm(np.block([[a, b[:, None]], [np.zeros((1, size + 3))]]) * step)
    move, push = whole[:-1, :-1], whole[:-1, -1]
    state, out = np.zeros(size + 2), np.empty(force.size)
    for n, value in enumerate(force):
        out[n] = state[size]
        state = move @ state + push * value
    return out
