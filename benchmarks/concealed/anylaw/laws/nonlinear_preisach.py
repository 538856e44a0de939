"""Mayergoyz's nonlinear Preisach law, whose weights depend on the drive: no congruent minor loops.

    y = slope · x + bend · x² + share · [f_1 + mixed · tanh(x) f_2 + squared · f_1²]

f_1 and f_2 are Preisach planes of two densities, each with Madelung's rules, so that every function
of them and the drive has return-point memory.  Source: I. D. Mayergoyz, Mathematical Models of
Hysteresis (1991), section 2.1; E. Madelung, Annalen der Physik 322 (1905) 861.
"""

from __future__ import annotations

import numpy as np

from ...drives import Array
from ...inexact.laws.law import FURTHEST, Law, Params, Rng, rate_independent, uniform
from ...inexact.laws.memory import along
from ...inexact.laws.preisach import CELL, Plane, random_density


def response(x: Array, params: Params) -> Array:
    """Response along a path."""
    x, planes = np.clip(x, -FURTHEST, FURTHEST), []
    for more in (0, 1):
        density = random_density({**params, "seed": params["seed"] + more})
        planes.append(along(x, Plane(density / (np.sum(np.tril(density)) * CELL**2)).everett))
    f, other = planes
    weighed = f + params["mixed"] * np.tanh(x) * other + params["squared"] * f**2
    return params["slope"] * x + params["bend"] * x**2 + params["share"] * weighed


def _draw(rng: Rng) -> Params:
    return {"seed": int(rng.integers(2**31))} | uniform(
        rng, slope=(0.5, 1.0), bend=(-0.06, 0.1), share=(0.4, 2.0), coercive=(0.06, 0.35),
        bias=(-0.4, 0.4), spread=(0.4, 1.0), mixed=(-0.6, 0.6), squared=(-0.3, 0.3),
    )  # fmt: skip


NONLINEAR_PREISACH = Law(_draw, rate_independent(response))
