"""Plays whose thresholds or weights grow with the logarithm of the drive's rate.

    p_i = max(x - r_i(t), min(x + r_i(t), p_i before)),  speed = |dx/dt| through a lag `settling`
    thresholds:  r_i(t) = r_i [1 + growth · ln(1 + speed/slow)],  y = slope · x + share · mean p_i
    weights:     y = slope · x + share · mean p_i [1 - growth · ln(1 + speed/slow) · r_i/widest]

The weights of the wider plays fall with the rate, so that the stroke does.  `slow` is in half
ranges per second, `settling` in seconds.  Source: M. Al Janaideh, C.-Y. Su and S. Rakheja, Smart
Materials and Structures 17 (2008) 035026 (logarithm of the rate); W. T. Ang, P. K. Khosla
and C. N. Riviere, IEEE/ASME Trans. Mechatronics 12 (2007) 134 (weights).
"""

from __future__ import annotations

import numpy as np

from ...drives import Array
from ...truth.linear import relax
from .law import Law, Params, Rng, uniform
from .recursion import clamped

PLAYS = 8


def response(x: Array, h: float, params: Params, before: Array) -> Array:
    """Response at the instants of x, step h in s, after the slow path `before`."""
    speed = np.abs(np.diff(x)) / h
    speed = relax(np.concatenate([[0.0], speed]), h, params["settling"])
    rise = params["growth"] * np.log1p(speed / params["slow"])
    share = (np.arange(PLAYS) + 0.5)[:, None] / PLAYS
    radii = params["widest"] * share
    start = clamped(before - radii, before + radii, np.full(PLAYS, before[0]))[:, -1]
    if params["on"] == "thresholds":
        moving = radii * (1 + rise)
        plays = clamped(x - moving, x + moving, start)
    else:
        plays = clamped(x - radii, x + radii, start) * (1 - rise * share)
    curved = x + params["bend"] * x**2
    return params["slope"] * curved + params["share"] * plays.mean(axis=0)


def _draw(rng: Rng) -> Params:
    on = str(rng.choice(["thresholds", "weights"]))
    numbers = uniform(
        rng, slope=(0.3, 1.0), bend=(-0.06, 0.1), share=(0.4, 1.2), widest=(0.2, 0.9),
        settling=(0.002, 0.02), slow=(1.0, 6.0), growth=(0.04, 0.2),
    )  # fmt: skip
    return {"on": on} | numbers


RATE_DEPENDENT_PLAY = Law(_draw, response, {"growth": 0.0})
