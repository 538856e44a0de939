"""A spring that is stiffer to one side."""

from __future__ import annotations

from collections.abc import Sequence

from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, rms
from ._port import Motion


class QuadraticStiffness(AbstractForce):
    r"""A spring's force beyond the linear one, the same to both sides:

        f = -k_2 x²

    A preload on a hardening spring, a curved membrane or an electrostatic gap makes a spring
    stiffer to one side; the mean position then moves with the amplitude.

    Attributes:
        stiffness: k_2, one number [drive/response · response^-1].

    Source: Nayfeh & Mook, Nonlinear Oscillations (1979), section 2.3.
    """

    stiffness: Parameter
    size = "stiffness"

    def __init__(self, stiffness: float = 1.0):
        self.stiffness = Parameter(stiffness, "drive/response*response^-1")

    def force(self, motion: Motion) -> Array:
        return -self.stiffness.value * motion.position**2


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    return [QuadraticStiffness(0.1 * rms(motion.drive) / rms(motion.position) ** 2)]


INSIDE = InsideEffect(
    name="quadratic_stiffness",
    kind="force",
    sentence="the spring is stiffer to one side, so that the mean position moves with the "
    "amplitude",
    equation="f = -k2 x^2",
    source="Nayfeh & Mook, Nonlinear Oscillations (1979), section 2.3",
    trials=_trials,
    separated_by={"position_dependent_gain": "free decay, in which only the spring acts"},
)
