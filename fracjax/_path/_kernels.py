r"""What linear dynamics add to a signal: its increments, convolved with a departure g(t).

A linear effect of static gain 1 answers a step by 1 + g(t): creep by log10(1 + t/t0), a lag by
-e^(-t/τ), a delay by -1 for t < τ, a mode by its ringing.  Between its samples a signal is a line,
so that each increment is spread evenly over its step h and the kernel is the mean of g over it,
exact for such a signal; of a departure with one pole it is a geometric series.

Source: Franklin, Powell & Workman, Digital Control of Dynamic Systems (1998), 6.3 (triangle hold).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import lfilter

Integral = Callable[[np.ndarray], np.ndarray]
"""∫_0^t g dt' [s] of a departure g (dimensionless), for times t ≥ 0 [s]."""


def creep(onset: float) -> Integral:
    """One decade's creep, g = log10(1 + t/t0), from its onset t0 [s]."""

    def integral(t: np.ndarray) -> np.ndarray:
        z = t / onset
        return onset * ((1 + z) * np.log1p(z) - z) / np.log(10)

    return integral


class Pole(NamedTuple):
    """A departure with one pole, g = -Re(share · e^(rate t)), with a rate [1/s]."""

    rate: complex
    share: complex


def lag(time_constant: float) -> Pole:
    """A lag of first order, g = -e^(-t/τ), with τ [s]."""
    return Pole(-1 / time_constant, 1.0)


def second_lag(time_constant: float) -> Integral:
    """Two lags of first order in series, g = -(1 + t/τ) e^(-t/τ), with τ [s]."""

    def integral(t: np.ndarray) -> np.ndarray:
        return (2 * time_constant + t) * np.exp(-t / time_constant) - 2 * time_constant

    return integral


Departure = Integral | Pole
"""A departure by its integral, or by its pole."""


def delay(dead_time: float) -> Integral:
    """A delay, g = -1 for t < τ, with τ [s]."""
    return lambda t: -np.minimum(t, dead_time)


def mode(frequency: float, damping: float) -> Pole:
    """A mode, g = -e^(-ζωt) (cos ω_d t + ζ/√(1-ζ²) sin ω_d t), of a frequency [Hz] and a damping
    ratio."""
    omega, root = 2 * np.pi * frequency, np.sqrt(1 - damping**2)
    return Pole(omega * complex(-damping, root), 1 - 1j * damping / root)


def yielding(time_constant: float, order: float) -> Integral:
    """A fractional relaxation between spring and dashpot, g ≈ -1/(1 + (t/τ)^ν), the Padé form of
    the Mittag-Leffler function -E_ν(-(t/τ)^ν / Γ(1 + ν)).

    Source: Mainardi, Discrete Contin. Dyn. Syst. B 19 (2014) 2267.
    """

    def integral(t: np.ndarray) -> np.ndarray:
        # The trapezoidal rule in the logarithm of time, in which g is smooth.
        ends = np.maximum(np.asarray(t, float), 0.0)
        grid = np.concatenate(
            [[0.0], np.geomspace(1e-6 * max(ends[ends > 0].min(), 1e-12), ends.max(), 800)]
        )
        g = -1 / (1 + (grid / time_constant) ** order)
        summed = np.concatenate([[0.0], np.cumsum(0.5 * (g[1:] + g[:-1]) * np.diff(grid))])
        return np.interp(ends, grid, summed)

    return integral


class Convolution:
    """The increments of a signal (N,) in steps of `step` [s], ready to be convolved; of steady
    cycles (`periodic`) the increments before the first sample are those of earlier passes."""

    def __init__(self, signal: np.ndarray, step: float, *, periodic: bool):
        increments = np.diff(signal, prepend=signal[-1] if periodic else signal[0])
        self._size, self._passes = signal.size, 3 if periodic else 1
        increments = np.tile(increments, self._passes)
        self._increments = increments
        self._times = np.arange(increments.size + 1) * step
        self._step = step
        self._length = next_fast_len(2 * increments.size, real=True)

    @cached_property
    def _transform(self) -> np.ndarray:
        return np.asarray(rfft(self._increments, self._length))

    def with_departure(self, departure: Departure) -> np.ndarray:
        """What a departure adds to the signal (N,), in its unit."""
        if isinstance(departure, Pole):
            # The kernel is a geometric series, which a recursion sums.
            z = np.exp(departure.rate * self._step)
            first = -departure.share * (z - 1) / (departure.rate * self._step)
            whole = np.real(np.asarray(lfilter([first], [1, -z], self._increments)))
        else:
            kernel = np.diff(departure(self._times)) / self._step
            transform = np.asarray(rfft(kernel, self._length))
            whole = np.asarray(irfft(self._transform * transform, self._length))
        return whole[(self._passes - 1) * self._size : self._passes * self._size]
