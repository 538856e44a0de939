"""Drive limited in rate by its amplifier's current."""

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

    R [drive/s], h [s] the grid's step.  The voltage v follows the command u while it can and runs
    after it at the rate R where it cannot.  Of second order in the step: only where the limit sets
    in between samples is it late.  With `periodic` history it has settled: each half cycle
    multiplies what is left of another start by (s - R)/(s + R), s the command's rate where v meets
    it.
    Ranges: R below the recording's top rate, for above it nothing happens; how far, the amplifier
    alone says (I_max/C is 1 V/ms for 10 mA on 10 µF).  In a staircase, whose top rate is a jump
    within one step, a far lower R has still little effect.
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
    """Exactly the command wherever it is within reach."""
    return jnp.minimum(jnp.maximum(command, voltage - reach), voltage + reach)


def _trials(setting: Setting) -> list:
    top = setting.top_rate
    shares = 1 - np.geomspace(0.4, 0.003, 13)
    return at_values(SlewRateLimit(top, top=top), [{"rate": share * top} for share in shares])


EFFECT = Effect(
    name="slew_rate_limit",
    site="drive",
    sentence="the amplifier's current charges the stack no faster than a limit, so that the drive "
    "runs after fast commands on straight ramps",
    equation="|dv/dt| <= R = I_max/C",
    source="Fleming & Leang, Design, Modeling and Control of Nanopositioning Systems (2014), "
    "chapter on electrical considerations",
    trials=_trials,
    separated_by={
        "cubic_nonlinearity": "the same amplitude at several frequencies: a slew limit is there "
        "only above one product of frequency and amplitude",
        "minor_loop_memory": "the same amplitude at several frequencies: play stays, a slew limit "
        "is gone at low ones",
        "backlash": "the same amplitude at several frequencies: play stays, a slew limit is "
        "gone at low ones",
        "drive_lag": "half the amplitude at twice the frequency: a slew limit's share stays, "
        "a lag's doubles",
        "saturation": "the same amplitude at a lower frequency: a supply's limit stays",
    },
    concealed_by="the rate-dependent terms of the hysteresis, the order alpha above all",
    axes=("rate", "phase", "harmonics", "frequency"),
    one_sided=True,
)
