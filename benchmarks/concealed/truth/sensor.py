"""Effects of the displacement sensor and its recorder."""

from __future__ import annotations

import numpy as np
from scipy.signal import bessel

from ..drives import Array
from .linear import follow


def sensor_lag(t: Array, y: Array, tau: float, order: int) -> Array:
    """Bessel low-pass of the conditioner, order 1 to 4, group delay tau in s; by its poles."""
    if tau <= 0:
        return y
    _, poles, gain = bessel(order, 1 / tau, analog=True, output="zpk", norm="delay")
    out, h = np.zeros(len(y)), t[1] - t[0]
    for k, p in enumerate(poles):
        if p.imag > -1e-9 * abs(p):
            residue = gain / np.prod(p - np.delete(poles, k))
            twice = 2 if p.imag > 1e-9 * abs(p) else 1
            out += twice * np.real(residue * follow(y - y[0], h, p))
    return y[0] + out


def sensor_nonlinearity(t: Array, y: Array, curve: float, middle: float, span: float) -> Array:
    """Capacitive gap: middle + x/(1 - curve x/span), x = y - middle; middle and span in um."""
    x = y - middle
    return middle + x / (1 - curve * x / span)


def mains_interference(
    t: Array, y: Array, size: float, frequency: float, ratios: list[float], phases: list[float]
) -> Array:
    """y + size * sum_k ratio_k sin(2 pi k f t + phase_k), k = 1..5; size in um, f in Hz."""
    lines = enumerate(zip(ratios, phases, strict=True), start=1)
    return y + size * sum(c * np.sin(2 * np.pi * k * frequency * t + p) for k, (c, p) in lines)


def quantisation(y: Array, lsb: float, offset: float, dither: float, seed: int) -> Array:
    """ADC: lsb (floor(y/lsb + offset + dither e) + 1/2 - offset), e uniform in +-1/2; lsb in um."""
    if lsb <= 0:
        return y
    e = np.random.default_rng(seed).uniform(-0.5, 0.5, len(y))
    return lsb * (np.floor(y / lsb + offset + dither * e) + 0.5 - offset)
