"""Bristles of LuGre's friction beside a bent spring, each with its own length.

    dz_j/dt = v - |v| z_j/(length_j · g(v)),  g(v) = 1 + stick · exp(-(v/stribeck)²),  v = dx/dt
    y = x + bend · x² - force · sum_j share_j z_j/length_j

Friction that grows at low speed makes the loop depend on the rate.  v is constant in a step, which
is solved exactly; `stribeck` is in half ranges per second.  LuGre's damping of the bristles is
left out: with a voltage for a position its pulses at steps would have no counterpart.  Source: C.
Canudas de Wit, H. Olsson, K. J. Åström and P. Lischinsky, IEEE Trans. Automatic Control 40 (1995)
419; F. Al-Bender, V. Lampaert and J. Swevers, ibid. 50 (2005) 1883 (several).
"""

from __future__ import annotations

import numpy as np

from ...drives import Array
from .law import Law, Params, Rng, uniform
from .recursion import linear

BRISTLES = 3


def bristles(dx: Array, lengths: Array, start: Array) -> Array:
    """z after each step dx: dz/d|x| = sign(dx) - z/length, lengths (bristles, steps)."""
    spent = np.abs(dx) / lengths
    return linear(np.exp(-spent), -np.expm1(-spent) * np.sign(dx) * lengths, start)


def response(x: Array, h: float, params: Params, before: Array) -> Array:
    """Response at the instants of x, step h in s, after the slow path `before`."""
    dx, slow = np.diff(x), np.diff(before)
    k = np.arange(BRISTLES)[:, None]
    lengths, shares = params["longest"] * params["ratio"] ** k, params["fading"] ** k
    grip = 1 + params["stick"] * np.exp(-((dx / h / params["stribeck"]) ** 2))
    held = lengths * (1 + params["stick"]) * np.ones_like(slow)
    start = bristles(slow, held, np.zeros(BRISTLES))[:, -1:]
    z = np.hstack([start, bristles(dx, lengths * grip, start[:, 0])])
    return x + params["bend"] * x**2 - params["force"] * np.sum(shares * z / lengths, axis=0)


def _draw(rng: Rng) -> Params:
    return uniform(
        rng, bend=(-0.1, 0.15), force=(0.02, 0.2), longest=(0.15, 0.6), ratio=(0.2, 0.6),
        fading=(0.3, 1.0), stick=(0.05, 0.4), stribeck=(0.5, 6.0),
    )  # fmt: skip


LUGRE = Law(_draw, response, {"stick": 0.0})
