"""Maxwell's slip: springs that slide at a force each, beside one that does not.

    y + sum_i k_i s_i = v(x),  s_i the stretch of spring i, which follows y up to ±reach_i
    v(x) = x + bend · x²

From a turning point a branch is twice the virgin curve at half the way (Masing's rule): the change
of y is 2 f((v - v_1)/2), with f the inverse of y + sum_i k_i min(y, reach_i).  Source: M. Goldfarb
and N. Celanovic, IEEE Control Systems Magazine 17(3) (1997) 69; W. D. Iwan, Journal of Applied
Mechanics 33 (1966) 893.
"""

from __future__ import annotations

import numpy as np

from ...drives import Array
from ...inexact.laws.law import FURTHEST, Law, Params, Rng, rate_independent, uniform
from ...inexact.laws.memory import along

SPRINGS = 5


def springs(params: Params) -> tuple[Array, Array]:
    """Stiffnesses without unit and reaches in units of y, the shortest first."""
    share = (np.arange(SPRINGS) + 1) / SPRINGS
    return params["stiff"] * params["fading"] ** np.arange(SPRINGS), params["reach"] * share**1.5


def response(x: Array, params: Params) -> Array:
    """Response along a path."""
    stiff, reach = springs(params)
    y = np.concatenate([[0.0], reach, [4 * FURTHEST + reach[-1]]])
    forces = y + stiff @ np.minimum(y, reach[:, None])

    def bent(x: Array) -> Array:
        return x + params["bend"] * x**2

    def everett(high: Array, low: Array) -> Array:
        return 2 * np.interp(0.5 * (bent(high) - bent(low)), forces, y)

    return along(np.clip(x, -FURTHEST, FURTHEST), everett)


def _draw(rng: Rng) -> Params:
    return uniform(rng, bend=(0.04, 0.15), stiff=(0.05, 0.4), fading=(0.5, 1.0), reach=(0.2, 0.9))


MAXWELL_SLIP = Law(_draw, rate_independent(response))
