"""A piezo stage simulated on its own: it imports nothing from fracjax and shares no form with it.

Hysteresis is a sum of stops (elastoplastic elements) seen through a slightly bent line, creep a
ladder of relaxations spaced so that it goes with the logarithm of time, the mechanism a mass on a
spring integrated as an ODE, and the sensor is noisy.  Everything runs 32 times faster than sampled,
on a drive held between samples as a converter holds it, then smoothed by the amplifier's lag.

Two more laws of hysteresis, `Relays` and `Duhem`, take the stops' place where asked.

The sizes of hysteresis and bend are a real stack's (piezo_dbo): a second harmonic of 1.9 % of the
first at full swing, at a half and a seventh of it a gain of 0.88 and 0.70 (here 0.83 and 0.67), and
a loop that opens less, in shares of its own height, the smaller it is.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import expm

STEP = 4e-3  # s
STROKE = 10.0  # um over 0 to 100 V, less what the stops take of it
NOISE = 3e-3  # um rms
WEIGHT = 0.588  # of the stops: the loop from 0 to 100 V at 1 Hz opens by 19.5 % of its height
_FINE = STEP / 32  # s
_YIELDS = np.geomspace(2.0, 60.0, 24)  # V
_FREQUENT = _YIELDS**0.5
_CREEP = 0.012  # of the stroke per decade of time
_TIMES = np.geomspace(3e-3, 3e2, 16)  # s
_BENT = 0.028  # share of the stroke that a straight line misses in the middle
_FREQUENCY, _DAMPING, _LAG = 180.0, 0.03, 1e-3  # Hz, 1, s


class Stops:
    """A line less stops [V]: each stop follows the drive's changes up to its yield."""

    def __init__(self):
        self.share = WEIGHT * _FREQUENT / np.sum(_FREQUENT)
        self.stops, self.last = np.zeros(_YIELDS.size), 0.0

    def __call__(self, level: float) -> float:
        self.stops = np.clip(self.stops + level - self.last, -_YIELDS, _YIELDS)
        self.last = level
        return level - self.share @ self.stops


class Relays:
    """A line and Preisach's relays [V], up at one threshold and down at another, a bell of both."""

    def __init__(self):
        up, down = np.meshgrid(*2 * [np.linspace(-20.0, 130.0, 90)], indexing="ij")
        self.up, self.down = up[up > down], down[up > down]
        width, centre = (self.up - self.down) / 2, (self.up + self.down) / 2
        share = np.exp(-width / 9.0 - ((centre - 55.0) / 45.0) ** 2)
        self.share = 26.0 * share / share.sum()
        self.state = np.where(self.down >= 0, -1.0, np.where(self.up <= 0, 1.0, -1.0))

    def __call__(self, level: float) -> float:
        self.state[self.up <= level] = 1.0
        self.state[self.down >= level] = -1.0
        return 0.72 * level + self.share @ self.state + self.share.sum()


class Duhem:
    """Coleman and Hodgson's law [V]: dh = a |du| (b u - h) + c du, and a line."""

    def __init__(self):
        self.held, self.last = 0.0, 0.0

    def __call__(self, level: float) -> float:
        for _ in range(2):
            move = (level - self.last) / 2
            at = level - move / 2 - (0 if _ else move)
            self.held += 0.035 * abs(move) * (0.85 * at - self.held) + 0.45 * move
        self.last = level
        return 0.2 * level + self.held


class Stage:
    """The stage, sample by sample: `law` is its hysteresis, `step` [s] its loop's."""

    def __init__(self, law: Callable[[float], float], step: float = STEP):
        self.law, self.finer = law, round(step / _FINE)
        self.forget, self.lagged = np.exp(-_FINE / _LAG), 0.0
        self.move, self.push = _mechanism(_FINE)
        self.state = np.zeros(self.push.size)

    @property
    def reading(self) -> float:
        """What a sensor without noise reads [um]."""
        return float(self.state[-2])

    def __call__(self, drive: float) -> float:
        """The reading [um], and then a step of the loop under a drive [V]."""
        reading = self.reading
        for _ in range(self.finer):
            self.lagged = drive + (self.lagged - drive) * self.forget
            x = self.law(self.lagged) / 100
            force = STROKE * (x + 4 * _BENT * x * (x - 1))
            self.state = self.move @ self.state + self.push * force
        return reading


def measure(
    drive: np.ndarray,
    seed: int,
    rest: float = 4.0,
    law: type = Stops,
    step: float = STEP,
) -> np.ndarray:
    """The sensor's reading (N,) [um] for a drive (N,) [V], after a slow approach and a rest [s]."""
    stage = rested(drive[0], rest, law, step)
    reading = np.array([stage(level) for level in drive])
    return reading + NOISE * np.random.default_rng(seed).standard_normal(drive.size)


def rested(level: float, rest: float = 4.0, law: type = Stops, step: float = STEP) -> Stage:
    """A stage that came slowly from 0 V to a level [V] and has rested there [s]."""
    stage = Stage(law(), step)
    for each in np.append(
        np.linspace(0.0, level, round(1.0 / step)), np.full(round(rest / step), level)
    ):
        stage(each)
    return stage


def _mechanism(step: float) -> tuple[np.ndarray, np.ndarray]:
    """Creep, then a mass on a spring: exact steps of the linear ODE under a held input."""
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
    return whole[:-1, :-1], whole[:-1, -1]
