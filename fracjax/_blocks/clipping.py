"""An amplifier between two parts of a machine, limited by its supply."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import numpy as np
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, positive, rms
from ._port import Motion


class Clipping(AbstractForce):
    r"""A signal is limited to both sides, as by an amplifier's supply or a core that saturates:

        f = -κ (h(x - c - L) - h(c - x - L)),    h(z) = w log(1 + exp(z/w))

    Attributes:
        loss: κ, by how much the signal's slope falls beyond the limits, one number
            [drive/response].
        limit: L, one number [response].
        middle: c, one number [response].
        width: w, within which the limit begins, one number [response].

    Source: Khalil, Nonlinear Systems (2002), section 1.2.
    """

    loss: Parameter
    limit: Parameter
    middle: Parameter
    width: Parameter
    kind = "signal"
    size = "loss"
    is_placed = False

    def __init__(
        self, loss: float = 1.0, limit: float = 1.0, middle: float = 0.0, width: float = 0.1
    ):
        self.loss = positive(loss, "drive/response")
        self.limit = positive(limit, "response")
        self.middle = Parameter(middle, "response")
        self.width = positive(width, "response")

    def force(self, motion: Motion) -> Array:
        away, width = motion.position - self.middle.value, self.width.value
        above, below = (
            jax.nn.softplus((side * away - self.limit.value) / width) for side in (1.0, -1.0)
        )
        return -self.loss.value * width * (above - below)


_SHARES, _WIDTH = (0.3, 0.5, 0.7), 0.03
"""Limits over the signal's largest value, and widths over its range; chosen by judgement."""


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    signal = np.asarray(motion.position)
    middle, span = float(np.median(signal)), float(np.ptp(signal)) or 1.0
    size = rms(motion.drive) / rms(signal)
    return [Clipping(size, share * span / 2, middle, _WIDTH * span) for share in _SHARES]


INSIDE = InsideEffect(
    name="clipping",
    kind="signal",
    sentence="between two filters an amplifier is limited by its supply to both sides",
    equation="f = -kappa (h(x - c - L) - h(c - x - L)), h(z) = w log(1 + exp(z/w))",
    source="Khalil, Nonlinear Systems (2002), section 1.2",
    trials=_trials,
    separated_by={
        "diode": "the drive reversed: a diode limits one side, an amplifier both",
        "curvature": "small amplitudes, at which a limit does nothing and a cube remains",
    },
    one_sided=True,
)
