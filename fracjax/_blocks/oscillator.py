"""A mass on a spring with damping."""

from __future__ import annotations

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._machine import AbstractMachine
from ._port import Port, System

Measured = Literal["position", "velocity", "acceleration"]
_POWERS: dict[Measured, int] = {"position": 0, "velocity": 1, "acceleration": 2}


class Oscillator(AbstractMachine):
    r"""A mass on a spring with damping:

        m ẍ + c ẋ + k x = u,    X/U = g / (1 + 2 ζ s/ω_0 + s²/ω_0²)

    with g = 1/k, ω_0 = 2π f_0 = √(k/m) and ζ = c/(2 √(k m)).  The response is the position x, the
    velocity or the acceleration.  The drive is a force, or a voltage that causes one in proportion.
    A base that is shaken with the acceleration u moves the mass against it as a force -m u does:
    then g = -1/ω_0².  At the port `spring` acts a force on the mass, in units of the drive.

    Args:
        gain: initial g.
        frequency: initial f_0.
        damping: initial ζ.
        measured: "position", "velocity" or "acceleration".

    Attributes:
        gain: g = 1/k, one number [position/drive], the position in response units times 1, s or s².
        frequency: f_0, one number [Hz].
        damping: ζ, one number, dimensionless.
        measured: what the response is.

    Source: Den Hartog, Mechanical Vibrations (1956), chapter 2; Xu et al., Fractal Fract. 8 (2024)
    3, equation (17), for the actuator's.
    """

    gain: Parameter
    frequency: Parameter
    damping: Parameter
    measured: Measured = eqx.field(static=True)

    def __init__(
        self,
        gain: float = 1.0,
        frequency: float = 100.0,
        damping: float = 0.05,
        measured: Measured = "position",
    ):
        self.gain = Parameter(gain, gain_unit(measured), gain=True)
        self.frequency = Parameter(
            frequency, "Hz", lower=1e-6, upper=1e8, plausible=(frequency / 5, 5 * frequency),
            logarithmic=True,
        )  # fmt: skip
        self.damping = Parameter(
            damping, lower=1e-4, upper=10.0, plausible=(4e-3, 0.5), logarithmic=True
        )
        self.measured = measured

    @property
    def accuracy(self) -> int:
        return 3

    @property
    def _rate(self) -> Array:
        return 2 * np.pi * self.frequency.value

    def symbol(self, s: Array) -> Array:
        x = s / self._rate
        position = self.gain.value / (1 + 2 * self.damping.value * x + x * x)
        return position * s ** _POWERS[self.measured]

    def static_gain(self) -> ArrayLike:
        return self.gain.value * (self.measured == "position")

    def system(self) -> System:
        w, k = self._rate, self.gain.value * self._rate**2
        a = jnp.array([[0.0, 1.0], [-(w**2), -2 * self.damping.value * w]])
        b = jnp.array([0.0, k])
        row = {"position": jnp.eye(2)[0], "velocity": jnp.eye(2)[1], "acceleration": a[1]}
        return System(a, b, row[self.measured], k if self.measured == "acceleration" else 0.0)

    def ports(self) -> dict[str, Port]:
        _, b, _, d = self.system()
        return {"spring": Port("force", b, jnp.eye(2)[0], jnp.eye(2)[1], d)}

    def scales(self) -> Array:
        power = _POWERS[self.measured]
        return jnp.array([self._rate**-power, self._rate ** (1 - power)])


def gain_unit(measured: Measured) -> str:
    """The unit of a position's gain where the response is a derivative of the position."""
    power = _POWERS[measured]
    return f"response/drive*s^{power}" if power else "response/drive"
