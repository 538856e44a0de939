"""The generalised Prandtl-Ishlinskii law: plays between two envelopes that differ.

    F_r = max(left(x) - r, F_r before) rising,  min(right(x) + r, F_r before) falling
    y = slope · x + share · sum_i exp(-decay · r_i) F_ri / sum_i exp(-decay · r_i)
    left = tanh(steep · x + lean)/steep, or x + second · x² + third · x³
    right = left + gap · (1 + skew · tanh(2 x))

Source: M. Al Janaideh, S. Rakheja and C.-Y. Su, Smart Materials and Structures 18 (2009) 045001.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...drives import Array
from ...truth.branches import branches
from .law import Law, Params, Rng, rate_independent, uniform

PLAYS = 14


def generalised_play(left: Array, right: Array, radius: float, x: Array) -> Array:
    """F_r along a path x whose envelopes are at hand, from the middle of the play."""
    out = np.empty_like(x)
    out[0] = 0.5 * (left[0] + right[0])
    for (first, last), way in zip(pairwise(branches(x)[0].tolist()), branches(x)[1], strict=True):
        part = slice(first + 1, last + 1)
        if way > 0:
            out[part] = np.maximum(out[first], left[part] - radius)
        elif way < 0:
            out[part] = np.minimum(out[first], right[part] + radius)
        else:
            out[part] = out[first]
    return out


def envelopes(x: Array, params: Params) -> tuple[Array, Array]:
    """The envelope of rising and of falling drives."""
    if params["envelope"] == "tanh":
        left = np.tanh(params["steep"] * x + params["lean"]) / params["steep"]
    else:
        left = x + params["second"] * x**2 + params["third"] * x**3
    return left, left + params["gap"] * (1 + params["skew"] * np.tanh(2 * x))


def response(x: Array, params: Params) -> Array:
    """Response along a path."""
    left, right = envelopes(x, params)
    radii = params["widest"] * (np.arange(PLAYS) + 0.5) / PLAYS
    weights = np.exp(-params["decay"] * radii)
    plays = [generalised_play(left, right, r, x) for r in radii]
    return params["slope"] * x + params["share"] * (weights / weights.sum()) @ np.array(plays)


def _draw(rng: Rng) -> Params:
    common = uniform(
        rng, slope=(0.2, 1.0), share=(0.4, 1.5), decay=(0.0, 5.0), widest=(0.2, 0.9),
        gap=(0.0, 0.06), skew=(-0.6, 0.6),
    )  # fmt: skip
    if rng.uniform() < 0.5:
        return {"envelope": "tanh"} | common | uniform(rng, steep=(0.3, 1.1), lean=(-0.4, 0.4))
    return {"envelope": "cubic"} | common | uniform(rng, second=(-0.15, 0.15), third=(-0.06, 0.12))


PRANDTL_ISHLINSKII = Law(_draw, rate_independent(response))
