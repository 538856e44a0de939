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

from itertools import accumulate

import numpy as np

from ...drives import Array
from ...truth.linear import relax
from .law import Law, Params, Rng, uniform

PLAYS = 8


def moving_play(low: Array, high: Array, start: float) -> Array:
    """p = max(low, min(high, p before)), both limits moving, from `start`."""
    limits = zip(low.tolist(), high.tolist(), strict=True)
    steps = accumulate(limits, lambda p, ends: max(ends[0], min(ends[1], p)), initial=start)
    return np.array(list(steps))[1:]


def response(x: Array, h: float, params: Params, before: Array) -> Array:
    """Response at the instants of x, step h in s, after the slow path `before`."""
    speed = np.abs(np.diff(x)) / h
    speed = relax(np.concatenate([speed[:1] * 0, speed]), h, float(params["settling"]))
    rise = params["growth"] * np.log1p(speed / params["slow"])
    by_threshold = params["on"] == "thresholds"
    total = np.zeros_like(x)
    for r in params["widest"] * (np.arange(PLAYS) + 0.5) / PLAYS:
        start = moving_play(before - r, before + r, float(before[0]))[-1]
        radius = r * (1 + rise) if by_threshold else np.full_like(x, r)
        p = moving_play(x - radius, x + radius, float(start))
        total += p if by_threshold else p * (1 - rise * r / params["widest"])
    curved = x + params["bend"] * x**2
    return params["slope"] * curved + params["share"] * total / PLAYS


def _draw(rng: Rng) -> Params:
    on = str(rng.choice(["thresholds", "weights"]))
    numbers = uniform(
        rng, slope=(0.3, 1.0), bend=(-0.06, 0.1), share=(0.4, 1.2), widest=(0.2, 0.9),
        settling=(0.002, 0.02), slow=(1.0, 6.0), growth=(0.04, 0.2),
    )  # fmt: skip
    return {"on": on} | numbers


RATE_DEPENDENT_PLAY = Law(_draw, response, {"growth": 0.0})
