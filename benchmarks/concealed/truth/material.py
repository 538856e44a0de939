"""Effects of the ceramic and of layers it drives: electrostriction, loops, creep, polymers."""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve

from ..drives import Array, Signal
from .branches import play, rayleigh
from .linear import follow, relax


def electrostriction(drive: Signal, t: Array, q: float, u0: float) -> Array:
    """u + q (u - u0)^2; q in 1/V, u0 in V."""
    v = drive(t)
    return v + q * (v - u0) ** 2


def cubic_nonlinearity(drive: Signal, t: Array, q: float, u0: float) -> Array:
    """Hardening u0 + sinh(k x)/k or softening u0 + asinh(k x)/k, x = u - u0, k = sqrt(6 |q|).

    Both start x + q x^3; q in 1/V^2, its sign hardens or softens.
    """
    v = drive(t)
    if q == 0:
        return v
    k = np.sqrt(6 * abs(q))
    return u0 + (np.sinh if q > 0 else np.arcsinh)(k * (v - u0)) / k


def amplitude_dependence(drive: Signal, t: Array, rate: float) -> Array:
    """u + rate * R(u), R the Rayleigh loops x|x| with return-point memory; rate in 1/V."""
    v = drive(t)
    return v + rate * rayleigh(v)


def minor_loop_memory(drive: Signal, t: Array, weight: float, radii: list[float]) -> Array:
    """u + weight * mean_i (play(u, r_i) - u); radii in V, weight without unit."""
    v = drive(t)
    return v + weight * (sum(play(v, r) for r in radii) / len(radii) - v)


def creep(t: Array, y: Array, gain: float, t0: float) -> Array:
    """Log law: each increment dy is followed by dy * gain * log10(1 + t/t0); gain per decade."""
    h = t[1] - t[0]
    s = np.arange(len(t)) * h
    primitive = (s + t0) * np.log1p(s / t0) - s  # of ln(1 + s/t0): exact for linear pieces
    kernel = np.diff(primitive) / (h * np.log(10))
    return y + gain * np.append(0.0, fftconvolve(np.diff(y), kernel)[: len(y) - 1])


def creep_kelvin_voigt(t: Array, y: Array, gain: float, taus: list[float]) -> Array:
    """Creep by Kelvin-Voigt elements in series: y + gain * sum_i y/(1 + tau_i d/dt); taus in s."""
    x = y - y[0]
    return y + gain * sum(relax(x, t[1] - t[0], tau) for tau in taus)


def viscoelastic_layer(
    t: Array, y: Array, softness: float, arms: list[float], taus: list[float]
) -> Array:
    """Glue in series with a stage spring: the stage follows x = y - d, d the layer's deflection.

    Balance k x = K (d + sum_i f_i), f_i' = g_i d' - f_i/tau_i: a spring K beside Maxwell arms.
    softness = k/K (without unit), arms g_i relative to K, taus in s.
    """
    g, c = np.array(arms), 1 / (1 + softness)
    # d = c (softness y - sum f); f' = g d' - f/tau becomes  m f' = g c softness y' - f/tau
    m = np.eye(len(g)) + np.outer(g, np.full(len(g), c))
    # Relaxations do not ring; NumPy from 2.5 on tells real eigenvalues as complex numbers too.
    found = np.linalg.eig(np.linalg.solve(m, -np.diag(1 / np.array(taus))))
    poles, vectors = np.real(found.eigenvalues), np.real(found.eigenvectors)
    enter = np.linalg.solve(vectors, np.linalg.solve(m, g * c * softness))
    modes = zip(poles, vectors.sum(axis=0) * enter, strict=True)
    force = sum(w * follow(y, t[1] - t[0], p, of_rate=True) for p, w in modes)
    return y - c * (softness * (y - y[0]) - force)
