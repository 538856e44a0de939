"""Drive voltages as continuous functions of time, so that any grid can evaluate them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]
Signal = Callable[[Array], Array]
Piece = tuple[float, Signal]  # duration in s, volts as a function of the time within the piece
RATE = 500.0


@dataclass(frozen=True)
class Drive:
    """A voltage u(t) in V on [0, duration] s; held constant before and after.

    `rests` are stretches (start, end) in s at constant voltage; `period` in s is set when the
    whole drive is an exact repetition with that period. `margin` is how far (s) the signal goes on
    past its end, for a clock that runs ahead.
    """

    name: str
    signal: Signal
    duration: float
    rate: float = RATE
    rests: tuple[tuple[float, float], ...] = ()
    period: float | None = None
    margin: float = 0.0

    def __call__(self, t: Array) -> Array:
        return self.signal(np.clip(t, 0.0, self.duration + self.margin))

    @property
    def times(self) -> Array:
        """Sampling instants in s."""
        return np.arange(round(self.duration * self.rate)) / self.rate

    def between(self, how: str) -> Signal:
        """What the actuator receives between samples, constant outside the record.

        linear: straight lines through the recorded voltages (known exactly from the recording);
        cubic: a cubic spline through them; continuous: u(t) itself (samples do not determine it).
        """
        t = self.times
        if how == "linear":
            return lambda x: np.interp(x, t, self(t))
        if how == "cubic":
            spline = CubicSpline(t, self(t))
            return lambda x: spline(np.clip(x, t[0], t[-1]))
        if how == "continuous":
            return self
        raise ValueError(f"between samples is linear, cubic or continuous, not {how!r}")


def rest(duration: float, volts: float) -> Piece:
    """Constant voltage: u = volts."""
    return duration, lambda t: np.full_like(t, volts)


def burst(
    frequency: float, cycles: int, amplitude: float, bias: float, soft: float = 0.25
) -> Piece:
    """Sine burst: u = bias + amplitude * w(t) * sin(2 pi f t), w raised-cosine over `soft` T."""
    length = cycles / frequency

    def signal(t: Array) -> Array:
        x = np.minimum(t, length - t) / (soft * length)
        w = np.sin(0.5 * np.pi * np.clip(x, 0.0, 1.0)) ** 2
        return bias + amplitude * w * np.sin(2 * np.pi * frequency * t)

    return length, signal


def line(duration: float, start: float, end: float) -> Piece:
    """Straight ramp: u = start + (end - start) t / duration."""
    return duration, lambda t: start + (end - start) * t / duration


def edge(duration: float, start: float, end: float, rise: float = 0.03) -> Piece:
    """Step smoothed over `rise` s by x^3 (10 - 15 x + 6 x^2), then held.

    The rise spans 15 samples at 500 Hz: with 5 ms the samples would not determine the drive, and
    reconstructing it would leave 0.9 (cubic) to 1.4 (linear) noise sd on a record without effect.
    """

    def signal(t: Array) -> Array:
        x = np.clip(t / rise, 0.0, 1.0)
        return start + (end - start) * x**3 * (10 - 15 * x + 6 * x * x)

    return duration, signal


def stairs(levels: Sequence[float], holds: Sequence[float], rise: float = 0.03) -> list[Piece]:
    """Staircase from levels[0] through levels[1:], each held for the given time in s."""
    return [edge(h, a, b, rise) for a, b, h in zip(levels[:-1], levels[1:], holds, strict=True)]


def compose(name: str, pieces: Sequence[Piece], repeats: int = 1, rate: float = RATE) -> Drive:
    """Join pieces in time and repeat the whole exactly `repeats` times."""
    ends = np.cumsum([d for d, _ in pieces])
    starts = ends - np.array([d for d, _ in pieces])
    period = float(ends[-1])

    def signal(t: Array) -> Array:
        local = np.where(t < period * repeats, t % period, period) if repeats > 1 else t
        local = np.where(np.abs(local - period) < 1e-9, period, local)
        which = np.minimum(np.searchsorted(ends, local + 1e-12, side="right"), len(pieces) - 1)
        out = np.empty_like(local)
        for k, (_, f) in enumerate(pieces):
            here = which == k
            out[here] = f(local[here] - starts[k])
        return out

    flat = [k for k, (d, f) in enumerate(pieces) if np.ptp(f(np.linspace(0, d, 99))) == 0]
    rests = tuple(
        (round(float(starts[k] + r * period), 6), round(float(ends[k] + r * period), 6))
        for r in range(repeats)
        for k in flat
    )
    return Drive(name, signal, period * repeats, rate, rests, period if repeats > 1 else None)


def sine(seed: int = 0, rate: float = RATE) -> Drive:
    """Steady 1 Hz, 14 cycles, 10 to 90 V, starting at the bias of 50 V."""
    whole = (1.0, lambda t: 50 + 40 * np.sin(2 * np.pi * t))
    return compose("sine", [whole], 14, rate)


def triangle(seed: int = 0, rate: float = RATE) -> Drive:
    """Triangle, 1 Hz, 14 cycles, -30 to 90 V, from the lowest voltage."""
    return compose("triangle", [line(0.5, -30, 90), line(0.5, 90, -30)], 14, rate)


def ladder(seed: int = 0, rate: float = RATE) -> Drive:
    """Sine bursts at 2 Hz about 45 V, amplitudes 5..45 V up and down, with rests of 1 s."""
    up = [5, 10, 15, 25, 35, 45, 35, 25, 15, 10, 5]
    bursts_ = [burst(2.0, 2, a, 45, 0.15) for a in up]
    return compose("ladder", [rest(1.5, 45), *bursts_, rest(1.5, 45)], 1, rate)


def _tones(frequencies: Sequence[float], bias: float, peak: float) -> list[Piece]:
    cycles = [max(2, round(0.6 * f)) for f in frequencies]
    return [
        burst(f, c, peak / (1 + f / 15), bias) for f, c in zip(frequencies, cycles, strict=True)
    ]


def bursts(seed: int = 0, rate: float = RATE) -> Drive:
    """Sine bursts at 0.5..40 Hz, soft envelopes, bias 50 V then 40 V; rests start/middle/end."""
    low, high = _tones([0.5, 1, 2, 4], 50, 45), _tones([7, 12, 20, 28, 40], 40, 40)
    pieces = [rest(1.5, 50), *low, edge(0.1, 50, 40), rest(1.4, 40), *high, rest(1.7, 40)]
    return compose("bursts", pieces, 1, rate)


def steps(seed: int = 0, rate: float = RATE) -> Drive:
    """Staircase both ways, 5 to 95 V, holds of 0.1 to 3 s, 30 ms edges, rests at both ends."""
    levels = [5, 35, 65, 95, 55, 75, 25, 5, 85, 45, 15, 5]
    holds = [1.0, 0.3, 2.0, 0.5, 0.1, 1.5, 1.0, 3.0, 0.2, 1.2, 2.2]
    return compose("steps", [rest(1.0, 5), *stairs(levels, holds), rest(1.5, 5)], 1, rate)


def multisine(seed: int = 0, rate: float = RATE) -> Drive:
    """Random-phase multisine, 2 s period x 7, lines at 0.5..39.5 Hz, peak 45 V about 30 V.

    Line amplitudes fall as 1/(1 + f/5 Hz); all odd multiples of 0.5 Hz, so none is at 50/60 Hz.
    """
    f = np.arange(1, 80, 2) * 0.5
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, f.size)

    def raw(t: Array) -> Array:
        return sum(
            np.sin(2 * np.pi * fk * t + pk) / (1 + fk / 5) for fk, pk in zip(f, phase, strict=True)
        )

    peak = np.max(np.abs(raw(np.arange(0, 2, 1e-3))))
    return compose("multisine", [(2.0, lambda t: 30 + 45 / peak * raw(t))], 7, rate)


def reversal_curves(seed: int = 0, rate: float = RATE) -> Drive:
    """First-order reversal curves at 100 V/s from 100 V down to 80, 60, 40, 20, 0 V; twice."""
    once = [
        p
        for v in (80, 60, 40, 20, 0)
        for p in (line(1 - v / 100, 100, v), line(1 - v / 100, v, 100))
    ]
    return compose("reversal_curves", [rest(1.0, 100), *once], 2, rate)


def decaying(seed: int = 0, rate: float = RATE) -> Drive:
    """1.5 Hz sine about 20 V, envelope 60 V exp((|t - 6 s| - 6 s)/2.5 s): decays, then grows."""

    def signal(t: Array) -> Array:
        return 20 + 60 * np.exp((np.abs(t - 6) - 6) / 2.5) * np.sin(3 * np.pi * t)

    return compose("decaying", [(12.0, signal), rest(1.5, 20)], 1, rate)


def rich(seed: int = 0, rate: float = RATE) -> Drive:
    """Ladder + bursts + staircase + rest, repeated exactly three times (5.2 s period)."""
    steps_ = [burst(2.0, 1, a, 40, 0.1) for a in (15, 40, 25)]
    tones = _tones([8, 20, 40], 40, 35)
    stairs_ = stairs([40, 60, 90, 20, 5, 40], [0.2, 0.5, 0.5, 0.3, 0.2])
    used = sum(d for d, _ in [*steps_, *tones, *stairs_])
    return compose("rich", [*steps_, *tones, *stairs_, rest(5.2 - used, 40)], 3, rate)


def zero_drive(seed: int = 0, rate: float = RATE) -> Drive:
    """0 V for 6 s, then two 1 Hz bursts and a pulse (0 to 80 V), then 0 V for 4 s."""
    pieces = [
        rest(6.0, 0),
        edge(0.5, 0, 40),
        burst(1.0, 2, 40, 40),
        burst(8.0, 8, 25, 40),
        edge(0.5, 40, 0),
        rest(4.0, 0),
    ]
    return compose("zero_drive", pieces, 1, rate)


DRIVES: dict[str, Callable[..., Drive]] = {
    f.__name__: f
    for f in (
        sine, triangle, ladder, bursts, steps, multisine, reversal_curves, decaying, rich,
        zero_drive,
    )
}  # fmt: skip
