"""A stage between two parts of a machine that passes nothing about its rest."""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, positive, rms
from ._port import Motion


class DeadZone(AbstractForce):
    r"""About its rest a stage passes less, as a push-pull stage does at the crossover:

        f = -κ max(-L, min(L, x - c))

    Attributes:
        loss: κ, the slope that is lost within the zone, one number [drive/response].
        limit: L, half the zone, one number [response].
        middle: c, one number [response].

    Source: Khalil, Nonlinear Systems (2002), section 1.2.
    """

    loss: Parameter
    limit: Parameter
    middle: Parameter
    kind = "signal"
    size = "loss"
    is_placed = False

    def __init__(self, loss: float = 1.0, limit: float = 1.0, middle: float = 0.0):
        self.loss = positive(loss, "drive/response")
        self.limit = positive(limit, "response")
        self.middle = Parameter(middle, "response")

    def force(self, motion: Motion) -> Array:
        away = motion.position - self.middle.value
        return -self.loss.value * jnp.clip(away, -self.limit.value, self.limit.value)


_SHARES = (0.05, 0.2, 0.5)
"""Half the zone over the signal's largest value; chosen by judgement."""


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    signal = np.asarray(motion.position)
    middle, span = float(np.median(signal)), float(np.ptp(signal)) or 1.0
    size = rms(motion.drive) / rms(signal)
    return [DeadZone(size, share * span / 2, middle) for share in _SHARES]


INSIDE = InsideEffect(
    name="dead_zone",
    kind="signal",
    sentence="between two filters a stage passes nothing, or less, about its rest",
    equation="f = -kappa clip(x - c, -L, L)",
    source="Khalil, Nonlinear Systems (2002), section 1.2",
    trials=_trials,
    separated_by={
        "clipping": "an amplitude ladder: a dead zone bends small signals, a limit large ones",
    },
    one_sided=True,
)
