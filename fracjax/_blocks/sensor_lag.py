"""Low-pass of the displacement sensor and its electronics."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._effect import Effect, Setting, at_values


class SensorLag(AbstractLinearBlock):
    r"""The reading is the displacement through n equal low-passes, one after the other:

        G(s) = (1 + τ s)^-n,    τ = √(2^(1/n) - 1) / (2π f_c)

    with corner f_c [Hz], where the gain is 1/√2, and order n = 1 to 4, which need not be whole: a
    chain of unlike poles lies between two orders.  Below the corner it is late by n τ.
    Behind a linear law the first order is the same as a lag of the drive, whatever the recording.
    Corners run from 10 Hz (a filter set for resolution) over 1 kHz (LVDT) to 100 kHz (capacitive).
    Source: A. J. Fleming, Sens. Actuators A 190 (2013) 106, whose table of sensors gives the
    bandwidths.
    """

    corner: Parameter
    order: Parameter

    def __init__(self, corner: float, order: float = 2.0):
        self.corner = Parameter(
            corner, "Hz", lower=0.1, upper=1e8, plausible=(10.0, 1e6), logarithmic=True
        )
        self.order = Parameter(order, lower=1.0, upper=4.0)

    @property
    def time_constant(self) -> Array:
        """τ [s] of each of the low-passes."""
        return jnp.sqrt(2 ** (1 / self.order.value) - 1) / (2 * np.pi * self.corner.value)

    def symbol(self, s: Array) -> Array:
        return (1 + self.time_constant * s) ** -self.order.value

    def static_gain(self) -> ArrayLike:
        return 1.0


def _trials(setting: Setting) -> list:
    corners = np.clip(setting.top_frequency * np.geomspace(3, 100, 4), 10.0, 1e5)
    shapes = [{"corner": f, "order": n} for f in np.unique(corners) for n in (1.0, 3.0)]
    return at_values(SensorLag(1e3), shapes)


EFFECT = Effect(
    name="sensor_lag",
    site="response",
    sentence="the sensor's electronics filter the displacement, so that its reading comes late and "
    "loses the fastest changes",
    equation="(1 + tau s)^-n, gain 1/sqrt(2) at f_c",
    source="Fleming, Sens. Actuators A 190 (2013) 106, for the bandwidths",
    trials=_trials,
    separated_by={
        "drive_lag": "the voltage at the stack too: a lag of the drive shows there, a sensor's "
        "does not",
        "delay": "a drive reaching a third of the suspected corner, where a filter loses gain",
        "resonance": "a sweep: a filter loses gain where a resonance gains it",
    },
    concealed_by="the order alpha of the hysteresis",
    axes=("frequency", "rate", "phase", "reversal"),
    one_sided=True,
)
