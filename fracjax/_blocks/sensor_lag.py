"""Low-pass of the displacement sensor and its electronics."""

from __future__ import annotations

from typing import Literal

import equinox as eqx
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._effect import Effect, Setting, at_values


class SensorLag(AbstractLinearBlock):
    r"""The reading is the displacement through a Butterworth low-pass, flat below its corner:

        G(s) = Π_k 1 / (1 + 2 sin((2k-1) π/2n) x + x²) · [1 / (1 + x) for odd n],   x = s/(2π f_c)

    with k = 1 … n/2, corner f_c [Hz] where the gain is 1/√2, order n = 1 to 4.  Below the corner it
    is late by 1/(2π f_c sin(π/2n)), for n = 2 by 0.225/f_c.
    Behind a linear law the first order is the same as a lag of the drive, whatever the recording.
    The second is the catalogue's: one more pole than the amplifier's resistance and capacitance
    make, and the least that a demodulator's output filter has.
    Corners run from 10 Hz (a filter set for resolution) over 1 kHz (LVDT) to 100 kHz (capacitive).
    Source: S. Butterworth, Experimental Wireless 7 (1930) 536; A. J. Fleming, Sens. Actuators A 190
    (2013) 106, whose table of sensors gives the bandwidths.
    """

    corner: Parameter
    order: Literal[1, 2, 3, 4] = eqx.field(static=True)

    def __init__(self, corner: float, *, order: Literal[1, 2, 3, 4] = 2):
        self.corner = Parameter(
            corner, "Hz", lower=0.1, upper=1e8, plausible=(10.0, 1e5), logarithmic=True
        )
        self.order = order

    def symbol(self, s: Array) -> Array:
        x = s / (2 * np.pi * self.corner.value)
        polynomial = 1 + self.order % 2 * x
        for angle in np.pi * np.arange(1, self.order, 2) / (2 * self.order):
            polynomial = polynomial * (1 + 2 * np.sin(angle) * x + x * x)
        return 1 / polynomial

    def static_gain(self) -> ArrayLike:
        return 1.0


def _trials(setting: Setting) -> list:
    corners = np.clip(setting.top_frequency * np.geomspace(3, 100, 4), 10.0, 1e5)
    return at_values(SensorLag(1e3), [{"corner": f} for f in np.unique(corners)])


EFFECT = Effect(
    name="sensor_lag",
    site="response",
    sentence="the sensor's electronics filter the displacement, so that its reading comes late and "
    "loses the fastest changes",
    equation="1 / (1 + sqrt(2) x + x^2), x = s/(2 pi f_c)",
    source="S. Butterworth, Experimental Wireless 7 (1930) 536; Fleming, Sens. Actuators A 190 "
    "(2013) 106 for the bandwidths",
    trials=_trials,
    separated_by={
        "drive_lag": "the voltage at the stack too: a lag of the drive shows there, a sensor's "
        "does not",
        "delay": "a drive reaching a third of the suspected corner, where a filter loses gain",
        "resonance": "a sweep: a filter loses gain where a resonance gains it",
    },
    concealed_by="the order alpha of the hysteresis",
    axes=("frequency", "rate", "phase", "reversal"),
)
