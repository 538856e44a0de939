"""Truths by numerics of their own: diffusive fractional operators, Bouc-Wen, physical effects.

Time in s, drive in V, displacement in um. The actuator has been at the constant u(0) for t < 0,
so every operator acts on the deviation v = u - u(0) (Caputo): D^a v = v at a = 0, and the
fractional integral (a < 0) starts from zero too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.signal import cont2discrete, fftconvolve, lfilter
from scipy.special import gamma

from .drives import Array, Signal

OVER = 32  # fine steps per recorded sample
Params = dict[str, float]


def _nodes(low: float, high: float, order: int, panels: int) -> tuple[Array, Array]:
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
    """

    def __init__(self, u: Array, h: float, keep: int = 1, cache: bool = False) -> None:
        self.u, self.h, self.keep, self.cache = u, h, keep, cache
        self.v = u - u[0]
        self.low, self.high = np.log(1e-6 / (h * len(u))), np.log(50 / h)
        panels = int(np.ceil((self.high - self.low) / np.log(10)))
        self.x, self.w = _nodes(self.low, self.high, 5, panels)
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

    def modes(self, kind: str, weights: Array, slow: float, fast: float) -> Array:
        """sum_j weights_j z_j + slow * integral(w) + fast * w, on the kept grid."""
        ends = (self.v, self.rate) if kind == "rate" else (self.area, self.v)
        out = slow * self.thin(ends[0]) + fast * self.thin(ends[1])
        if self.cache:
            if kind not in self._store:
                rows = [self.thin(self._mode(kind, r)) for r in np.exp(self.x)]
                self._store[kind] = np.array(rows)
            return out + weights @ self._store[kind]
        for r, c in zip(np.exp(self.x), weights, strict=True):
            out = out + c * self.thin(self._mode(kind, r))
        return out

    def derivative(self, order: float) -> Array:
        """Caputo D^a v, -0.9 <= a <= 0.9, in V s^-a (integral for a < 0).

        t^-p / Gamma(1-p) = sin(pi p)/pi int_0^inf r^(p-1) exp(-r t) dr acts on dv/dt with p = a
        for a > 0, and on v with p = 1 + a for a < 0.
        """
        if order == 0.0:
            return self.thin(self.v)
        kind, p = ("rate", order) if order > 0 else ("value", 1 + order)
        c = np.sin(np.pi * p) / np.pi
        slow, fast = np.exp(p * self.low) / p, np.exp((p - 1) * self.high) / (1 - p)
        return self.modes(kind, c * self.w * np.exp(p * self.x), c * slow, c * fast)

    def laplace(self, transfer: Callable[[np.ndarray], np.ndarray], scale: float) -> Array:
        """Response of H(s), analytic off the negative axis, without its H(0) v term.

        Step response: H(0) + int rho(r) exp(-r t) dr, rho(r) = Im H(r exp(i pi)) / (pi r).
        `scale` is the smallest exponent of s in H, for the reach of the slow tail.
        """

        def density(x: Array) -> Array:
            return np.imag(transfer(x + 1j * np.pi)) / np.pi

        xs, ws = _nodes(self.low - 40 / scale, self.low, 5, 60)
        xf, wf = _nodes(self.high, self.high + 40, 5, 30)
        slow, fast = float(ws @ density(xs)), float(wf @ (density(xf) * np.exp(-xf)))
        return self.modes("rate", self.w * density(self.x), slow, fast)


# ---- base laws: columns that are linear in the gains, given the shape parameters -------------


def foh(path: Path, alpha: float, beta: float) -> list[Array]:
    """FOH [F 8, 9]: k_l u + k_h D^alpha u + k_p |du/dt| D^beta u."""
    product = path.thin(path.speed) * path.derivative(beta)
    return [path.thin(path.v), path.derivative(alpha), product]


def coupled(path: Path, alpha: float, beta: float, mu: float) -> list[Array]:
    """FOH followed by fractional creep s^-mu [F 11, section 2.5]; k_c merged into the gains."""
    product = path.thin(path.speed) * path.derivative(beta)
    slow = Path(product, path.h * path.keep).derivative(-mu)
    return [path.derivative(-mu), path.derivative(alpha - mu), slow]


def lfdh(path: Path, chi: float, mu: float, delta: float) -> list[Array]:
    """LFDH [L 9]: (g + g kappa s^delta) / (1 + chi s^mu); columns for g and g kappa."""
    least = min(mu, delta)
    one = path.laplace(lambda x: 1 / (1 + chi * np.exp(mu * x)), least)
    two = path.laplace(lambda x: np.exp(delta * x) / (1 + chi * np.exp(mu * x)), least)
    return [path.thin(path.v) + one, two]


def bouc_wen(path: Path, rho: float, sigma: float, n: float, most: float = 0.1) -> list[Array]:
    """NBW [F 21, 22]: k_u u + k_h h, dh = rho (du - sigma |du| |h|^(n-1) h + (sigma-1) du |h|^n).

    RK4 in the drive, sub-stepped to rho |du| <= most, stopping at kept samples and reversals
    (between them the law is autonomous in u).
    """
    up = np.sign(np.diff(path.v))
    turns = np.flatnonzero(up[1:] != up[:-1]) + 1
    kept = np.arange(0, len(path.v), path.keep)
    stops = np.union1d(turns, kept)
    h, out = 0.0, [0.0]
    for du in np.diff(path.v[stops]).tolist():
        if du:
            k = int(np.ceil(rho * abs(du) / most))
            s, d = (sigma if du > 0 else -sigma), rho * du / k

            def slope(y: float, s: float = s) -> float:
                a = abs(y) ** n
                return 1.0 + (sigma - 1.0) * a - (s * a if y > 0 else -s * a)

            for _ in range(k):
                k1 = slope(h)
                k2 = slope(h + 0.5 * d * k1)
                k3 = slope(h + 0.5 * d * k2)
                h += d / 6 * (k1 + 2 * k2 + 2 * k3 + slope(h + d * k3))
        out.append(h)
    return [path.thin(path.v), np.array(out)[np.searchsorted(stops, kept)]]


@dataclass(frozen=True)
class Base:
    """A base law: its columns, shape-parameter names with bounds, gains (um per column unit).

    `nominal` and `spread` give the shapes and gains that seeds draw from (uniform, relative).
    """

    columns: Callable[..., list[Array]]
    shapes: dict[str, tuple[float, float]]
    nominal: tuple[float, ...]
    gains: dict[str, float]
    thinning: int = OVER  # of the cached fit grid

    def draw(self, rng: np.random.Generator, spread: float = 0.2) -> Params:
        """Parameters within +-spread of nominal."""
        values = dict(zip(self.shapes, self.nominal, strict=True)) | self.gains
        return {k: float(x * rng.uniform(1 - spread, 1 + spread)) for k, x in values.items()}

    def response(self, u: Array, h: float, params: Params) -> Array:
        """Displacement in um on the fine grid, zero at t = 0."""
        columns = self.columns(Path(u, h), **{k: params[k] for k in self.shapes})
        return sum(params[g] * c for g, c in zip(self.gains, columns, strict=True))


_ORDER = (-0.85, 0.85)
BASES: dict[str, Base] = {
    "foh": Base(
        foh,
        {"alpha": _ORDER, "beta": _ORDER},
        (0.14, -0.13),
        {"k_l": 0.07, "k_h": 0.04, "k_p": 1.5e-6},
    ),
    "lfdh": Base(
        lfdh,
        {"chi": (1e-3, 10.0), "mu": (0.05, 0.95), "delta": (0.01, 0.95)},
        (0.2, 0.4, 0.08),
        {"g": 0.03, "g_kappa": 0.12},
    ),
    "coupled": Base(
        coupled,
        {"alpha": (-0.7, 0.7), "beta": _ORDER, "mu": (0.0, 0.15)},
        (0.14, -0.13, 0.02),
        {"k_l": 0.07, "k_h": 0.04, "k_p": 1.5e-6},
        OVER // 8,
    ),
    "bouc_wen": Base(
        bouc_wen,
        {"rho": (1e-3, 2.0), "sigma": (0.5, 5.0), "n": (1.0, 4.0)},
        (0.05, 1.3, 1.6),
        {"k_u": 0.12, "k_h": -0.9},
    ),
}

# ---- effects ---------------------------------------------------------------------------------


def drive_lag(drive: Signal, t: Array, tau: float) -> Array:
    """Amplifier RC: tau dw/dt + w = u, exact for piecewise-linear u; tau in s."""
    v = drive(t)
    return v[0] + _relax(v - v[0], t[1] - t[0], tau)


def _relax(v: Array, h: float, tau: float) -> Array:
    """tau w' + w = v from rest, v piecewise linear."""
    if tau <= 0:
        return v
    x = h / tau
    c = -np.expm1(-x)
    last = 1 - c / x if x > 1e-4 else x / 2
    return lfilter([last, c - last], [1.0, -np.exp(-x)], v)


def delay(drive: Signal, t: Array, dead: float) -> Array:
    """Pure delay: u(t - dead), dead in s; the drive is constant before t = 0."""
    return drive(t - dead)


def electrostriction(drive: Signal, t: Array, q: float, u0: float) -> Array:
    """u + q (u - u0)^2; q in 1/V, u0 in V."""
    v = drive(t)
    return v + q * (v - u0) ** 2


def saturation(drive: Signal, t: Array, u_max: float, width: float) -> Array:
    """Amplifier limit min(u, u_max), rounded: u - w ln(1 + exp((u - u_max)/w)); in V."""
    v = drive(t)
    if width <= 0:
        return np.minimum(v, u_max)
    return v - width * np.logaddexp(0.0, (v - u_max) / width)


def play(v: Array, radius: float) -> Array:
    """Play from p(0) = v(0): p = max(v - r, min(v + r, p_before)), branch by branch."""
    up = np.sign(np.diff(v))
    stops = np.concatenate([[0], np.flatnonzero(up[1:] != up[:-1]) + 1, [len(v) - 1]])
    p = np.full_like(v, v[0])
    for a, b in pairwise(stops):
        part = slice(a, b + 1)
        p[part] = np.clip(p[a], v[part] - radius, v[part] + radius)
    return p


def minor_loop_memory(drive: Signal, t: Array, weight: float, radii: list[float]) -> Array:
    """u + weight * mean_i (play(u, r_i) - u); radii in V, weight without unit."""
    v = drive(t)
    return v + weight * (sum(play(v, r) for r in radii) / len(radii) - v)


def creep(t: Array, y: Array, gain: float, t0: float) -> Array:
    """Log law: each increment dy is followed by dy * gain * log10(1 + t/t0); gain per decade."""
    h = t[1] - t[0]
    s = np.arange(len(t)) * h
    primitive = (s + t0) * np.log1p(s / t0) - s  # of ln(1 + s/t0): exact for linear pieces
    kernel = np.diff(primitive) / (h * np.log(10))
    return y + gain * np.append(0.0, fftconvolve(np.diff(y), kernel)[: len(y) - 1])


def creep_kelvin_voigt(t: Array, y: Array, gain: float, taus: list[float]) -> Array:
    """Creep by Kelvin-Voigt elements in series: y + gain * sum_i y/(1 + tau_i d/dt); taus in s."""
    x = y - y[0]
    return y + gain * sum(_relax(x, t[1] - t[0], tau) for tau in taus)


def resonance(t: Array, y: Array, period: float, zeta: float) -> Array:
    """Mass-spring-damper x'' + 2 zeta w x' + w^2 x = w^2 y, w = 2 pi/period, from rest."""
    if period <= 0:
        return y
    w = 2 * np.pi / period
    h = t[1] - t[0]
    num, den, _ = cont2discrete(([w * w], [1.0, 2 * zeta * w, w * w]), h, method="foh")
    return y[0] + lfilter(np.ravel(num), den, y - y[0])


def thermal_drift(t: Array, y: Array, size: float, tau: float, slope: float) -> Array:
    """y + size (1 - exp(-t/tau) + slope t); size in um, tau in s, slope in 1/s."""
    return y + size * (-np.expm1(-t / tau) + slope * t)


def mains_interference(
    t: Array, y: Array, size: float, frequency: float, ratios: list[float], phases: list[float]
) -> Array:
    """y + size * sum_k ratio_k sin(2 pi k f t + phase_k), k = 1..5; size in um, f in Hz."""
    lines = enumerate(zip(ratios, phases, strict=True), start=1)
    return y + size * sum(c * np.sin(2 * np.pi * k * frequency * t + p) for k, (c, p) in lines)


@dataclass(frozen=True)
class Effect:
    """An effect: on the drive (`side` "I": f(drive, t, ...)) or response ("O", "A": f(t, y, ...)).

    `parameters(a, shape, u_low, u_high, stroke)` gives its physical parameters at amplitude a in
    [0, cap]; zero is the identity. `shape(rng)` draws everything that is not amplitude.
    """

    side: str
    apply: Callable[..., Array]
    parameters: Callable[..., dict]
    shape: Callable[[np.random.Generator], dict]
    cap: float

    def simulate(self, drive: Signal, t: Array, base: Base, law: Params, params: dict) -> Array:
        """Displacement in um on the fine grid t."""
        u = self.apply(drive, t, **params) if self.side == "I" else drive(t)
        y = base.response(u, t[1] - t[0], law)
        return y if self.side == "I" else self.apply(t, y, **params)


def _plain(name: str) -> Callable[..., dict]:
    return lambda a, shape, low, high, stroke: {name: a} | shape


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _mains_shape(rng: np.random.Generator) -> dict:
    return {
        "frequency": float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05)),
        "ratios": [1.0, *rng.uniform(0.1, 0.5, 4).tolist()],
        "phases": rng.uniform(0, 2 * np.pi, 5).tolist(),
    }


EFFECTS: dict[str, Effect] = {
    "creep": Effect("O", creep, _plain("gain"), lambda g: {"t0": _log(g, 0.03, 0.3)}, 0.04),
    "creep_kelvin_voigt": Effect(
        "O",
        creep_kelvin_voigt,
        _plain("gain"),
        lambda g: {"taus": [_log(g, 0.7 * x, 1.4 * x) for x in (0.05, 0.3, 1.5, 8.0)]},
        0.04,
    ),
    "drive_lag": Effect("I", drive_lag, _plain("tau"), lambda g: {}, 5e-3),
    "delay": Effect("I", delay, _plain("dead"), lambda g: {}, 6e-3),
    "resonance": Effect(
        "O", resonance, _plain("period"), lambda g: {"zeta": _log(g, 0.01, 0.1)}, 1 / 100
    ),
    "electrostriction": Effect(
        "I",
        electrostriction,
        lambda a, s, lo, hi, y: {"q": 2 * a / (hi - lo), "u0": lo + s["where"] * (hi - lo)},
        lambda g: {"where": float(g.uniform(0.3, 0.7))},
        0.1,
    ),
    "minor_loop_memory": Effect(
        "I",
        minor_loop_memory,
        lambda a, s, lo, hi, y: {"weight": a, "radii": [x * (hi - lo) for x in s["radii"]]},
        lambda g: {"radii": np.sort(np.exp(g.uniform(*np.log([0.02, 0.5]), 6))).tolist()},
        0.3,
    ),
    "saturation": Effect(
        "I",
        saturation,
        lambda a, s, lo, hi, y: {"u_max": hi - a * (hi - lo), "width": s["soft"] * a * (hi - lo)},
        lambda g: {"soft": float(g.uniform(0.02, 0.15))},
        0.3,
    ),
    "thermal_drift": Effect(
        "A",
        thermal_drift,
        lambda a, s, lo, hi, y: {"size": a * y} | s,
        lambda g: {"tau": _log(g, 2, 60), "slope": float(g.uniform(0, 0.05))},
        0.2,
    ),
    "mains_interference": Effect(
        "A",
        mains_interference,
        lambda a, s, lo, hi, y: {"size": a * y} | s,
        _mains_shape,
        0.05,
    ),
}


def noise(kind: str, n: int, sd: float, rng: np.random.Generator) -> Array:
    """Noise of standard deviation sd: white, ar (AR(1), 0.6), heavy (Student t, 4), varying."""
    e = rng.standard_normal(n)
    if kind == "ar":
        return (
            sd * np.sqrt(1 - 0.36) * lfilter([1.0], [1.0, -0.6], rng.standard_normal(n + 99))[99:]
        )
    if kind == "heavy":
        return sd * rng.standard_t(4, n) / np.sqrt(2.0)
    if kind == "varying":
        size = 1 + 0.6 * np.sin(2 * np.pi * (np.arange(n) / n * 3 + rng.uniform()))
        return sd * e * size / np.sqrt(1 + 0.18)
    if kind == "white":
        return sd * e
    raise ValueError(f"noise is white, ar, heavy or varying, not {kind!r}")


def power_derivative(t: Array, k: float, order: float) -> Array:
    """D^a t^k = Gamma(k+1)/Gamma(k+1-a) t^(k-a): the closed form the tests use."""
    return gamma(k + 1) / gamma(k + 1 - order) * t ** (k - order)
