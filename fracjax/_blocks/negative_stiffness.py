"""A spring that pushes away from its middle."""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, positive, rms
from ._port import Motion


class NegativeStiffness(AbstractForce):
    r"""Compressed springs across the motion push the mass away from the middle:

        f = κ x a/√(a² + x²)

    At the middle they take κ off the stiffness, far from it nothing.  Where κ exceeds the spring's
    stiffness the mass has two rests and snaps from one to the other.

    Attributes:
        stiffness: κ, one number [drive/response].
        width: a, one number [response].

    Source: Carrella, Brennan & Waters, J. Sound Vib. 301 (2007) 678, oblique springs.
    """

    stiffness: Parameter
    width: Parameter
    size = "stiffness"

    def __init__(self, stiffness: float = 1.0, width: float = 1.0):
        self.stiffness = positive(stiffness, "drive/response")
        self.width = positive(width, "response")

    def force(self, motion: Motion) -> Array:
        x, a = motion.position, self.width.value
        return self.stiffness.value * x * a / jnp.sqrt(a**2 + x**2)


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    level, force = rms(motion.position), 0.1 * rms(motion.drive)
    return [
        NegativeStiffness(force / level / min(share, 1.0), share * level)
        for share in np.geomspace(0.1, 1.0, 4)
    ]


INSIDE = InsideEffect(
    name="negative_stiffness",
    kind="force",
    sentence="springs across the motion, or a magnet, push away from the middle, so that the "
    "machine is softer there and may have two rests",
    equation="f = kappa x a/sqrt(a^2 + x^2)",
    source="Carrella, Brennan & Waters, J. Sound Vib. 301 (2007) 678",
    trials=_trials,
    separated_by={
        "cubic_stiffness": "large amplitudes, where a cube keeps growing and these springs do not",
        "clearance": "amplitudes of the gap's size, at which a clearance has a corner",
    },
    one_sided=True,
)
