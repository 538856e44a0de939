"""A drive whose force depends on the position."""

from __future__ import annotations

from collections.abc import Sequence

from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, rms
from ._port import Motion


class PositionDependentGain(AbstractForce):
    r"""The force per drive varies along the stroke, as a voice coil's at the ends of its field:

        f = (a x + b x²) u

    Attributes:
        slope: a, one number [response^-1].
        curvature: b over a, one number [response^-1].

    Source: Klippel, J. Audio Eng. Soc. 54 (2006) 907, force factor Bl(x).
    """

    slope: Parameter
    curvature: Parameter
    size = "slope"

    def __init__(self, slope: float = 1.0, curvature: float = 0.0):
        self.slope = Parameter(slope, "response^-1")
        self.curvature = Parameter(curvature, "response^-1")

    def force(self, motion: Motion) -> Array:
        x = motion.position
        return self.slope.value * x * (1 + self.curvature.value * x) * motion.drive


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    level = rms(motion.position)
    return [PositionDependentGain(0.1 / level, share / level) for share in (0.0, 3.0, -3.0)]


INSIDE = InsideEffect(
    name="position_dependent_gain",
    kind="force",
    sentence="the force that a drive makes depends on the position, as in a coil that leaves its "
    "magnet's field",
    equation="f = (a x + b x^2) u",
    source="Klippel, J. Audio Eng. Soc. 54 (2006) 907",
    trials=_trials,
    separated_by={"quadratic_stiffness": "free decay, in which only the spring acts"},
)
