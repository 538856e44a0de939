"""Play in a joint: a part of the spring acts only beyond a gap."""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, positive, rms
from ._port import Motion


class Clearance(AbstractForce):
    r"""A part of the spring is lost within a gap, as in a joint with clearance:

        f = k_g max(-g, min(g, x))

    Within |x| < g the stiffness is less by k_g, beyond it the whole spring acts, displaced by the
    gap.

    Attributes:
        stiffness: k_g, the stiffness that the gap takes away, one number [drive/response].
        gap: g, half the clearance, one number [response].

    Source: Shaw & Holmes, J. Sound Vib. 90 (1983) 129; Noël & Schoukens, F-16 aircraft benchmark
    (2017), section 2.
    """

    stiffness: Parameter
    gap: Parameter
    size = "stiffness"

    def __init__(self, stiffness: float = 1.0, gap: float = 1.0):
        self.stiffness = positive(stiffness, "drive/response")
        self.gap = positive(gap, "response")

    def force(self, motion: Motion) -> Array:
        return self.stiffness.value * jnp.clip(motion.position, -self.gap.value, self.gap.value)


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    level, force = rms(motion.position), 0.1 * rms(motion.drive)
    return [
        Clearance(force / (share * level), share * level) for share in np.geomspace(0.05, 1.5, 6)
    ]


INSIDE = InsideEffect(
    name="clearance",
    kind="force",
    sentence="a joint has play: within a gap a part of the spring does not act, so that small "
    "motions are softer",
    equation="f = k_g clip(x, -g, g)",
    source="Shaw & Holmes, J. Sound Vib. 90 (1983) 129",
    trials=_trials,
    separated_by={
        "cubic_stiffness": "small amplitudes, where a clearance is lost and a cube vanishes",
        "dry_friction": "a free decay: friction ends it, a clearance does not",
    },
    one_sided=True,
)
