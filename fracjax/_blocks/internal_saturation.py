"""A store that overflows."""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, positive, rms
from ._port import Motion


class InternalSaturation(AbstractForce):
    r"""What a store holds is limited, inside the dynamics: it overflows, or a state is clamped:

        q = -κ max(x - x_max, 0)

    With a large κ the level stays at x_max, and leaves it as soon as less flows in than out.

    Attributes:
        overflow: κ, one number [drive/response].
        limit: x_max, one number [response].

    Source: Schoukens & Noël, IFAC-PapersOnLine 50 (2017) 446, cascaded tanks with overflow.
    """

    overflow: Parameter
    limit: Parameter
    kind = "flow"
    size = "overflow"

    def __init__(self, overflow: float = 1.0, limit: float = 1.0):
        self.overflow = positive(overflow, "drive/response")
        self.limit = Parameter(limit, "response")

    def force(self, motion: Motion) -> Array:
        return -self.overflow.value * jnp.maximum(motion.position - self.limit.value, 0.0)


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    level = np.asarray(motion.position)
    low, span = float(level.min()), float(np.ptp(level)) or 1.0
    size = rms(motion.drive) / span
    return [InternalSaturation(size, low + share * span) for share in (0.6, 0.75, 0.9)]


INSIDE = InsideEffect(
    name="internal_saturation",
    kind="flow",
    sentence="what a store holds is limited: it overflows, so that its level stays at the limit "
    "and leaves it at once when the inflow falls",
    equation="q = -kappa max(x - x_max, 0)",
    source="Schoukens & Noel, IFAC-PapersOnLine 50 (2017) 446",
    trials=_trials,
    separated_by={"root_outflow": "low levels, at which a store does not overflow"},
    one_sided=True,
)
