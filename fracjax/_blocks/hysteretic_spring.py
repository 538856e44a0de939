"""A spring with hysteresis in a machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractInside, InsideEffect, positive, rms
from ._port import Motion

_FLAT = 1e-6
"""Rates below which an exponential is its series; the error is their square."""


class HystereticSpring(AbstractInside):
    r"""A restoring force with hysteresis (Bouc–Wen), as of a bolted joint or a wire rope:

        f = -k_h d z,    d dz/dx = 1 - (1 - β) |z| where the spring is loaded (z ẋ > 0),
                         d dz/dx = 1 + β |z| where it is relieved

    d is the deflection at which the hysteretic force yields and k_h its stiffness before.  With
    β = 0 it is relieved with the stiffness k_h, as elastic and plastic springs are, with β > 0
    faster; with β > 1 it hardens under load.  Along a way in one direction the equation is linear
    and is solved exactly.

    Attributes:
        stiffness: k_h, one number [drive/response].
        deflection: d, one number [response].
        release: β, one number, dimensionless.

    Source: Ismail, Ikhouane & Rodellar, Arch. Comput. Methods Eng. 16 (2009) 161, with the exponent
    1; Noël & Schoukens, Hysteretic benchmark with a dynamic nonlinearity (2016).
    """

    stiffness: Parameter
    deflection: Parameter
    release: Parameter
    size = "stiffness"
    is_placed = False

    def __init__(self, stiffness: float = 1.0, deflection: float = 1.0, release: float = 0.0):
        self.stiffness = positive(stiffness, "drive/response")
        self.deflection = positive(deflection, "response")
        self.release = Parameter(release, lower=0.0, upper=2.0, plausible=(0.0, 1.5))

    def memory(self) -> Any:
        return jnp.zeros(())

    def act(self, now: Motion, before: Motion, memory: Any, step: Any) -> tuple[Array, Any]:
        way = (now.position - before.position) / self.deflection.value
        direction, length, beta = jnp.sign(way), jnp.abs(way), self.release.value
        level = memory * direction
        # Relieved first, from a level below 0 to 0; then loaded.
        below = jnp.minimum(level, 0.0)
        flat = jnp.abs(beta) < _FLAT
        steep = jnp.where(flat, 1.0, beta)
        # A series to the first power of beta, so that the derivative by it holds too.
        series = -below * (1 + beta * below / 2)
        to_zero = jnp.where(flat, series, jnp.log1p(-steep * below) / steep)
        relieved = jnp.minimum(length, to_zero)
        falling = below * jnp.exp(-beta * relieved) + _grown(-beta, relieved)
        loaded = length - relieved
        rise = jnp.maximum(level, 0.0) * jnp.exp((beta - 1) * loaded) + _grown(beta - 1, loaded)
        z: Any = direction * jnp.where((level < 0) & (length < to_zero), falling, rise)
        z = jnp.where(direction == 0, memory, z)
        return -self.stiffness.value * self.deflection.value * z, z


def _grown(rate: Any, way: Any) -> Any:
    """(exp(rate way) - 1) / rate, also where the rate is 0."""
    flat = jnp.abs(rate) < _FLAT
    steep: Any = jnp.where(flat, 1.0, rate)
    return jnp.where(flat, way * (1 + rate * way / 2), jnp.expm1(rate * way) / steep)


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    level, force = rms(motion.position - jnp.mean(motion.position)), 0.1 * rms(motion.drive)
    return [
        HystereticSpring(force / min(share, 1.0) / level, share * level, release)
        for share in (0.1, 0.4, 1.5)
        for release in (0.0, 0.5, 1.1)
    ]


INSIDE = InsideEffect(
    name="hysteretic_spring",
    kind="force",
    sentence="a part of the spring yields and remembers, as a bolted joint or a wire rope does, so "
    "that stiffness and damping depend on the amplitude",
    equation="f = -k_h d z, d dz/dx = 1 - (1 - beta) |z| loaded, 1 + beta |z| relieved",
    source="Ismail, Ikhouane & Rodellar, Arch. Comput. Methods Eng. 16 (2009) 161",
    trials=_trials,
    separated_by={
        "dry_friction": "a position held after a reversal: friction slips, a spring springs back",
    },
    one_sided=True,
)
