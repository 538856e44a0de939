"""Dry friction on a moving mass: Coulomb's with Stribeck's effect, and LuGre's bristles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, positive, rms
from ._port import Motion


class DryFriction(AbstractForce):
    r"""Coulomb's friction, stronger where the motion is slow (Stribeck):

        f = -f_c (1 + r exp(-(v/v_s)²)) max(-1, min(1, v/v_0))

    Below v_0 the friction is viscous, so steep that the motion seems to stick.

    Args:
        force_level: initial f_c.
        creep: initial v_0.
        excess: initial r; 0 is Coulomb's friction, and stays.
        stribeck: initial v_s.

    Attributes:
        coulomb: f_c, one number [drive].
        creep: v_0, one number [response/s].
        excess: r, by which share friction at rest is larger, one number, dimensionless.
        stribeck: v_s, one number [response/s].

    Source: Armstrong-Hélouvry, Dupont & Canudas de Wit, Automatica 30 (1994) 1083.
    """

    coulomb: Parameter
    creep: Parameter
    excess: Parameter
    stribeck: Parameter
    size = "coulomb"
    is_placed = False
    sticks = True

    def __init__(
        self,
        force_level: float = 1.0,
        creep: float = 1e-2,
        excess: float = 0.0,
        stribeck: float = 1.0,
    ):
        plain = excess == 0
        self.coulomb = positive(force_level, "drive")
        self.creep = positive(creep, "response*s^-1")
        self.excess = Parameter(excess, lower=0.0, upper=10.0, plausible=(0.0, 1.0), fixed=plain)
        self.stribeck = positive(stribeck, "response*s^-1", fixed=plain)

    def force(self, motion: Motion) -> Array:
        slow = jnp.exp(-((motion.velocity / self.stribeck.value) ** 2))
        level = self.coulomb.value * (1 + self.excess.value * slow)
        return -level * jnp.clip(motion.velocity / self.creep.value, -1.0, 1.0)


class LuGre(AbstractInside):
    r"""Friction as the deflection z of bristles, which bend before they slip:

        f = -σ_0 z,    dz/dt = v - |v| z σ_0/(f_c (1 + r exp(-(v/v_s)²)))

    Between samples the velocity is taken as constant, and z then approaches its limit exactly.

    Args:
        force_level: initial f_c.
        presliding: initial f_c/σ_0.
        excess: initial r; 0 is Dahl's friction, and stays.
        stribeck: initial v_s.

    Attributes:
        coulomb: f_c, one number [drive].
        presliding: f_c/σ_0, the way in which the force builds up, one number [response].
        excess: r, by which share friction at rest is larger, one number, dimensionless.
        stribeck: v_s, one number [response/s].

    Source: Canudas de Wit, Olsson, Åström & Lischinsky, IEEE Trans. Autom. Control 40 (1995) 419.
    """

    coulomb: Parameter
    presliding: Parameter
    excess: Parameter
    stribeck: Parameter
    size = "coulomb"
    is_placed = False

    def __init__(
        self,
        force_level: float = 1.0,
        presliding: float = 1.0,
        excess: float = 0.0,
        stribeck: float = 1.0,
    ):
        plain = excess == 0
        self.coulomb = positive(force_level, "drive")
        self.presliding = positive(presliding, "response")
        self.excess = Parameter(excess, lower=0.0, upper=10.0, plausible=(0.0, 1.0), fixed=plain)
        self.stribeck = positive(stribeck, "response*s^-1", fixed=plain)

    def memory(self) -> Any:
        return jnp.zeros(())

    def act(self, now: Motion, before: Motion, memory: Any, step: Any) -> tuple[Array, Any]:
        way = now.position - before.position
        slow = jnp.exp(-((now.velocity / self.stribeck.value) ** 2))
        limit = (1 + self.excess.value * slow) * jnp.sign(way)
        kept = jnp.exp(-jnp.abs(way) / (self.presliding.value * (1 + self.excess.value * slow)))
        bent = limit + (memory - limit) * kept
        return -self.coulomb.value * bent, bent


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    speed, level = rms(motion.velocity), rms(motion.position - jnp.mean(motion.position))
    force = 0.1 * rms(motion.drive)
    plain = [DryFriction(force, share * speed) for share in (0.003, 0.03, 0.3)]
    stribeck = [DryFriction(force, 0.01 * speed, 0.5, share * speed) for share in (0.1, 0.5)]
    bristles = [LuGre(force, share * level) for share in (0.01, 0.1)]
    return [*plain, *stribeck, *bristles]


INSIDE = InsideEffect(
    name="dry_friction",
    kind="force",
    sentence="dry friction of a guide or joint acts against the motion with a force that hardly "
    "depends on its speed",
    equation="f = -f_c (1 + r exp(-(v/v_s)^2)) clip(v/v_0, -1, 1), or f = -f_c z with "
    "dz = (1 - z sgn v/(1 + r exp(-(v/v_s)^2))) dx/lambda",
    source="Armstrong-Helouvry et al., Automatica 30 (1994) 1083; Canudas de Wit et al., IEEE "
    "Trans. Autom. Control 40 (1995) 419",
    trials=_trials,
    separated_by={
        "quadratic_damping": "a free decay: friction takes off the same amplitude in each cycle",
        "hysteretic_spring": "a position held after a reversal: friction slips, a spring springs "
        "back",
    },
    one_sided=True,
)
