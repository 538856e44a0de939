"""Preisach planes: relays of every pair of thresholds, of random density.

    f(x) = sum over relays (a, b) of density(a, b) · [relay is up],  a >= b switching up and down
    E(x, x') = integral of the density over x' <= b <= a <= x
    y = slope · x + bend · x² + f

The density is constant on the cells of a square grid (half cells on the diagonal), on which the
integral is exact: no sum over relays is cut off.  Two families of density: a random field that
falls off with the coercive drive c = (a - b)/2 and with the bias m = (a + b)/2; and two hills, log-
normal in c and normal in m, as first-order reversal curves show them.  Source: I. D. Mayergoyz,
Mathematical Models of Hysteresis (1991), sections 1.2 and 1.3; A. Stancu and others, Journal of
Applied Physics 93 (2003) 6620 (hills); D. H. Everett, Trans. Faraday Society 51 (1955) 1551.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.ndimage import gaussian_filter

from ...drives import Array
from .law import FURTHEST, Law, Params, Rng, rate_independent, uniform
from .memory import along

CELLS = 64
EDGES = np.linspace(-FURTHEST, FURTHEST, CELLS + 1)
CELL = float(EDGES[1] - EDGES[0])
_MIDDLES = 0.5 * (EDGES[1:] + EDGES[:-1])
_UP, _DOWN = np.meshgrid(_MIDDLES, _MIDDLES, indexing="ij")
COERCIVE, BIAS = 0.5 * (_UP - _DOWN), 0.5 * (_UP + _DOWN)


class Plane:
    """Integrals of a density that is constant on cells, over the triangles between two drives.

    Args:
        density: (CELLS, CELLS) by cell of the upper and of the lower threshold; what lies under
            the diagonal is not used.
    """

    def __init__(self, density: Array) -> None:
        beside = np.tril(density, -1) * CELL**2
        sums = np.cumsum(np.cumsum(beside[:, ::-1], axis=1)[:, ::-1], axis=0)
        # corners[p, q]: cells with upper threshold before edge p and lower one after edge q
        self.corners = np.zeros((CELLS + 1, CELLS + 1))
        self.corners[1:, :-1] = sums
        self.diagonal = np.diag(density)
        self.halves = np.concatenate([[0.0], np.cumsum(0.5 * CELL**2 * self.diagonal)])

    def everett(self, high: Array, low: Array) -> Array:
        """Integral over low <= b <= a <= high; high and low are arrays of one shape."""
        p, up = self._place(high)
        q, down = self._place(low)
        c = self.corners
        below = c[p, q] + down * (c[p, q + 1] - c[p, q])
        above = c[p + 1, q] + down * (c[p + 1, q + 1] - c[p + 1, q])
        apart = self.halves[p] - self.halves[q + 1]
        apart += 0.5 * CELL**2 * (self.diagonal[p] * up**2 + self.diagonal[q] * (1 - down) ** 2)
        same = 0.5 * self.diagonal[p] * (high - low) ** 2
        return below + up * (above - below) + np.where(p == q, same, apart)

    @staticmethod
    def _place(x: Array) -> tuple[np.ndarray, Array]:
        """Cell of each drive, and how far into it, 0 to 1."""
        along_edges = (x + FURTHEST) / CELL
        cell = np.clip(along_edges.astype(int), 0, CELLS - 1)
        return cell, along_edges - cell


@lru_cache(maxsize=8)
def random_field(seed: int) -> Array:
    """exp of a smooth normal field on the plane's cells, its logarithm of standard deviation .9."""
    rough = np.random.default_rng([seed, 29]).standard_normal((CELLS, CELLS))
    smooth = gaussian_filter(rough, 3.0)
    return np.exp(0.9 * smooth / smooth.std())


def random_density(params: Params) -> Array:
    """A random field under an exponential in the coercive drive and a hill in the bias."""
    field = random_field(int(params["seed"]))
    hill = np.exp(-0.5 * ((BIAS - params["bias"]) / params["spread"]) ** 2)
    return field * hill * np.exp(-COERCIVE / params["coercive"])


def hills_density(params: Params) -> Array:
    """Two hills, log-normal in the coercive drive and normal in the bias; the second is smaller."""
    density = np.zeros((CELLS, CELLS))
    c = np.maximum(COERCIVE, CELL / 4)
    for weight, k in ((1.0, ""), (params["second"], "_2")):
        log = np.log(c / params[f"coercive{k}"]) / params[f"width{k}"]
        tilted = BIAS - params[f"bias{k}"] - params["tilt"] * c
        density += weight * np.exp(-0.5 * log**2 - 0.5 * (tilted / params[f"spread{k}"]) ** 2)
    return density


def _response(x: Array, params: Params, density: Array) -> Array:
    x = np.clip(x, -FURTHEST, FURTHEST)
    whole = density / (np.sum(np.tril(density)) * CELL**2)
    reversible = params["slope"] * x + params["bend"] * x**2
    return reversible + params["share"] * along(x, Plane(whole).everett)


def random_response(x: Array, params: Params) -> Array:
    """Response of the plane with a random field along a path."""
    return _response(x, params, random_density(params))


def hills_response(x: Array, params: Params) -> Array:
    """Response of the plane with two hills along a path."""
    return _response(x, params, hills_density(params))


def _draw_random(rng: Rng) -> Params:
    return {"seed": int(rng.integers(2**31))} | uniform(
        rng, slope=(0.5, 1.0), bend=(-0.06, 0.1), share=(0.5, 4.0), coercive=(0.06, 0.35),
        bias=(-0.4, 0.4), spread=(0.4, 1.0),
    )  # fmt: skip


def _draw_hills(rng: Rng) -> Params:
    return uniform(
        rng, slope=(0.5, 1.0), bend=(-0.06, 0.1), share=(0.2, 2.0), tilt=(-0.4, 0.4),
        coercive=(0.1, 0.4), width=(0.4, 0.9), bias=(-0.3, 0.3), spread=(0.25, 0.7),
        second=(0.1, 0.7), coercive_2=(0.05, 0.8), width_2=(0.3, 0.7), bias_2=(-0.6, 0.6),
        spread_2=(0.2, 0.5),
    )  # fmt: skip


RANDOM = Law(_draw_random, rate_independent(random_response))
HILLS = Law(_draw_hills, rate_independent(hills_response))
