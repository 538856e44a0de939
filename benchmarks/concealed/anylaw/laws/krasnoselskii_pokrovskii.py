"""The law of Krasnosel'skii and Pokrovskii: relays whose edges are ramps.

    k = max(ramp(x - up), k before) rising,  min(ramp(x - down), k before) falling,  down <= up
    ramp(x) = -1, (2 x/width) - 1, 1 below, within and above 0 <= x <= width
    y = slope · x + bend · x² + share · sum_i weight_i k_i

The thresholds are those of a grid, the weights a hill over the loops' widths and biases with a
random factor each.  Source: M. A. Krasnosel'skii and A. V. Pokrovskii, Systems with Hysteresis
(1989); H. T. Banks, A. J. Kurdila and G. Webb, Mathematical Problems in Engineering 3 (1997) 287.
"""

from __future__ import annotations

import numpy as np

from ...drives import Array
from ...inexact.laws.law import Law, Params, Rng, rate_independent, uniform
from ...inexact.laws.prandtl_ishlinskii import generalised_play

GRID = 8  # thresholds between -1.2 and 1


def response(x: Array, params: Params) -> Array:
    """Response along a path."""
    thresholds = np.linspace(-1.2, 1.0, GRID)
    down, up = (thresholds[which] for which in np.triu_indices(GRID))
    rough = np.random.default_rng([int(params["seed"]), 31]).uniform(0.3, 1.7, len(up))
    hill = np.exp(-(up - down) / params["coercive"]) * np.exp(
        -0.5 * ((0.5 * (up + down) - params["bias"]) / params["spread"]) ** 2
    )
    weights = rough * hill / np.sum(rough * hill)

    def ramp(z: Array) -> Array:
        return np.clip(2 * z / params["width"] - 1, -1, 1)

    ends = zip(up, down, strict=True)
    kernels = [generalised_play(ramp(x - a), ramp(x - b), 0.0, x) for a, b in ends]
    reversible = params["slope"] * x + params["bend"] * x**2
    return reversible + params["share"] * weights @ np.array(kernels)


def _draw(rng: Rng) -> Params:
    return {"seed": int(rng.integers(2**31))} | uniform(
        rng, slope=(0.4, 1.0), bend=(-0.08, 0.12), share=(0.3, 1.2), width=(0.4, 0.9),
        coercive=(0.1, 0.6), bias=(-0.3, 0.3), spread=(0.4, 1.0),
    )  # fmt: skip


KRASNOSELSKII_POKROVSKII = Law(_draw, rate_independent(response))
