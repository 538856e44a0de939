"""Low-pass of the displacement sensor and its electronics."""

from __future__ import annotations

import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._effect import Effect, Setting, at_values


class SensorLag(AbstractLinearBlock):
    r"""The reading is the displacement after n equal low-passes in series:

        G(s) = (1 + τ s)^-n,    τ = √(2^(1/n) - 1) / (2π f_c)

    The order need not be an integer: low-passes with different poles lie between two orders.  Below
    the corner the reading is late by n τ.  After a linear model the first order is equivalent to a
    lag of the drive, in every recording.
    Ranges: f_c from 10 Hz (a filter set for resolution) over 1 kHz (LVDT) to 100 kHz (capacitive).

    Attributes:
        corner: f_c, where the gain is 1/√2, one number [Hz].
        order: n, from 1 to 4, one number, dimensionless.

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
        """The time constant τ of each low-pass, one number [s]."""
        return (2 ** (1 / self.order.value) - 1) ** 0.5 / (2 * np.pi * self.corner.value)

    def symbol(self, s: Array) -> Array:
        return (1 + self.time_constant * s) ** -self.order.value

    def static_gain(self) -> ArrayLike:
        return 1.0


class SensorFilter(AbstractLinearBlock):
    r"""The reading is the displacement after a filter with pairs of poles:

        G(s) = (1 + 2 ζ s/ω + (s/ω)²)^(-n/2),    |G(2πi f_c)| = 1/√2

    At second order ζ = 0.87 is Bessel's filter, 0.71 Butterworth's and 1 that of `SensorLag`.
    Filters of third and fourth order have different pairs: up to half the corner Bessel's are
    approximated to 8e-4 of the static gain and Butterworth's to 6e-3, rms.  Below the corner the
    reading is late by n ζ/ω.
    Ranges: f_c and n as in `SensorLag`; ζ from 0.65, with 7 % of overshoot, to 1.

    Attributes:
        corner: f_c, where the gain is 1/√2, one number [Hz].
        order: n, from 1 to 4, not necessarily an integer, one number, dimensionless.
        damping: ζ, one number, dimensionless.

    Source: A. J. Fleming, Sens. Actuators A 190 (2013) 106, for the bandwidths; Horowitz & Hill,
    The Art of Electronics (2015), section 6.2, for the filters.
    """

    corner: Parameter
    order: Parameter
    damping: Parameter

    def __init__(self, corner: float, order: float = 2.0, damping: float = 0.8):
        self.corner = Parameter(
            corner, "Hz", lower=0.1, upper=1e8, plausible=(10.0, 1e6), logarithmic=True
        )
        self.order = Parameter(order, lower=1.0, upper=4.0)
        self.damping = Parameter(damping, lower=0.65, upper=1.0)

    @property
    def frequency(self) -> Array:
        """The natural frequency ω of the poles, one number [rad/s]."""
        bend = 1 - 2 * self.damping.value**2
        squared = bend + (bend**2 + 2 ** (2 / self.order.value) - 1) ** 0.5
        return 2 * np.pi * self.corner.value / squared**0.5

    def symbol(self, s: Array) -> Array:
        x = s / self.frequency
        return (1 + 2 * self.damping.value * x + x * x) ** (-self.order.value / 2)

    def static_gain(self) -> ArrayLike:
        return 1.0


def _trials(setting: Setting) -> list:
    corners = np.unique(np.clip(setting.top_frequency * np.geomspace(1, 100, 5), 10.0, 1e5))
    chains = [{"corner": f, "order": n} for f in corners for n in (1.0, 3.0)]
    filters = [{"corner": f} for f in corners]
    return [*at_values(SensorLag(1e3), chains), *at_values(SensorFilter(1e3, 3.0), filters)]


EFFECT = Effect(
    name="sensor_lag",
    site="response",
    sentence="the sensor's electronics filter the displacement, so that its reading comes late and "
    "loses the fastest changes",
    equation="(1 + tau s)^-n or (1 + 2 zeta s/omega + s^2/omega^2)^(-n/2), 1/sqrt(2) at f_c",
    source="Fleming, Sens. Actuators A 190 (2013) 106, for the bandwidths",
    trials=_trials,
    separated_by={
        "drive_lag": "the voltage at the stack too: a lag of the drive shows there, a lag of the "
        "sensor does not",
        "delay": "a drive reaching a third of the suspected corner, where a filter loses gain",
        "resonance": "a sweep: a filter loses gain where a resonance gains it",
    },
    concealed_by="the order alpha of the hysteresis",
    axes=("frequency", "rate", "phase", "reversal"),
    one_sided=True,
)
