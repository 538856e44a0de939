r"""What linear dynamics add to a signal: its increments, convolved with a departure g(t).

A linear effect of static gain 1 answers a step by 1 + g(t): creep by log10(1 + t/t0), a lag by
-e^(-t/τ), a delay by -1 for t < τ, a mode by its ringing.  Where g is slow or fractional the signal
is a line between its samples, and the kernel is the mean of g over a step; where g has a few poles
the signal is bent between them and the kernel is a recursion.

Source: Franklin, Powell & Workman, Digital Control of Dynamic Systems (1998), 6.3 (triangle hold).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import factorial
from typing import NamedTuple

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import maximum_filter1d

from .._filters import moving_sum, solve_recursion

Integral = Callable[[np.ndarray], np.ndarray]
"""∫_0^t g dt' [s] of a departure g (dimensionless), for times t ≥ 0 [s]."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
"""Nodes of Gauss and Legendre in a step, and their weights: a lag of a tenth of it needs them."""


def creep(onset: float) -> Integral:
    """One decade's creep, g = log10(1 + t/t0), from its onset t0 [s]."""

    def integral(t: np.ndarray) -> np.ndarray:
        z = t / onset
        return onset * ((1 + z) * np.log1p(z) - z) / np.log(10)

    return integral


class Recursion(NamedTuple):
    """A departure with a few poles, at one step: the taps of a signal's steps and of its bends, and
    the denominator, by which it is filtered.

    Between its samples a signal is a line less θ(1 - θ)/2 of its bend, θ from 0 to 1: exact for a
    cubic.
    """

    straight: np.ndarray
    bent: np.ndarray
    denominator: np.ndarray


def _recursion(
    departure: Callable[[np.ndarray], np.ndarray], denominator: np.ndarray, step: float
) -> Recursion:
    """The recursion of a departure g(t) whose kernel has a denominator."""
    order = denominator.size - 1
    theta, weights = 0.5 * (1 + _NODES), 0.5 * _WEIGHTS
    g = departure((np.arange(order)[:, None] + 1 - theta) * step)
    kernels = g @ weights, g @ (weights * (theta - 0.5))
    straight, bent = (np.convolve(denominator, k)[:order] for k in kernels)
    return Recursion(straight, bent, denominator)


def smoothness(signal: np.ndarray, *, periodic: bool) -> np.ndarray:
    """The share (N,) of each sample's bend that counts: 1 where a signal (N,) is smooth, 0 at its
    corners, between which it is straight, and at its end, beyond which nothing is known."""
    around = np.pad(signal, 2, mode="wrap" if periodic else "edge")
    second, fourth = (
        maximum_filter1d(np.abs(np.convolve(around, taps, "valid")), 5, mode="nearest") ** 4
        for taps in ([0.0, 1.0, -2.0, 1.0, 0.0], [1.0, -4.0, 6.0, -4.0, 1.0])
    )
    if not periodic:
        # The corners there are those of the edge.
        second[-4:], fourth[-4:] = 1.0, 0.0
        second[-1] = 0.0
    return second / np.maximum(second + fourth, 1e-300)


def bends_of(signal: np.ndarray, *, periodic: bool) -> np.ndarray:
    """The bend (N,) of a signal (N,) between each sample and the one before: the mean second
    difference at both, where the signal is smooth."""
    around = np.pad(signal, (2, 1), mode="wrap" if periodic else "edge")
    means = 0.5 * np.convolve(around, [1.0, -1.0, -1.0, 1.0], "valid")
    return means * smoothness(signal, periodic=periodic)


def halfway(signal: np.ndarray, *, periodic: bool) -> np.ndarray:
    """A signal (N,) halfway between each sample and the one before; before the first it is as
    there, or of steady cycles."""
    before = np.roll(signal, 1)
    between = 0.5 * (before + signal) - bends_of(signal, periodic=periodic) / 8
    if not periodic:
        between[0] = signal[0]
    return between


def lag(time_constant: float, step: float, order: int = 1) -> Recursion:
    """Lags of first order in series, g = -e^(-t/τ) Σ_(k < order) (t/τ)^k / k!, with τ and the step
    [s]."""

    def departure(t: np.ndarray) -> np.ndarray:
        z = t / time_constant
        return -np.exp(-z) * sum(z**k / factorial(k) for k in range(order))

    kept = np.exp(-step / time_constant)
    return _recursion(departure, np.poly(np.full(order, kept)), step)


def mode(frequency: float, damping: float, step: float) -> Recursion:
    """A mode, g = -e^(-ζωt) (cos ω_d t + ζ/√(1-ζ²) sin ω_d t), of a frequency [Hz] and a damping
    ratio."""
    omega, root = 2 * np.pi * frequency, np.sqrt(1 - damping**2)

    def departure(t: np.ndarray) -> np.ndarray:
        angle = root * omega * t
        return -np.exp(-damping * omega * t) * (np.cos(angle) + damping / root * np.sin(angle))

    kept = np.exp(omega * complex(-damping, root) * step)
    return _recursion(departure, np.array([1.0, -2 * kept.real, abs(kept) ** 2]), step)


def shared(one: Recursion, other: Recursion, share: float) -> Recursion:
    """(1 - share) of one departure and the share of another."""

    def together(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return (1 - share) * np.convolve(first, other.denominator) + share * np.convolve(
            second, one.denominator
        )

    return Recursion(
        together(one.straight, other.straight),
        together(one.bent, other.bent),
        np.convolve(one.denominator, other.denominator),
    )


Departure = Integral | Recursion
"""A departure by its integral, or by its recursion."""


def delay(dead_time: float) -> Integral:
    """A delay, g = -1 for t < τ, with τ [s]."""
    return lambda t: -np.minimum(t, dead_time)


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
        self._size, self._passes = signal.size, 3 if periodic else 1
        self._bends = np.tile(bends_of(signal, periodic=periodic), self._passes)
        increments = np.diff(signal, prepend=signal[-1] if periodic else signal[0])
        self._increments = np.tile(increments, self._passes)
        self._times = np.arange(self._increments.size + 1) * step
        self._step = step
        self._length = next_fast_len(2 * self._increments.size, real=True)

    @cached_property
    def _transform(self) -> np.ndarray:
        return np.asarray(rfft(self._increments, self._length))

    def with_departure(self, departure: Departure) -> np.ndarray:
        """What a departure adds to the signal (N,), in its unit."""
        if isinstance(departure, Recursion):
            straight, bent, denominator = departure
            moved = moving_sum(straight, self._increments) + moving_sum(bent, self._bends)
            whole = solve_recursion(denominator, moved)
        else:
            kernel = np.diff(departure(self._times)) / self._step
            transform = np.asarray(rfft(kernel, self._length))
            whole = np.asarray(irfft(self._transform * transform, self._length))
        return whole[(self._passes - 1) * self._size : self._passes * self._size]
