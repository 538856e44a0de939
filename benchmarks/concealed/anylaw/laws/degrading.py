"""Laws whose loop changes with the path travelled, s: nothing changes while the drive rests.

    a(s) = worn · (1 - exp(-s/wear)),  s = sum |dx|
    plays:     y = slope · x + share · sum_i w_i [1 - a(s) · r_i/widest] play(v(x), r_i) / sum_i w_i
    bouc_wen:  y = x + bend · x² - share · [(1 - a(s)) h_1 + a(s) h_2], h_2 with rho · loosened
    plane:     y = slope · x + bend · x² + share · [(1 - a(s)) f_1 + a(s) f_2], f Preisach planes

`worn` = 0 is the law without degradation.  Source: T. T. Baber and M. N. Noori, Journal of
Engineering Mechanics 111 (1985) 1010 (degradation with the path, or its energy); K. Kuhnen and P.
Krejci, IEEE Trans. Automatic Control 54 (2009) 537 (plays).
"""

from __future__ import annotations

import numpy as np

from ...drives import Array
from ...inexact.laws.law import FURTHEST, Law, Params, Rng, rate_independent, uniform
from ...inexact.laws.memory import along
from ...inexact.laws.preisach import CELL, Plane, random_density
from ...truth.branches import Sliding, play

PLAYS = 10


def worn(x: Array, params: Params) -> Array:
    """a(s) along a path."""
    s = np.append(0.0, np.cumsum(np.abs(np.diff(x))))
    return params["worn"] * -np.expm1(-s / params["wear"])


def plays_response(x: Array, params: Params) -> Array:
    """Response of plays whose wide ones fade."""
    share = (np.arange(PLAYS) + 0.5) / PLAYS
    weights, a, v = np.exp(-params["decay"] * share), worn(x, params), x + params["bend"] * x**2
    total = np.zeros_like(x)
    for weight, part in zip(weights / weights.sum(), share, strict=True):
        total += weight * (1 - a * part) * play(v, params["widest"] * part)
    return params["slope"] * x + params["share"] * total


def bouc_wen_response(x: Array, params: Params) -> Array:
    """Response of Bouc and Wen's law that loosens."""
    law, a = Sliding(params["n"], 2 * params["sigma"] - 1), worn(x, params)
    h = (1 - a) * law.along(x, params["rho"]) + a * law.along(x, params["rho"] * params["loosened"])
    return x + params["bend"] * x**2 - params["share"] * h


def plane_response(x: Array, params: Params) -> Array:
    """Response of one Preisach plane that turns into another."""
    x, a, parts = np.clip(x, -FURTHEST, FURTHEST), worn(x, params), []
    aged = {"seed": params["seed"] + 1, "coercive": params["coercive"] * params["wider"]}
    for other in ({}, aged):
        density = random_density({**params, **other})
        parts.append(along(x, Plane(density / (np.sum(np.tril(density)) * CELL**2)).everett))
    f = (1 - a) * parts[0] + a * parts[1]
    return params["slope"] * x + params["bend"] * x**2 + params["share"] * f


_WEAR = {"worn": (0.1, 0.5), "wear": (8.0, 60.0)}


def _draw_plays(rng: Rng) -> Params:
    return uniform(
        rng, slope=(0.2, 0.8), share=(0.4, 1.2), decay=(0.0, 3.0), widest=(0.3, 0.9),
        bend=(-0.08, 0.12), **_WEAR,
    )  # fmt: skip


def _draw_bouc_wen(rng: Rng) -> Params:
    return uniform(
        rng, rho=(1.0, 5.0), sigma=(0.6, 2.0), n=(1.0, 2.0), share=(0.05, 0.25),
        loosened=(0.3, 0.8), bend=(-0.1, 0.12), **_WEAR,
    )  # fmt: skip


def _draw_plane(rng: Rng) -> Params:
    return {"seed": int(rng.integers(2**31))} | uniform(
        rng, slope=(0.5, 1.0), bend=(-0.06, 0.1), share=(0.4, 1.5), coercive=(0.06, 0.3),
        bias=(-0.4, 0.4), spread=(0.4, 1.0), wider=(0.6, 1.8), **_WEAR,
    )  # fmt: skip


DEGRADING_PLAYS = Law(_draw_plays, rate_independent(plays_response))
DEGRADING_BOUC_WEN = Law(_draw_bouc_wen, rate_independent(bouc_wen_response))
DEGRADING_PLANE = Law(_draw_plane, rate_independent(plane_response))
