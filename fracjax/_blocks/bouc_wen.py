"""Normalised Bouc–Wen hysteresis (NBW)."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock

_SUBSTEPS = 4
_RUN_IN = 12
_STIFF = 2.7
"""Beyond 2.8 the Runge–Kutta step is unstable, and its derivatives grow without end."""


class BoucWen(AbstractBlock):
    r"""Normalised Bouc–Wen, rate-independent [F 21, 22]:

        H = k_u u + k_h h,   ḣ = ρ (u̇ - σ |u̇| |h|^(n-1) h + (σ-1) u̇ |h|^n),   n ≥ 1

    k_u [response/drive], k_h [response], ρ [1/drive], σ and n dimensionless, h(t=0) = 0, so that
    -1 ≤ h ≤ 1.  Only increments of u matter; each is split into 4 Runge–Kutta steps, of fourth
    order where h keeps its sign and of order n + 1 where it crosses 0: |h|^n has a kink there.
    Where h relaxes within one of them, the step is the exponential one of the slope's tangent.
    The paper's Table 2 has k_u = 0.0021924, k_h = -0.040845 and the default ρ, σ, n.  As printed it
    is no actuator's loop: k_u + ρ k_h < 0, in any unit of the drive, so that after each turn the
    response would first run against the drive.  Its k_u and k_h are therefore not the default.
    Source: Xu et al., Fractal Fract. 8 (2024) 3, equations (21), (22); Ismail, Ikhouane & Rodellar,
    Arch. Comput. Methods Eng. 16 (2009) 161.
    """

    k_u: Parameter
    k_h: Parameter
    rho: Parameter
    sigma: Parameter
    n: Parameter

    def __init__(
        self,
        k_u: float = 1.0,
        k_h: float = -1.0,
        rho: float = 0.19028,
        sigma: float = 1.288,
        n: float = 1.6504,
    ):
        self.k_u = Parameter(k_u, "response/drive", gain=True)
        self.k_h = Parameter(k_h, "response", gain=True)
        self.rho = Parameter(
            rho, "1/drive", lower=1e-5, upper=1e3, plausible=(1e-3, 3.0), logarithmic=True
        )
        self.sigma = Parameter(sigma, lower=0.5, upper=20.0, plausible=(0.6, 5.0))
        self.n = Parameter(n, lower=1.0, upper=6.0, plausible=(1.05, 3.0))

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        rho, sigma, n = self.rho.value, self.sigma.value, self.n.value

        def slope(h, increment):
            # A step far too long for h must not leave ±1, which bound it; and |h| is kept off 0,
            # where |h|^n has no derivative in n.
            h = jnp.clip(h, -1.0, 1.0)
            size = jnp.maximum(jnp.abs(h), 1e-12)
            power = size ** (n - 1)
            loss = sigma * jnp.sign(increment) * power * h
            return rho * increment * (1 - loss + (sigma - 1) * power * size)

        def tangent(h, increment):
            """Derivative of the slope in h, never above 0 for σ ≥ 1/2."""
            power = jnp.maximum(jnp.abs(h), 1e-12) ** (n - 1)
            loss = sigma * jnp.abs(increment) - (sigma - 1) * increment * jnp.sign(h)
            return -rho * n * power * loss

        def step(h, increment):
            a = slope(h, increment)
            b = slope(h + a / 2, increment)
            c = slope(h + b / 2, increment)
            d = slope(h + c, increment)
            moved = (a + 2 * b + 2 * c + d) / 6
            rate = jnp.minimum(tangent(h, increment), -_STIFF)
            is_stiff = rho * n * jnp.abs(increment) > _STIFF  # the rate at the bound
            moved = jnp.where(is_stiff, a * jnp.expm1(rate) / rate, moved)
            h = jnp.clip(h + moved, -1.0, 1.0)
            return h, h

        before = {"rest": 0.0, "constant": drive[0], "periodic": drive[-1]}[grid.history]
        increments = jnp.repeat(jnp.diff(drive, prepend=before) / _SUBSTEPS, _SUBSTEPS)
        start = jnp.zeros(())
        if grid.history == "periodic":
            # The state before the record, once further cycles no longer change it.
            cycles = jnp.tile(increments, _RUN_IN)
            start, _ = jax.lax.scan(step, start, cycles)
        _, state = jax.lax.scan(step, start, increments)
        return self.k_u.value * drive + self.k_h.value * state[_SUBSTEPS - 1 :: _SUBSTEPS]
