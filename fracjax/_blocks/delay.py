"""Pure delay between drive and response."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._effect import Effect, Setting, at_values


class Delay(AbstractLinearBlock):
    r"""The response belongs to an earlier drive, as through a converter or a buffer:

        y(t) = u(t - τ),     G(s) = exp(-τ s),   τ [s]

    Run by convolution quadrature, so that it stays causal and differentiable in τ.
    """

    delay: Parameter

    def __init__(self, delay: float, *, longest: float):
        self.delay = Parameter(
            delay,
            "s",
            lower=1e-4 * longest,
            upper=longest,
            plausible=(1e-3 * longest, 0.4 * longest),
            logarithmic=True,
        )

    def symbol(self, s: Array) -> Array:
        return jnp.exp(-self.delay.value * s)

    def static_gain(self) -> ArrayLike:
        return 1.0


def _trials(setting: Setting) -> list:
    step = setting.step
    block = Delay(step, longest=10 * step)
    return at_values(block, [{"delay": share * step} for share in (0.3, 1.0, 3.0)])


EFFECT = Effect(
    name="delay",
    site="drive",
    sentence="the response comes late by a fixed time, as through a converter or a buffer",
    equation="exp(-tau s)",
    source="Ljung, System Identification (1999), section 4.2",
    trials=_trials,
    separated_by={
        "drive_lag": "a drive reaching frequencies where omega*tau exceeds 0.3, where a lag loses gain",
        "resonance": "a sweep up to a third of the suspected natural frequency",
    },
    concealed_by="the orders alpha and beta of the hysteresis",
    axes=("frequency", "rate", "phase"),
)
