"""Bouc and Wen's law, whose memory fades along the path and whose minor loops do not close.

    dh = dx - sigma |dx| |h|^(n-1) h + (sigma - 1) dx |h|^n, in steps of rho |dx|
    y = x + bend · x² + kink · x³ - share · h

Source: Y. K. Wen, Journal of the Engineering Mechanics Division 102 (1976) 249; F. Ikhouane and J.
Rodellar, Systems with Hysteresis (2007), section 2.4 (normalised).
"""

from __future__ import annotations

from ...drives import Array
from ...inexact.laws.law import Law, Params, Rng, rate_independent, uniform
from ...truth.branches import Sliding


def response(x: Array, params: Params) -> Array:
    """Response along a path."""
    h = Sliding(params["n"], 2 * params["sigma"] - 1).along(x, params["rho"])
    return x + params["bend"] * x**2 + params["kink"] * x**3 - params["share"] * h


def _draw(rng: Rng) -> Params:
    return uniform(
        rng, rho=(1.0, 6.0), sigma=(0.6, 2.0), n=(1.0, 2.5), share=(0.03, 0.25),
        bend=(-0.1, 0.12), kink=(-0.06, 0.08),
    )  # fmt: skip


BOUC_WEN = Law(_draw, rate_independent(response))
