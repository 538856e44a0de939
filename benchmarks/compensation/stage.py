"""A piezo stage simulated on its own: it imports nothing from fracjax and shares no form with it.

Hysteresis is a sum of stops (elastoplastic elements) seen through a slightly bent line, creep a
ladder of relaxations spaced so that it goes with the logarithm of time, the mechanism a mass on a
spring integrated as an ODE, and the sensor is noisy.  Everything runs 32 times faster than sampled,
on a drive held between samples as a converter holds it, then smoothed by the amplifier's lag.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

STEP = 4e-3  # s
STROKE = 10.0  # um over 0 to 100 V
NOISE = 3e-3  # um rms
OPENING = 0.195
_FINER = 32
_YIELDS = np.geomspace(2.0, 60.0, 24)  # V
_CREEP = 0.012  # of the stroke per decade of time
_TIMES = np.geomspace(3e-3, 3e2, 16)  # s
_BENT = 0.04  # share of the stroke that a straight line misses in the middle
_FREQUENCY, _DAMPING, _LAG = 180.0, 0.03, 1e-3  # Hz, 1, s


def _softness() -> float:
    """The stops' weight at which the major loop opens by OPENING of its span."""
    drive = np.concatenate([np.linspace(0, 100, 400), np.linspace(100, 0, 400)] * 2)

    def opening(weight: float) -> float:
        loop = _hysteresis(drive, weight)[800:]
        up, down = loop[:400], loop[400:][::-1]
        return float(np.abs(down - up).max() / np.ptp(loop))

    low, high = 0.0, 1.0
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if opening(middle) < OPENING else (low, middle)
    return low


def _hysteresis(drive: np.ndarray, weight: float) -> np.ndarray:
    """Line less stops (N,) [V]: each stop follows the drive's changes up to its yield."""
    share = weight * _YIELDS**-0.4 / np.sum(_YIELDS**-0.4)
    stops, last, out = np.zeros(_YIELDS.size), 0.0, np.empty(drive.size)
    for n, level in enumerate(drive):
        stops = np.clip(stops + level - last, -_YIELDS, _YIELDS)
        out[n] = level - share @ stops
        last = level
    return out


WEIGHT = _softness()


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
