"""Pure delay between drive and response."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values


def read_between(drive: Array, position: Array, grid: Grid) -> Array:
    """The drive (N,), in its unit, at positions (N,) counted in samples, by Catmull–Rom cubics.

    Before the first sample it follows the history; after the last one it keeps the last value.
    """
    samples = drive.shape[0]
    whole = jnp.floor(position)
    x = position - whole

    def at(shift: int) -> Array:
        index = whole.astype(int) + shift
        if grid.history == "periodic":
            return drive[index % samples]
        before = drive[0] if grid.history == "constant" else 0.0
        return jnp.where(index < 0, before, drive[jnp.clip(index, 0, samples - 1)])

    a, b, c, d = at(-1), at(0), at(1), at(2)
    cubic = (3 * (b - c) + d - a) * x + 2 * a - 5 * b + 4 * c - d
    return b + 0.5 * x * (c - a + x * cubic)


class Delay(AbstractBlock):
    r"""The response belongs to an earlier drive, as through a converter or a buffer:

        y(t) = u(t - τ),     G(s) = exp(-τ s)

    Between the grid's samples the drive is interpolated by Catmull–Rom cubics, whose slope is
    continuous, so that the response is differentiable in τ.

    Args:
        delay: initial τ.
        longest: the largest τ [s].

    Attributes:
        delay: τ, one number [s].

    Source: Ljung, System Identification (1999), section 4.2.
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

    @property
    def linear(self) -> bool:
        return True

    def __call__(self, drive: Array, grid: Grid) -> Array:
        position = jnp.arange(drive.shape[0]) - self.delay.value / grid.step
        return read_between(drive, position, grid)


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
        "drive_lag": "a drive reaching omega*tau > 0.3, where a lag loses gain",
        "resonance": "a sweep up to a third of the suspected natural frequency",
    },
    concealed_by="the orders alpha and beta of the hysteresis",
    axes=("frequency", "rate", "phase"),
    one_sided=True,
)
