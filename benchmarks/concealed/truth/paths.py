"""Fractional operators as sums of relaxation modes (diffusive representation), on a fine grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from scipy.signal import lfilter
from scipy.special import gamma

from ..drives import Array


def nodes(low: float, high: float, order: int, panels: int) -> tuple[Array, Array]:
    """Composite Gauss-Legendre nodes and weights on [low, high]."""
    x, w = np.polynomial.legendre.leggauss(order)
    ends = np.linspace(low, high, panels + 1)
    half = 0.5 * np.diff(ends)[:, None]
    return (ends[:-1, None] + half * (x + 1)).ravel(), (half * w).ravel()


class Path:
    """A drive on a fine grid and its first-order relaxation modes exp(-r t).

    Every kernel used here is a sum of exponentials, int rho(r) exp(-r t) dr, taken by Gauss-
    Legendre panels in ln r. Each mode z' = -r z + w is integrated exactly for a piecewise-linear
    drive; w = dv/dt ("rate") or w = v ("value"). Modes slower than 1e-6/T act as the integral of
    w, faster than 50/h as w/r. `keep` thins the output; `cache` stores the modes for refits.
    The actuator has been at u(0) for t < 0: every operator acts on v = u - u(0).
    """

    def __init__(self, u: Array, h: float, keep: int = 1, cache: bool = False) -> None:
        self.u, self.h, self.keep, self.cache = u, h, keep, cache
        self.v = u - u[0]
        self.low, self.high = np.log(1e-6 / (h * len(u))), np.log(50 / h)
        panels = int(np.ceil((self.high - self.low) / np.log(10)))
        self.x, self.w = nodes(self.low, self.high, 5, panels)
        self._store: dict[str, Array] = {}

    def thin(self, x: Array) -> Array:
        return x[:: self.keep]

    @property
    def rate(self) -> Array:
        """dv/dt in V/s just before each instant, second order: a corner has no instant effect."""
        return self._slopes[0]

    @cached_property
    def speed(self) -> Array:
        """|dv/dt| in V/s: mean of the two sides, so that a corner keeps its speed."""
        left, right = self._slopes
        return 0.5 * (np.abs(left) + np.abs(right))

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        s = np.diff(self.v) / self.h
        s = np.concatenate([[0.0, 0.0], s, [s[-1], s[-1]]])
        return 1.5 * s[1:-2] - 0.5 * s[:-3], 1.5 * s[2:-1] - 0.5 * s[3:]

    @cached_property
    def area(self) -> Array:
        """Integral of v in V s."""
        return np.concatenate([[0.0], np.cumsum(0.5 * (self.v[1:] + self.v[:-1]) * self.h)])

    def _mode(self, kind: str, r: float) -> Array:
        x, decay = r * self.h, np.exp(-r * self.h)
        c = -np.expm1(-x) / r
        if kind == "rate":
            z = lfilter([c], [1.0, -decay], np.diff(self.v) / self.h)
            return np.concatenate([[0.0], z])
        last = self.h * ((x - 1 + decay) / x**2 if x > 1e-3 else 0.5 - x / 6 + x * x / 24)
        return lfilter([last, c - last], [1.0, -decay], self.v)

    def modes(self, kind: str, weights: Array, slow: Array, fast: Array) -> Array:
        """sum_j weights_kj z_j + slow_k * integral(w) + fast_k * w: one row k per kernel."""
        ends = (self.v, self.rate) if kind == "rate" else (self.area, self.v)
        out = np.outer(slow, self.thin(ends[0])) + np.outer(fast, self.thin(ends[1]))
        if self.cache:
            if kind not in self._store:
                rows = [self.thin(self._mode(kind, r)) for r in np.exp(self.x)]
                self._store[kind] = np.array(rows)
            return out + weights @ self._store[kind]
        for r, c in zip(np.exp(self.x), weights.T, strict=True):
            z = self.thin(self._mode(kind, r))
            for row, one in zip(out, c, strict=True):
                row += one * z
        return out

    def derivatives(self, orders: Sequence[float]) -> list[Array]:
        """Caputo D^a v, -0.9 <= a <= 0.9, in V s^-a (integral for a < 0), for several orders.

        t^-p / Gamma(1-p) = sin(pi p)/pi int_0^inf r^(p-1) exp(-r t) dr acts on dv/dt with p = a
        for a > 0, and on v with p = 1 + a for a < 0. One pass over the modes serves all orders.
        """
        # under 1e-12 the operator is the identity to rounding, and 1 - p below would vanish
        orders = [a if abs(a) > 1e-12 else 0.0 for a in orders]
        out: dict[int, Array] = {k: self.thin(self.v) for k, a in enumerate(orders) if a == 0.0}
        for kind, sign in (("rate", 1), ("value", -1)):
            which = [k for k, a in enumerate(orders) if a * sign > 0]
            if which:
                p = np.array([orders[k] if sign > 0 else 1 + orders[k] for k in which])
                c = np.sin(np.pi * p) / np.pi
                slow, fast = np.exp(p * self.low) / p, np.exp((p - 1) * self.high) / (1 - p)
                weights = c[:, None] * self.w * np.exp(np.outer(p, self.x))
                rows = self.modes(kind, weights, c * slow, c * fast)
                out |= dict(zip(which, rows, strict=True))
        return [out[k] for k in range(len(orders))]

    def derivative(self, order: float) -> Array:
        """Caputo D^a v for one order."""
        return self.derivatives([order])[0]

    def laplace(
        self, transfers: Sequence[Callable[[np.ndarray], np.ndarray]], scale: float
    ) -> list[Array]:
        """Responses of H(s), analytic off the negative axis, without their H(0) v terms.

        Step response: H(0) + int rho(r) exp(-r t) dr, rho(r) = Im H(r exp(i pi)) / (pi r).
        `scale` is the smallest exponent of s in H, for the reach of the slow tail.
        """

        def density(x: Array) -> Array:
            return np.array([np.imag(f(x + 1j * np.pi)) / np.pi for f in transfers])

        xs, ws = nodes(self.low - 40 / scale, self.low, 5, 60)
        xf, wf = nodes(self.high, self.high + 40, 5, 30)
        slow, fast = density(xs) @ ws, (density(xf) * np.exp(-xf)) @ wf
        return list(self.modes("rate", self.w * density(self.x), slow, fast))


def power_derivative(t: Array, k: float, order: float) -> Array:
    """D^a t^k = Gamma(k+1)/Gamma(k+1-a) t^(k-a): the closed form the tests use."""
    return gamma(k + 1) / gamma(k + 1 - order) * t ** (k - order)
