"""A mass without a spring, such as a motor's stage."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._machine import AbstractMachine
from ._port import Port, System


class Mass(AbstractMachine):
    r"""A mass that nothing holds, with viscous friction; it integrates:

        m ẍ + c ẋ = u,    X/U = γ / (s (s + λ)),    γ = 1/m,  λ = c/m

    The response is the position x, from 0 before the first sample, or the velocity.  At the port
    `guide` acts a force on the mass, in units of the drive.

    Args:
        gain: initial γ.
        rate: initial λ.
        of_velocity: whether the response is the velocity.

    Attributes:
        gain: γ = 1/m, one number [response/drive · s^-2], or s^-1 where the response is a velocity.
        rate: λ = c/m, one number [s^-1].
        of_velocity: whether the response is the velocity.

    Source: Janot, Gautier & Brunot, Workshop on Nonlinear System Identification Benchmarks (2019),
    equation (1), without its dry friction.
    """

    gain: Parameter
    rate: Parameter
    of_velocity: bool = eqx.field(static=True)

    def __init__(self, gain: float = 1.0, rate: float = 1.0, *, of_velocity: bool = False):
        power = -1 if of_velocity else -2
        self.gain = Parameter(gain, f"response/drive*s^{power}", gain=True)
        self.rate = Parameter(
            rate, "s^-1", lower=1e-6, upper=1e6, plausible=(rate / 10, 10 * rate), logarithmic=True
        )
        self.of_velocity = of_velocity

    @property
    def accuracy(self) -> int:
        return 3

    @property
    def settles(self) -> bool:
        return False

    @property
    def drifts(self) -> bool:
        return not self.of_velocity

    def symbol(self, s: Array) -> Array:
        velocity = self.gain.value / (s + self.rate.value)
        return velocity if self.of_velocity else velocity / s

    def static_gain(self) -> ArrayLike:
        # A constant drive moves it on for ever; what precedes the first sample counts as rest.
        return self.gain.value / self.rate.value if self.of_velocity else 0.0 * self.gain.value

    def system(self) -> System:
        a = jnp.array([[0.0, 1.0], [0.0, -self.rate.value]])
        b = jnp.array([0.0, self.gain.value])
        return System(a, b, jnp.eye(2)[1 if self.of_velocity else 0], 0.0)

    def ports(self) -> dict[str, Port]:
        b = jnp.array([0.0, self.gain.value])
        return {"guide": Port("force", b, jnp.eye(2)[0], jnp.eye(2)[1], 0.0)}

    def scales(self) -> Array:
        # A position measures a velocity by the way in a second.
        return jnp.ones(2)
