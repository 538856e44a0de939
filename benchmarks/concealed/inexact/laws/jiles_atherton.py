"""The Jiles-Atherton law of ferroic domain walls, in the form for ferroelectric strain.

    P_an = coth(E_e/a) - a/E_e,  E_e = E + mean_field · P,  E = x + bias
    dP_irr/dE = (P_an - P_irr)/(±pinning - mean_field (P_an - P_irr)), or 0 if P_irr fell against E
    P = (1 - reversible) P_irr + reversible · P_an,   y = slope · x + share · P

Runge and Kutta's fourth order in steps of the field, not of time, with a cubic between them: the
law has no rate.  Source: D. C. Jiles and D. L. Atherton, Journal of Magnetism and Magnetic
Materials 61 (1986) 48; R. C. Smith and Z. Ounaies, Journal of Intelligent Material Systems
and Structures 11 (2000) 62 (polarisation).
"""

from __future__ import annotations

from itertools import pairwise
from math import tanh

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ...drives import Array
from ...truth.branches import branches
from .law import Law, Params, Rng, rate_independent, uniform

STEP = 0.006  # of the field, in rated half ranges


def langevin(z: float) -> float:
    """coth z - 1/z, by its series where |z| is small."""
    return z / 3 * (1 - z * z / 15) if abs(z) < 1e-2 else 1 / tanh(z) - 1 / z


def polarisation(field: Array, params: Params, step: float = STEP) -> Array:
    """P_irr along a path of the field, from the state without hysteresis at its start."""
    a, pinning, mean_field = (float(params[k]) for k in ("a", "pinning", "mean_field"))

    def rate(e: float, p: float, way: float) -> float:
        gap = langevin((e + mean_field * p) / a) - p
        if gap * way <= 0:
            return 0.0
        return gap / (way * pinning - mean_field * gap)

    out = np.empty_like(field)
    p = langevin(float(field[0]) / a)
    out[0] = p
    ends, ways = branches(field)
    for (first, last), way in zip(pairwise(ends.tolist()), ways.tolist(), strict=True):
        if way == 0:
            out[first + 1 : last + 1] = p
            continue
        e0, e1 = float(field[first]), float(field[last])
        n = int(np.ceil(abs(e1 - e0) / step))
        d = (e1 - e0) / n
        values, slopes = [p], [rate(e0, p, way)]
        for k in range(n):
            e = e0 + k * d
            k1 = slopes[-1]
            k2 = rate(e + d / 2, p + d / 2 * k1, way)
            k3 = rate(e + d / 2, p + d / 2 * k2, way)
            k4 = rate(e + d, p + d * k3, way)
            p += d / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            values.append(p)
            slopes.append(rate(e + d, p, way))
        nodes = np.linspace(0.0, abs(e1 - e0), n + 1)
        curve = CubicHermiteSpline(nodes, values, way * np.array(slopes))
        out[first + 1 : last + 1] = curve(np.abs(field[first + 1 : last + 1] - e0))
    return out


def response(x: Array, params: Params) -> Array:
    """Response along a path."""
    field = x + params["bias"]
    p = polarisation(field, params)
    z = (field + params["mean_field"] * p) / params["a"]
    z = np.where(np.abs(z) < 1e-3, 1e-3, z)
    anhysteretic = 1 / np.tanh(z) - 1 / z
    mixed = (1 - params["reversible"]) * p + params["reversible"] * anhysteretic
    return params["slope"] * x + params["share"] * mixed


def _draw(rng: Rng) -> Params:
    return uniform(
        rng, a=(0.3, 1.2), pinning=(0.1, 0.5), mean_field=(0.0, 0.2), bias=(-0.3, 0.6),
        reversible=(0.05, 0.4), slope=(0.3, 1.0), share=(0.4, 1.6),
    )  # fmt: skip


JILES_ATHERTON = Law(_draw, rate_independent(response))
