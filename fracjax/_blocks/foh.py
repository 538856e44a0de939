"""Fractional-order hysteresis (FOH) of Xu et al. 2024."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from .._operators import Grid, derivative, rate
from .._parameters import Parameter
from ._block import AbstractBlock

_ORDER = 0.95


class FOH(AbstractBlock):
    r"""Linear part plus fractional part plus a rate-weighted fractional part [F 8, 9]:

        f(u) = k_l u + k_h D^α u + k_p |u̇| D^β u

    k_l [response/drive], k_h [response/drive · s^α], k_p [response/drive² · s^(1+β)];
    orders -0.95 < α, β < 0.95.  |u̇| is differentiated as JAX does at its kink (0 there).
    Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, equations (8) and (9).
    """

    k_l: Parameter
    k_h: Parameter
    k_p: Parameter
    alpha: Parameter
    beta: Parameter

    def __init__(
        self,
        k_l: float = 0.5,
        k_h: float = 0.5,
        k_p: float = 0.0,
        alpha: float = 0.1,
        beta: float = -0.1,
    ):
        self.k_l = Parameter(k_l, "response/drive", gain=True)
        self.k_h = Parameter(k_h, "response/drive*s^alpha", gain=True)
        self.k_p = Parameter(k_p, "response/drive^2*s^(1+beta)", gain=True)
        self.alpha = Parameter(alpha, lower=-_ORDER, upper=_ORDER, plausible=(-0.6, 0.6))
        self.beta = Parameter(beta, lower=-_ORDER, upper=_ORDER, plausible=(-0.8, 0.8))

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        fractional = derivative(self.alpha.value, drive, grid)
        rate_weighted = jnp.abs(rate(drive, grid)) * derivative(self.beta.value, drive, grid)
        return self.k_l.value * drive + self.k_h.value * fractional + self.k_p.value * rate_weighted
