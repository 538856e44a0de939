"""Rate of the drive, limited by its amplifier's current."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values
from ._recursion import recursion, settled


class SlewRateLimit(AbstractBlock):
    r"""The amplifier's current charges the actuator's capacitance no faster than

        |v̇| ≤ R = I_max / C,    v_n = v_{n-1} + clip(u_n - v_{n-1}, -R h, R h)

    h [s] is the grid's step.  The voltage v equals the command u where it can, and follows it at
    the rate R where it cannot.  Of second order in the step, since the limit may set in between
    samples.  With `periodic` history v is steady: each half cycle multiplies the influence of the
    start by (s - R)/(s + R), where s is the command's rate at the point where v meets it.
    Ranges: R below the recording's top rate, above which there is no effect; how far below depends
    on the amplifier (I_max/C is 1 V/ms for 10 mA on 10 µF).  A staircase has a top rate of one jump
    per sample, and a far lower R still has little effect.

    Args:
        rate: initial R.
        top: the highest rate of the recording's drive [drive/s].

    Attributes:
        rate: R, one number [drive/s].

    Source: Fleming & Leang, Design, Modeling and Control of Nanopositioning Systems (2014), chapter
    on electrical considerations.
    """

    rate: Parameter

    def __init__(self, rate: float, *, top: float):
        self.rate = Parameter(
            rate, "drive/s", lower=0.02 * top, upper=top, plausible=(0.05 * top, top),
            logarithmic=True,
        )  # fmt: skip

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        start, reach = grid.before(drive), self.rate.value * grid.step
        follow = settled if grid.history == "periodic" else recursion
        return follow(_follow, reach, start, drive)


def _follow(reach: Array, voltage: Array, command: Array) -> Array:
    """The voltage after a step: the command where it is within reach, otherwise as near as the
    limit permits, in drive units."""
    return jnp.minimum(jnp.maximum(command, voltage - reach), voltage + reach)


def _trials(setting: Setting) -> list:
    top = setting.top_rate
    shares = 1 - np.geomspace(0.4, 0.003, 13)
    return at_values(SlewRateLimit(top, top=top), [{"rate": share * top} for share in shares])


EFFECT = Effect(
    name="slew_rate_limit",
    site="drive",
    sentence="the amplifier's current limits the rate at which it charges the stack, so that the "
    "drive follows fast commands in straight ramps",
    equation="|dv/dt| <= R = I_max/C",
    source="Fleming & Leang, Design, Modeling and Control of Nanopositioning Systems (2014), "
    "chapter on electrical considerations",
    trials=_trials,
    separated_by={
        "cubic_nonlinearity": "the same amplitude at several frequencies: a slew limit acts only "
        "above one product of frequency and amplitude",
        "minor_loop_memory": "the same amplitude at several frequencies: memory stays, a slew "
        "limit vanishes at low ones",
        "backlash": "the same amplitude at several frequencies: backlash stays, a slew limit "
        "vanishes at low ones",
        "drive_lag": "half the amplitude at twice the frequency: a slew limit's share stays, "
        "a lag's doubles",
        "saturation": "the same amplitude at a lower frequency: a supply's limit stays",
    },
    concealed_by="the rate-dependent terms of the hysteresis, mainly the order alpha",
    axes=("rate", "phase", "harmonics", "frequency"),
    one_sided=True,
)
