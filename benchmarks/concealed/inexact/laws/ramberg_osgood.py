"""Ramberg-Osgood loops by Masing's rule, on a bent drive.

    E(x, x') = 2 [s + stiffening · s^power],  s = (v(x) - v(x'))/2
    v(x) = x + bend · x² + kink · x³

Every branch is the virgin curve, magnified by two; with power 2 it is Rayleigh's law.  Source: W.
Ramberg and W. R. Osgood, NACA Technical Note 902 (1943); G. Masing, Proc. 2nd International
Congress of Applied Mechanics (1926) 332.
"""

from __future__ import annotations

import numpy as np

from ...drives import Array
from .law import FURTHEST, Law, Params, Rng, rate_independent, uniform
from .memory import along


def response(x: Array, params: Params) -> Array:
    """Response along a path."""

    def bent(x: Array) -> Array:
        return x + params["bend"] * x**2 + params["kink"] * x**3

    def everett(high: Array, low: Array) -> Array:
        half = 0.5 * (bent(high) - bent(low))
        return 2 * (half + params["stiffening"] * half ** params["power"])

    return along(np.clip(x, -FURTHEST, FURTHEST), everett)


def _draw(rng: Rng) -> Params:
    return uniform(
        rng, bend=(-0.08, 0.12), kink=(-0.04, 0.06), stiffening=(0.05, 0.8), power=(1.4, 3.0)
    )


RAMBERG_OSGOOD = Law(_draw, rate_independent(response))
