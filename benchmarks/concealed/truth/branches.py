"""Rate-independent laws, branch by branch between reversals: no time stepping.

A branch is a stretch of samples in which the input goes one way (or rests).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ..drives import Array


def branches(v: Array) -> tuple[Array, Array]:
    """Indices at which branches begin, with the last sample appended, and their directions.

    Changes under 1e-12 of the range are rounding, and count as rest.
    """
    d = np.diff(v)
    way = np.where(np.abs(d) < 1e-12 * np.ptp(v), 0.0, np.sign(d))
    starts = np.concatenate([[0], np.flatnonzero(way[1:] != way[:-1]) + 1])
    return np.append(starts, len(v) - 1), way[starts]


def play(v: Array, radius: float) -> Array:
    """Play from p(0) = v(0): p = max(v - r, min(v + r, p_before)), branch by branch."""
    ends, _ = branches(v)
    p = np.full_like(v, v[0])
    for a, b in pairwise(ends):
        part = slice(a, b + 1)
        p[part] = np.clip(p[a], v[part] - radius, v[part] + radius)
    return p


class Sliding:
    """dz/ds = 1 + c |z|^n for z < 0 and 1 - z^n for z > 0: s(z) and z(s) as tables.

    s(z) is a quadrature on nodes that crowd towards z = 1, where s grows without bound.
    """

    def __init__(self, n: float, c: float, step: float = 0.02) -> None:
        q = np.arange(0.0, 30.0 + step / 2, step)
        x, w = np.polynomial.legendre.leggauss(4)
        g = q[:-1, None] + 0.5 * step * (x + 1)
        rate = np.exp(-g) / -np.expm1(n * np.log1p(-np.exp(-g)))
        up = np.concatenate([[0.0], np.cumsum(0.5 * step * rate @ w)])
        z = -np.expm1(-q)
        slope = -np.expm1(n * np.log(np.maximum(z, 1e-300)))
        zn = np.linspace(-1.0, 0.0, round(1 / step) + 1)
        g = -(zn[:-1, None] + 0.5 * step * (x + 1))
        down = np.cumsum(0.5 * step * (1 / (1 + c * g**n)) @ w)
        s = np.concatenate([np.concatenate([[0.0], down[:-1]]) - down[-1], up])
        z, slope = np.concatenate([zn[:-1], z]), np.concatenate([1 + c * (-zn[:-1]) ** n, slope])
        self.last = float(s[-1])
        self.to_s = CubicHermiteSpline(z, s, 1 / slope)
        self._to_z = CubicHermiteSpline(s, z, slope)
        self.z_last = float(z[-1])

    def to_z(self, s: Array | float) -> Array:
        return self._to_z(np.minimum(s, self.last))

    def along(self, v: Array, rho: float, kept: Array | None = None) -> Array:
        """h on the samples `kept` (all), dh = rho dv dz/ds, from h = 0 at the first sample."""
        ends, way = branches(v)
        start = np.zeros(len(way))
        h = 0.0
        for k, (a, b) in enumerate(pairwise(ends.tolist())):
            if way[k]:
                s = float(self.to_s(min(way[k] * h, self.z_last)))
                start[k] = s
                h = way[k] * float(self.to_z(s + rho * abs(v[b] - v[a])))
            else:
                start[k] = h
        kept = np.arange(len(v)) if kept is None else kept
        k = np.clip(np.searchsorted(ends, kept, side="right") - 1, 0, len(way) - 1)
        moved = way[k] * self.to_z(start[k] + rho * np.abs(v[kept] - v[ends[k]]))
        return np.where(way[k] == 0, start[k], moved)


def rayleigh(v: Array) -> Array:
    """Rayleigh loops x|x| with return-point memory (Madelung's rules), from rest at v(0).

    Virgin curve r = x |x|, x = v - v(0); a branch from a turning point (v1, r1) is
    r1 +- 2 (|v - v1|/2)^2. An explicit stack holds the open turning points; a branch that passes
    the one before last closes that loop and goes on where it left.
    """
    ends, way = branches(v)
    out = np.zeros_like(v)
    open_: list[tuple[float, float]] = []  # turning points, oldest first; empty on the virgin curve
    for k, (a, b) in enumerate(pairwise(ends.tolist())):
        s, part = way[k], slice(a, b + 1)
        if s == 0:
            out[part] = out[a]
            continue
        before = next((w for w in way[:k][::-1] if w), 0.0)
        if before and before != s:
            open_.append((v[a], out[a]))
        u, done = v[part], np.zeros(b + 1 - a, bool)
        while open_:
            v1, r1 = open_[-1]
            # a lone turning point closes at its mirror image on the virgin curve
            bound = open_[-2][0] if len(open_) > 1 else 2 * v[0] - v1
            here = ~done & (s * (u - bound) <= 0)
            out[part][here] = r1 + s * 0.5 * (u[here] - v1) ** 2
            done |= here
            if done[-1]:
                break
            del open_[-2:]
        if not done[-1]:
            x = u[~done] - v[0]
            out[part][~done] = x * np.abs(x)
    return out
