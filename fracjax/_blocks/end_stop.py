"""Stops that limit a motion."""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, positive, rms
from ._port import Motion


class EndStop(AbstractForce):
    r"""A stop is met beyond a gap, at one side:

        f = -k_s max(0, ±x - g)

    Two stops are two such effects.

    Args:
        stiffness: initial k_s.
        gap: initial g.
        side: 1 for a stop towards positive positions, -1 for the other.

    Attributes:
        stiffness: k_s, one number [drive/response].
        gap: g, the way to the stop, one number [response].
        side: ±1, dimensionless.

    Source: Shaw & Holmes, J. Sound Vib. 90 (1983) 129.
    """

    stiffness: Parameter
    gap: Parameter
    side: Parameter
    size = "stiffness"

    def __init__(self, stiffness: float = 1.0, gap: float = 1.0, side: float = 1.0):
        self.stiffness = positive(stiffness, "drive/response")
        self.gap = positive(gap, "response")
        self.side = Parameter(side, fixed=True)

    def force(self, motion: Motion) -> Array:
        side = self.side.value
        beyond = jnp.maximum(side * motion.position - self.gap.value, 0.0)
        return -self.stiffness.value * side * beyond


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    position, force = np.asarray(motion.position), 0.1 * rms(motion.drive)
    level = rms(position)
    reach = {side: max(float((side * position).max()), 1e-9 * level) for side in (1.0, -1.0)}
    return [
        EndStop(force / (0.1 * level), share * way, side)
        for side, way in reach.items()
        for share in (0.5, 0.7, 0.9)
    ]


INSIDE = InsideEffect(
    name="end_stop",
    kind="force",
    sentence="the motion meets a stop, beyond which the stiffness is larger",
    equation="f = -k_s max(0, x - g), or its mirror image",
    source="Shaw & Holmes, J. Sound Vib. 90 (1983) 129",
    trials=_trials,
    separated_by={"cubic_stiffness": "an amplitude ladder: a stop does nothing below its gap"},
    one_sided=True,
)
