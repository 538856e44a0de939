"""What each effect of dynamics would add to a response, whatever the law of its hysteresis.

The response without them is given, as the curve that was found for it, and its slope by the drive;
an effect on the drive's side acts through that slope.  No model is fitted and nothing is compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from . import _kernels as kernels
from ._fading import path_length

MODE_DAMPINGS = (0.01, 0.03, 0.1)
"""Damping ratios of modes; frequencies are tried half the width of a peak apart."""
_HIGHEST = 0.9
"""The highest frequency of a mode, over Nyquist's."""
_LEAST_PERIODS = 10.0
"""The fewest periods of the slowest mode that the recordings hold: a slower one is a lag."""
_MAINS, _HARMONICS = (50.0, 60.0), 3
"""Frequencies of the mains [Hz], and how many of their harmonics."""
_OFF = 0.002
"""How far the mains' frequency may be from its nominal value, relative: the band of normal
operation of the grids of Europe and of America."""
_SLOWEST_SENSOR = 1.5
"""The largest time constant of a sensor [s], of a corner of .1 Hz: slower is the drive's side."""
_DRIFT, _CREEP, _LAYER, _HUM, _SKEW = 0.02, 0.02, 0.05, 0.002, 1e-4
"""Typical sizes: drifts over the span or the gain, creep per decade, a layer's share, interference
over the span, a clock's error; what a prior calls 1."""


class Motion:
    """One recording's drive (N,) and the response (N,) without effects, with its slope (N,) by the
    drive; of steady cycles `periodic`."""

    def __init__(
        self,
        drive: np.ndarray,
        response: np.ndarray,
        slope: np.ndarray,
        step: float,
        *,
        periodic: bool,
    ):
        self.drive, self.response, self.slope = drive, response, slope
        self.step, self.periodic = step, periodic
        self.times = np.arange(drive.size) * step

    @cached_property
    def of_response(self) -> kernels.Convolution:
        """The response, ready to be convolved."""
        return kernels.Convolution(self.response, self.step, periodic=self.periodic)

    @cached_property
    def of_drive(self) -> kernels.Convolution:
        """The drive, ready to be convolved."""
        return kernels.Convolution(self.drive, self.step, periodic=self.periodic)

    def warming(self, time_constant: float, losses: float) -> np.ndarray:
        """The temperature (N,) by losses |ẋ|^p |x - x0|^(2-p), mean 1 after a long run."""
        rate = np.abs(np.diff(self.response, prepend=self.response[0])) / self.step
        size = np.abs(self.response - self.response[0])
        power = rate**losses * size ** (2 - losses)
        kept = np.exp(-self.step / time_constant)
        return lfilter([1 - kept], [1, -kept], power / max(power.mean(), 1e-300))


class Columns(NamedTuple):
    """One shape of an effect.

    Attributes:
        effect: its name in the catalogue.
        shape: the parameters of the shape, by name, in s and Hz.
        values: (ΣN, k), in the response's unit, for the typical size.
        one_sided: whether its coefficient cannot be negative.
    """

    effect: str
    shape: dict[str, float]
    values: np.ndarray
    one_sided: bool


def dynamics_of(motions: Sequence[Motion]) -> list[Columns]:
    """The shapes of all effects but modes, whose frequencies are scanned (`modes_of`)."""
    step = min(m.step for m in motions)
    duration = max(m.times[-1] for m in motions)
    span = max(np.ptp(m.response) for m in motions)
    strokes = max(float(path_length(m.drive)[-1]) for m in motions)
    groups: list[Columns] = []

    def add(
        effect: str, column: Callable[[Motion], np.ndarray], one_sided: bool = False, **shape: float
    ) -> None:
        values = np.concatenate([column(m).reshape(m.times.size, -1) for m in motions])
        groups.append(Columns(effect, shape, values, one_sided))

    for onset in np.geomspace(max(step, 1e-4 * duration), 0.1 * duration, 5):
        add("creep", _linear(kernels.creep(onset), _CREEP), True, onset=onset)
    for constant in _constants(step, duration):
        one, dead = kernels.lag(constant), kernels.delay(constant)
        if constant < _SLOWEST_SENSOR:
            add("sensor_lag", _linear(one), True, corner=1 / (2 * np.pi * constant))
        add("drive_lag", _before(one), True, time_constant=constant)
        if constant < 30 * step:
            add("delay", _linear(dead), True, delay=constant)
    for order in (0.15, 0.35, 0.7):
        for constant in np.geomspace(step, duration, 4):
            layer = kernels.yielding(constant, order)
            add("viscoelastic_layer", _linear(layer, _LAYER), time_constant=constant, order=order)
    for share in (0.1, 0.3, 1.0):
        constant = share * duration
        add("thermal_drift", _drifting(constant, duration, _DRIFT * span), time_constant=constant)
        for losses in (1.0, 2.0):
            add("gain_drift", _warmed(constant, losses), time_constant=constant, losses=losses)
        add("degradation", _worn(share), path=share * strokes)
    for low in _MAINS:
        if 2 * low * step < 1:
            ends = low * np.array([1 - _OFF, 1 + _OFF])
            for f in np.linspace(*ends, 1 + 2 * int(4 * _OFF * low * duration)):
                add("mains_interference", _humming(f, _HUM * span), frequency=f)
    for quantile in (0.97, 0.9, 0.8, 0.65, 0.5):
        rate = max(float(np.quantile(np.abs(np.diff(m.drive)), 1.0)) for m in motions) * quantile
        add("slew_rate_limit", _limited(rate), True, rate=rate / step)
    add("clock_skew", _skewed)
    return groups


def modes_of(motions: Sequence[Motion]) -> Iterator[list[Columns]]:
    """Modes at frequencies that are half the width of a peak apart, the list of each damping."""
    step = min(m.step for m in motions)
    lowest = _LEAST_PERIODS / max(m.times[-1] for m in motions)
    highest = 0.5 * _HIGHEST / step
    for damping in MODE_DAMPINGS:
        count = 1 + int(np.log(highest / lowest) / damping)
        yield [
            Columns(
                "resonance",
                {"frequency": float(f), "damping": damping},
                np.concatenate([_linear(kernels.mode(f, damping))(m) for m in motions])[:, None],
                True,
            )
            for f in np.geomspace(lowest, highest, count)
        ]


def _constants(step: float, duration: float) -> np.ndarray:
    """Time constants of lags [s], four a decade, from a tenth of a step to a third of the longest
    recording."""
    ends = 0.1 * step, duration / 3
    return np.geomspace(*ends, 1 + int(4 * np.log10(ends[1] / ends[0])))


def _linear(integral: kernels.Departure, size: float = 1.0) -> Callable[[Motion], np.ndarray]:
    """A linear effect on the response's side."""
    return lambda m: size * m.of_response.with_departure(integral)


def _before(integral: kernels.Departure) -> Callable[[Motion], np.ndarray]:
    """A linear effect on the drive's side, through the slope."""
    return lambda m: m.slope * m.of_drive.with_departure(integral)


def _drifting(constant: float, duration: float, size: float) -> Callable[[Motion], np.ndarray]:
    """A drift: a line and an exponential of time."""
    return lambda m: size * np.stack([m.times / duration, 1 - np.exp(-m.times / constant)], axis=1)


def _warmed(constant: float, losses: float) -> Callable[[Motion], np.ndarray]:
    """A gain that changes with the warmth of the losses, and the unknown zero times it."""

    def column(m: Motion) -> np.ndarray:
        warmth, span = m.warming(constant, losses), np.ptp(m.response)
        moved = m.response - m.response[0]
        return _DRIFT * np.stack([moved * warmth, span * warmth], axis=1)

    return column


def _worn(share: float) -> Callable[[Motion], np.ndarray]:
    """A gain that changes with the path travelled, and the unknown zero times it."""

    def column(m: Motion) -> np.ndarray:
        path = path_length(m.drive)
        wear, span = -np.expm1(-path / (share * path[-1])), np.ptp(m.response)
        return _DRIFT * np.stack([(m.response - m.response[0]) * wear, span * wear], axis=1)

    return column


def _humming(low: float, size: float) -> Callable[[Motion], np.ndarray]:
    """Lines of the mains below Nyquist's frequency."""

    def column(m: Motion) -> np.ndarray:
        orders = [k for k in range(1, _HARMONICS + 1) if 2 * k * low * m.step < 1]
        angles = 2 * np.pi * low * np.outer(m.times, orders)
        return size * np.concatenate([np.cos(angles), np.sin(angles)], axis=1)

    return column


def _limited(rate: float) -> Callable[[Motion], np.ndarray]:
    """A drive whose rate is limited [drive unit per step], through the slope."""

    def column(m: Motion) -> np.ndarray:
        limited = m.drive.copy()
        over = np.flatnonzero(np.abs(np.diff(m.drive)) > rate)
        last = -1
        for k in over.tolist():
            # From a step that is too fast on, until the drive is caught up.
            k = max(k, last)
            while k + 1 < limited.size:
                gap = m.drive[k + 1] - limited[k]
                limited[k + 1] = limited[k] + np.clip(gap, -rate, rate)
                k += 1
                if limited[k] == m.drive[k]:
                    break
            last = k
        return m.slope * (limited - m.drive)

    return column


def _skewed(m: Motion) -> np.ndarray:
    """A clock that runs too fast: a delay that grows in time."""
    return _SKEW * m.times * np.gradient(m.response, m.step)
