"""Base laws: columns that are linear in the gains, given the shape parameters.

Time in s, drive in V, displacement in um. The actuator has been at the constant u(0) for t < 0,
so every operator acts on the deviation v = u - u(0) (Caputo): D^a v = v at a = 0, and the
fractional integral (a < 0) starts from zero too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..drives import Array
from .branches import Sliding
from .paths import Path

OVER = 32  # fine steps per recorded sample
Params = dict[str, float]


def foh(path: Path, alpha: float, beta: float) -> list[Array]:
    """FOH [F 8, 9]: k_l u + k_h D^alpha u + k_p |du/dt| D^beta u."""
    hysteresis, rate = path.derivatives([alpha, beta])
    return [path.thin(path.v), hysteresis, path.thin(path.speed) * rate]


def coupled(path: Path, alpha: float, beta: float, mu: float) -> list[Array]:
    """FOH followed by fractional creep s^-mu [F 11, section 2.5]; k_c merged into the gains."""
    linear, hysteresis, rate = path.derivatives([-mu, alpha - mu, beta])
    product = path.thin(path.speed) * rate
    return [linear, hysteresis, Path(product, path.h * path.keep).derivative(-mu)]


def lfdh(path: Path, chi: float, mu: float, delta: float) -> list[Array]:
    """LFDH [L 9]: (g + g kappa s^delta) / (1 + chi s^mu); columns for g and g kappa."""
    pair = (
        lambda x: 1 / (1 + chi * np.exp(mu * x)),
        lambda x: np.exp(delta * x) / (1 + chi * np.exp(mu * x)),
    )
    one, two = path.laplace(pair, min(mu, delta))
    return [path.thin(path.v) + one, two]


def bouc_wen(path: Path, rho: float, sigma: float, n: float) -> list[Array]:
    """NBW [F 21, 22]: k_u u + k_h h, dh = rho (du - sigma |du| |h|^(n-1) h + (sigma-1) du |h|^n).

    Between reversals the law is autonomous in u, with z = h sign(du):
    dz/d(rho |du|) = 1 - z^n for z > 0 and 1 + (2 sigma - 1)|z|^n for z < 0.
    """
    kept = np.arange(0, len(path.v), path.keep)
    return [path.thin(path.v), Sliding(n, 2 * sigma - 1).along(path.v, rho, kept)]


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

    def response(self, u: Array, h: float, params: Params, keep: int = 1) -> Array:
        """Displacement in um on the fine grid or every `keep`th point of it, zero at t = 0."""
        shapes = {k: params[k] for k in self.shapes}
        if self.columns is coupled:  # its product needs the fine grid
            columns = [c[::keep] for c in coupled(Path(u, h), **shapes)]
        else:
            columns = self.columns(Path(u, h, keep), **shapes)
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
