"""A diode between two parts of a machine."""

from __future__ import annotations

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, positive, rms
from ._port import Motion


class Diode(AbstractForce):
    r"""A diode with a resistor conducts beyond a threshold and takes a share of the signal off:

        f = -κ w ω((x - x_0)/w),    ω + log ω = z,    with -f and -x for one that conducts below it

    ω is Wright's function, which solves Shockley's exponential in series with the resistor: far
    below the threshold it is exp(z), far above it z - log z.

    Args:
        loss: initial κ.
        threshold: initial x_0.
        width: initial w.
        upward: whether it conducts above its threshold, else below.

    Attributes:
        loss: κ, one number [drive/response].
        threshold: x_0, one number [response].
        width: w, the diode's thermal voltage times its ideality as it stands in the response, one
            number [response].
        upward: whether it conducts above its threshold.

    Source: Banwell & Jayakumar, Electron. Lett. 36 (2000) 291, the exact current of a diode with a
    series resistance; Schoukens, Suykens & Ljung, Wiener-Hammerstein benchmark, 15th IFAC Symposium
    on System Identification (2009).
    """

    loss: Parameter
    threshold: Parameter
    width: Parameter
    upward: bool = eqx.field(static=True)
    kind = "signal"
    size = "loss"
    is_placed = False

    def __init__(
        self, loss: float = 1.0, threshold: float = 0.0, width: float = 0.1, *, upward: bool = True
    ):
        self.loss = positive(loss, "drive/response")
        self.threshold = Parameter(threshold, "response")
        self.width = positive(width, "response")
        self.upward = upward

    def force(self, motion: Motion) -> Array:
        way = 1.0 if self.upward else -1.0
        beyond = way * (motion.position - self.threshold.value) / self.width.value
        return -way * self.loss.value * self.width.value * _wright(beyond)


_ITERATIONS = 6
"""Newton's steps to rounding, from above: the function is convex."""


def _wright(z: Array) -> Array:
    """ω(z) > 0 with ω + log ω = z, and its derivative ω/(1 + ω)."""
    z = jnp.asarray(z)

    def improved(log: Array, z: Array) -> Array:
        size = jnp.exp(log)
        return log - (size + log - z) / (size + 1)

    fixed = jax.lax.stop_gradient(z)
    log = jnp.where(fixed > 1, jnp.log(jnp.maximum(fixed, 1.0)), fixed)
    for _ in range(_ITERATIONS):
        log = improved(log, fixed)
    return jnp.exp(improved(log, z))


_SHARES, _WIDTH = (0.3, 0.5, 0.7), 0.03
"""Thresholds within the signal's range, and widths over it; chosen by judgement."""


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    signal = np.asarray(motion.position)
    low, span = float(signal.min()), float(np.ptp(signal)) or 1.0
    size = rms(motion.drive) / rms(signal)
    return [
        Diode(size, low + share * span, _WIDTH * span, upward=upward)
        for upward in (True, False)
        for share in _SHARES
    ]


INSIDE = InsideEffect(
    name="diode",
    kind="signal",
    sentence="between two filters a diode conducts beyond a threshold, so that the signal is "
    "limited to one side",
    equation="f = -kappa w omega((x - x0)/w), omega + log(omega) = z",
    source="Banwell & Jayakumar, Electron. Lett. 36 (2000) 291",
    trials=_trials,
    separated_by={
        "clipping": "the drive reversed: a diode limits one side, an amplifier both",
        "curvature": "small amplitudes, at which a diode does nothing and a curve's square remains",
    },
    one_sided=True,
)
