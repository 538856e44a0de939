"""Drag that grows with the square of the speed."""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, positive, rms
from ._port import Motion


class QuadraticDamping(AbstractForce):
    r"""Drag in a fluid, or the throttle of a damper:

        f = -c_2 v |v|

    Attributes:
        drag: c_2, one number [drive/response² · s²].

    Source: Nayfeh & Mook, Nonlinear Oscillations (1979), section 3.3.3.
    """

    drag: Parameter
    size = "drag"
    is_placed = False

    def __init__(self, drag: float = 1.0):
        self.drag = positive(drag, "drive/response*response^-1*s^2")

    def force(self, motion: Motion) -> Array:
        return -self.drag.value * motion.velocity * jnp.abs(motion.velocity)


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    return [QuadraticDamping(0.1 * rms(motion.drive) / rms(motion.velocity) ** 2)]


INSIDE = InsideEffect(
    name="quadratic_damping",
    kind="force",
    sentence="drag grows with the square of the speed, so that large motions are damped more",
    equation="f = -c2 v |v|",
    source="Nayfeh & Mook, Nonlinear Oscillations (1979), section 3.3.3",
    trials=_trials,
    separated_by={
        "dry_friction": "a free decay: drag fades with the amplitude, friction does not",
    },
    one_sided=True,
)
