"""Clocks of drive and response that run at different speeds."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values
from .delay import read_between

_PLAUSIBLE = 1e-3
"""The largest plausible |ε|: five times what two crystals differ by at most; see the ranges of
`ClockSkew`."""


class ClockSkew(AbstractBlock):
    r"""The generator and the recorder have clocks of different speeds:

        v(t) = u(t (1 + ε))

    Both agree at the first sample, t = 0.  A fixed time between them is the effect `delay`.  The
    drive is interpolated as in `Delay`.  For ε < 0 the drive comes later and later; for ε > 0 it
    comes earlier than recorded, by ε t: its time stamps are wrong, and after the last sample its
    last value is used.
    With `periodic` history the drive is read from the continued period, which is what the generator
    sent; but the block that follows treats the stretched record as whole steady periods, and where
    the record closes its drive jumps by ε T times the rate.
    Ranges: crystals of data acquisition are specified to ±50 ppm (NI 9234) or ±100 ppm (Contec), so
    that two differ by up to 200 ppm; a generator timed by a resonator or by software is several
    times worse.

    Attributes:
        skew: ε, the relative advance of the generator's clock on the recorder's, one number,
            dimensionless.

    Source: data sheets of NI 9234 and of Contec's converters.
    """

    skew: Parameter

    def __init__(self, skew: float):
        bound = 5 * _PLAUSIBLE
        self.skew = Parameter(skew, lower=-bound, upper=bound, plausible=(-_PLAUSIBLE, _PLAUSIBLE))

    @property
    def linear(self) -> bool:
        return True

    def __call__(self, drive: Array, grid: Grid) -> Array:
        samples = jnp.arange(drive.shape[0])
        return read_between(drive, samples + self.skew.value * samples, grid)


def _trials(setting: Setting) -> list:
    # From a third of a step at the record's end to what two crystals may differ by.
    least = min(0.3 * setting.step / setting.duration, 0.3 * _PLAUSIBLE)
    sizes = np.geomspace(least, _PLAUSIBLE, 4)
    return at_values(ClockSkew(least), [{"skew": sign * e} for sign in (1, -1) for e in sizes])


EFFECT = Effect(
    name="clock_skew",
    site="drive",
    sentence="the clocks of generator and recorder run at slightly different speeds, so that the "
    "response comes later and later, or earlier and earlier",
    equation="u(t (1 + eps))",
    source="data sheets of converters, 50 to 100 ppm for each clock (NI 9234, Contec)",
    trials=_trials,
    separated_by={
        "delay": "the same drive for ten times as long: the time between drive and response grows "
        "with a skewed clock, and stays the same with a delay",
    },
    concealed_by="the noise, in short recordings, and the orders alpha and beta of the hysteresis",
    axes=("time", "rate", "frequency"),
)
