"""A spring that hardens or softens with the cube of its deflection."""

from __future__ import annotations

from collections.abc import Sequence

from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, rms
from ._port import Motion


class CubicStiffness(AbstractForce):
    r"""A spring's force beyond the linear one:

        f = -k_3 x³

    With k_3 > 0 the spring hardens (Duffing) and the resonance moves up with the amplitude; with
    k_3 < 0 it softens.

    Attributes:
        stiffness: k_3, one number [drive/response · response^-2].

    Source: Kovacic & Brennan, The Duffing Equation (2011), chapter 1.
    """

    stiffness: Parameter
    size = "stiffness"

    def __init__(self, stiffness: float = 1.0):
        self.stiffness = Parameter(stiffness, "drive/response*response^-2")

    def force(self, motion: Motion) -> Array:
        return -self.stiffness.value * motion.position**3


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    return [CubicStiffness(0.1 * rms(motion.drive) / rms(motion.position) ** 3)]


INSIDE = InsideEffect(
    name="cubic_stiffness",
    kind="force",
    sentence="the spring hardens or softens with the cube of its deflection, so that the resonance "
    "moves with the amplitude",
    equation="f = -k3 x^3",
    source="Kovacic & Brennan, The Duffing Equation (2011), chapter 1",
    trials=_trials,
    separated_by={
        "end_stop": "an amplitude ladder: a stop does nothing below its gap",
        "clearance": "small amplitudes, where a clearance is lost and a cube vanishes",
    },
)
