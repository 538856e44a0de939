"""A store that drains through an orifice."""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, positive, rms
from ._port import Motion


class RootOutflow(AbstractForce):
    r"""What leaves a store through an orifice goes with the root of the level (Torricelli):

        q = -κ √max(x - x_0, 0)

    Attributes:
        outflow: κ, one number [drive · response^(-1/2)].
        empty: x_0, the level at which nothing leaves, one number [response].

    Source: Schoukens & Noël, IFAC-PapersOnLine 50 (2017) 446, cascaded tanks; Bernoulli's equation.
    """

    outflow: Parameter
    empty: Parameter
    kind = "flow"
    size = "outflow"

    def __init__(self, outflow: float = 1.0, empty: float = 0.0):
        self.outflow = positive(outflow, "drive*response^-0.5")
        self.empty = Parameter(empty, "response")

    def force(self, motion: Motion) -> Array:
        head = motion.position - self.empty.value
        # The root must be finite in the unused branch too, for its derivative.
        root = jnp.sqrt(jnp.asarray(jnp.where(head > 0, head, 1.0)))
        return -self.outflow.value * jnp.where(head > 0, root, 0.0)


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    level = np.asarray(motion.position)
    low, span = float(level.min()), float(np.ptp(level)) or 1.0
    size = 0.1 * rms(motion.drive) / np.sqrt(span)
    return [RootOutflow(size, low - share * span) for share in (0.02, 0.2, 1.0)]


INSIDE = InsideEffect(
    name="root_outflow",
    kind="flow",
    sentence="a store drains through an orifice, by the root of its level, so that it empties "
    "faster the fuller it is, but less than in proportion",
    equation="q = -kappa sqrt(max(x - x0, 0))",
    source="Schoukens & Noel, IFAC-PapersOnLine 50 (2017) 446",
    trials=_trials,
    separated_by={"internal_saturation": "low levels, at which a store does not overflow"},
    one_sided=True,
)
