"""Normalised Bouc–Wen hysteresis (NBW)."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._recursion import recursion, settled

_CELLS, _FARTHEST = 256, 23.0
"""Cells of the table of y, and the depth -ln(1 - y) of its end; its error is in BoucWen's
docstring."""
_GROUP = 32
"""Cells that the second search looks through; chosen by judgement."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
"""Gauss and Legendre's rule for the integral over one cell."""


def _log_level(depth: np.ndarray) -> np.ndarray:
    """ln y at depths -ln(1 - y)."""
    return np.log(np.maximum(-np.expm1(-depth), 1e-300))


# Depths -ln(1 - y), denser towards 0, where |y|^n has a kink; at the last one y is 1 - 1e-10.
_DEPTHS = _FARTHEST * np.linspace(0, 1, _CELLS + 1) ** 2
_HALVES = np.diff(_DEPTHS)[:, None] / 2
_INNER = _DEPTHS[:-1, None] + _HALVES * (1 + _NODES)
_SHARES = _HALVES * _WEIGHTS * np.exp(-_INNER)
_LOG_INNER, _LOG_NODES = _log_level(_INNER), _log_level(_DEPTHS)
_LEVELS = np.concatenate([np.expm1(-_DEPTHS[:0:-1]), -np.expm1(-_DEPTHS)])


class _Branch(NamedTuple):
    """y between two turns: y' = 1 - yⁿ for y > 0, y' = 1 + (2σ - 1) |y|ⁿ for y < 0, y(0) = 0.

    `travels` (C,) are the nodes, which increase through 0 in the middle; `values` (C, 4) are y, its
    slope, the travel at -y and the slope of that travel, all dimensionless.
    """

    travels: Array
    values: Array

    @classmethod
    def of(cls, sigma: Array, n: Array) -> _Branch:
        """The table for σ and n: travels are integrals of dy / y', by quadrature in every cell."""

        def slopes(log_levels: np.ndarray) -> tuple[Array, Array]:
            powers = n * log_levels
            return 1 + (2 * sigma - 1) * jnp.exp(powers), -jnp.expm1(powers)

        below, above = (jnp.cumsum(jnp.sum(_SHARES / s, 1)) for s in slopes(_LOG_INNER))
        falling, rising = slopes(_LOG_NODES)
        slope = jnp.concatenate([falling[:0:-1], rising])
        travels = jnp.concatenate([-below[::-1], jnp.zeros(1), above])
        level = jnp.asarray(_LEVELS, slope.dtype)
        return cls(travels, jnp.stack([level, slope, travels[::-1], -slope / slope[::-1]], axis=1))

    def level(self, travel: Array) -> Array:
        """y at a travel."""
        return self._at(travel, 0)

    def mirrored(self, travel: Array) -> Array:
        """The travel at -y."""
        return self._at(travel, 2)

    def _at(self, travel: Array, column: int) -> Array:
        """A column of `values`, by cubic interpolation of the nodes' values and slopes."""
        # Two short searches by comparison: bisection would fetch one number after the other.
        group = _GROUP * jnp.sum(travel >= self.travels[_GROUP:-1:_GROUP])
        inside = jax.lax.dynamic_slice(self.travels, (group,), (_GROUP,))
        cell = group + jnp.maximum(jnp.sum(travel >= inside) - 1, 0)
        start, end = self.values[cell], self.values[cell + 1]
        before = self.travels[cell]
        width = self.travels[cell + 1] - before
        t = (travel - before) / width
        ends = start[column] * (1 + 2 * t) * (1 - t) ** 2 + end[column] * t**2 * (3 - 2 * t)
        slopes = start[column + 1] * (1 - t) - end[column + 1] * t
        return ends + width * t * (1 - t) * slopes

    def advance(self, travel: Array, step_and_turn: tuple[Array, Array]) -> Array:
        """The travel after a step of the drive, which continues or begins with a turn."""
        step, turns = step_and_turn
        travel = jnp.where(turns, self.mirrored(travel), travel) + step
        return jnp.clip(travel, self.travels[0], self.travels[-1])


def _directions(increments: Array, grid: Grid) -> tuple[Array, Array]:
    """Each increment's sign (N,), where the increment is 0 the sign before; and whether it differs
    from the one before (N,)."""
    signs = jnp.sign(increments)

    def one(before: Array, sign: Array) -> tuple[Array, Array]:
        direction = jnp.where(sign == 0, before, sign)
        return direction, direction

    directions = jax.lax.scan(one, jnp.zeros((), signs.dtype), signs)[1]
    before = directions[-1] if grid.history == "periodic" else jnp.zeros(())
    return directions, directions * jnp.append(before, directions[:-1]) < 0


class BoucWen(AbstractBlock):
    r"""Normalised Bouc–Wen, rate-independent [F 21, 22]:

        H = k_u u + k_h h,   ḣ = ρ (u̇ - σ |u̇| |h|^(n-1) h + (σ-1) u̇ |h|^n),   n ≥ 1

    h(t=0) = 0, so that -1 ≤ h ≤ 1.  Only increments of u matter.  Between two turns of u,
    y = h sgn(u̇) is a function of the travel ρ ∫ |u̇| dt alone, the same function for all turns, with
    different starting points; a turn changes y to -y.  The equation is therefore solved once, as
    that function and its inverse, to 1e-7 of the bound (n up to 3; 3e-7 at n = 6), and every sample
    is looked up, however far u has moved since the last one.
    The paper's Table 2 has k_u = 0.0021924, k_h = -0.040845 and the default ρ, σ, n.  As printed it
    is not the loop of an actuator: k_u + ρ k_h < 0, in any unit of the drive, so that after each
    turn the response would first move against the drive.  Its k_u and k_h are therefore not the
    default.

    Attributes:
        k_u: gain of the drive, one number [response/drive].
        k_h: gain of the hysteresis, one number [response].
        rho: ρ, one number [1/drive].
        sigma: σ, one number, dimensionless.
        n: exponent, one number, dimensionless.

    Source: Xu et al., Fractal Fract. 8 (2024) 3, equations (21), (22); Ismail, Ikhouane & Rodellar,
    Arch. Comput. Methods Eng. 16 (2009) 161, also for the solution between two turns.
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
        branch = _Branch.of(self.sigma.value, self.n.value)
        increments = grid.changes(drive)
        directions, turns = _directions(increments, grid)
        steps = (self.rho.value * jnp.abs(increments), turns)
        start = jnp.zeros_like(branch.travels[-1])
        follow = settled if grid.history == "periodic" else recursion
        travels = follow(_Branch.advance, branch, start, steps)
        levels = jax.vmap(branch.level)(travels)
        return self.k_u.value * drive + self.k_h.value * directions * levels
