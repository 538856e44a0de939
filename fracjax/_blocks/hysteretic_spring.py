"""A spring with hysteresis in a machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractInside, InsideEffect, rms
from ._machine import Motion

_PIECES = 2
"""Pieces of a step in which the hysteretic force is carried along; chosen by judgement."""


class HystereticSpring(AbstractInside):
    r"""A restoring force with hysteresis (Bouc–Wen), as of a bolted joint or a wire rope:

        f = -k_h d z,    d dz/dx = 1 - |z|^n (γ + (1-γ) sgn(z ẋ))

    d is the deflection at which the hysteretic force yields, and k_h its stiffness before.  γ = 1/2
    unloads with the initial stiffness, as elastic and plastic springs do; larger values unload more
    softly, values above 1 with a thinner loop.  Between samples z is carried by the rule of
    Runge–Kutta's fourth order along the way, in two pieces.

    Attributes:
        stiffness: k_h, one number [drive/response].
        deflection: d, one number [response].
        gamma: γ, one number, dimensionless.
        exponent: n, one number, dimensionless.

    Source: Ismail, Ikhouane & Rodellar, Arch. Comput. Methods Eng. 16 (2009) 161; Noël &
    Schoukens, Hysteretic benchmark with a dynamic nonlinearity (2016).
    """

    stiffness: Parameter
    deflection: Parameter
    gamma: Parameter
    exponent: Parameter
    size = "stiffness"

    def __init__(
        self,
        stiffness: float = 1.0,
        deflection: float = 1.0,
        gamma: float = 0.5,
        exponent: float = 1.0,
    ):
        self.stiffness = Parameter(stiffness, "drive/response")
        self.deflection = Parameter(
            deflection, "response", lower=1e-5 * deflection, upper=1e5 * deflection,
            logarithmic=True,
        )  # fmt: skip
        self.gamma = Parameter(gamma, lower=0.0, upper=5.0, plausible=(0.1, 1.5))
        self.exponent = Parameter(exponent, lower=1.0, upper=6.0, plausible=(1.0, 3.0))

    def memory(self) -> Any:
        return jnp.zeros(())

    def act(self, now: Motion, before: Motion, memory: Any, step: Any) -> tuple[Array, Any]:
        way = (now.position - before.position) / self.deflection.value
        part, direction, z = way / _PIECES, jnp.sign(way), memory

        def slope(z: Array) -> Array:
            size = jnp.abs(z)
            power = jnp.where(size > 0, jnp.where(size > 0, size, 1.0) ** self.exponent.value, 0.0)
            sign = jnp.sign(z) * direction
            return 1 - power * (self.gamma.value + (1 - self.gamma.value) * sign)

        for _ in range(_PIECES):
            a = slope(z)
            b = slope(z + part / 2 * a)
            c = slope(z + part / 2 * b)
            d = slope(z + part * c)
            z = z + part / 6 * (a + 2 * b + 2 * c + d)
        z = jnp.clip(z, -1.0, 1.0)
        return -self.stiffness.value * self.deflection.value * z, z


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    level, force = rms(motion.position - jnp.mean(motion.position)), 0.1 * rms(motion.drive)
    return [
        HystereticSpring(force / min(share, 1.0) / level, share * level, gamma)
        for share in (0.1, 0.4, 1.5)
        for gamma in (0.5, 0.9)
    ]


INSIDE = InsideEffect(
    name="hysteretic_spring",
    kind="force",
    sentence="a part of the spring yields and remembers, as a bolted joint or a wire rope does, so "
    "that stiffness and damping depend on the amplitude",
    equation="f = -k_h d z, d dz/dx = 1 - |z|^n (gamma + (1 - gamma) sgn(z v))",
    source="Ismail, Ikhouane & Rodellar, Arch. Comput. Methods Eng. 16 (2009) 161",
    trials=_trials,
    separated_by={
        "dry_friction": "a position held after a reversal: friction slips, a spring springs back",
    },
    one_sided=True,
)
