"""Duhem's law in the form of Coleman and Hodgdon: minor loops that do not close.

    dw/dx = ± rate · [f(x) - w] + floor,  + rising and - falling
    f(x) = tanh(steep · (x - middle)) + tilt · x,   y = slope · x + bend · x² + share · w

f is taken as straight within a step, which is then solved exactly.  Source: B. D. Coleman and M. L.
Hodgdon, International Journal of Engineering Science 24 (1986) 897; J. Oh and D. S. Bernstein, IEEE
Trans. Automatic Control 50 (2005) 631.
"""

from __future__ import annotations

import numpy as np

from ...drives import Array
from .law import Law, Params, Rng, rate_independent, uniform
from .recursion import linear


def along(x: Array, goal: Array, rate: float, floor: float) -> Array:
    """w along a path x with the curve f at its points, from w = f at the start."""
    dx, df = np.diff(x), np.diff(goal)
    spent = rate * np.abs(dx)
    keep = np.exp(-spent)
    share = np.where(spent > 1e-8, -np.expm1(-spent) / np.maximum(spent, 1e-8), 1.0)
    # w - f falls off at the rate and is fed by floor dx - df, evenly within the step
    feed = share * (floor * dx - df)
    return goal + np.append(0.0, linear(keep[None], feed[None], np.zeros(1))[0])


def response(x: Array, params: Params) -> Array:
    """Response along a path."""
    goal = np.tanh(params["steep"] * (x - params["middle"])) + params["tilt"] * x
    w = along(x, goal, float(params["rate"]), float(params["floor"]))
    return params["slope"] * x + params["bend"] * x**2 + params["share"] * w


def _draw(rng: Rng) -> Params:
    return uniform(
        rng, slope=(0.4, 1.0), bend=(-0.06, 0.1), share=(0.2, 0.8), rate=(1.5, 8.0),
        floor=(0.0, 0.3), steep=(0.4, 1.6), middle=(-0.4, 0.4), tilt=(0.0, 0.4),
    )  # fmt: skip


DUHEM = Law(_draw, rate_independent(response))
