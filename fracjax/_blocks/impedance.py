"""From motion to force: a spring, a damper, a mass and a springpot side by side."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from .._operators import Grid
from .._parameters import Parameter
from ._machine import AbstractMachine
from ._port import Port, System


class Impedance(AbstractMachine):
    r"""The force that a motion meets, in a test that moves a specimen, or of a motor along a path:

        F = k x + c ẋ + m ẍ + K D^ν x,    G(s) = k + c s + m s² + K s^ν

    The drive is the position, the response the force, which leads it by nature.  What acts at the
    port `specimen`, in units of the response, is taken off the force: dry friction is a force
    against the motion, and the response has to overcome it.  The motion is given, so that nothing
    that acts changes it, and the force is linear in k, c, m, K and in the size of what acts.  Where
    the position is measured, the same low-pass on drive and response keeps its noise out of ẍ
    (identification by the inverse dynamics, IDIM-LS): a motor in closed loop is fitted without bias
    in this direction, and with one from force to position.

    Attributes:
        stiffness: k, one number [response/drive].
        damping: c, one number [response/drive · s].
        mass: m, one number [response/drive · s²].
        springpot: K, one number [response/drive · s^order].
        order: ν, one number, dimensionless.

    Source: Gautier, Janot & Vandanjon, IEEE Trans. Control Syst. Technol. 21 (2013) 428; Mainardi,
    Fractional Calculus and Waves in Linear Viscoelasticity (2010), chapter 3.
    """

    stiffness: Parameter
    damping: Parameter
    mass: Parameter
    springpot: Parameter
    order: Parameter

    def __init__(
        self,
        stiffness: float = 1.0,
        damping: float = 0.0,
        mass: float = 0.0,
        springpot: float | None = 0.1,
        order: float = 0.3,
    ):
        self.stiffness = Parameter(stiffness, "response/drive", gain=True)
        self.damping = Parameter(damping, "response/drive*s^1", gain=True)
        self.mass = Parameter(mass, "response/drive*s^2", gain=True)
        none = springpot is None
        self.springpot = Parameter(
            springpot or 0.0, "response/drive*s^order", gain=True, fixed=none
        )
        self.order = Parameter(order, lower=0.02, upper=0.98, plausible=(0.05, 0.9), fixed=none)

    @property
    def accuracy(self) -> int:
        return 2

    @property
    def leads(self) -> bool:
        return True

    def symbol(self, s: Array) -> Array:
        plain = self.stiffness.value + self.damping.value * s + self.mass.value * s * s
        return plain + self.springpot.value * s**self.order.value

    def static_gain(self) -> ArrayLike:
        return self.stiffness.value

    def system(self) -> System:
        none = jnp.zeros(0)
        return System(jnp.zeros((0, 0)), none, none, self.stiffness.value)

    def ports(self) -> dict[str, Port]:
        none = jnp.zeros(0)
        return {"specimen": Port("force", none, none, none, -1.0)}

    def scales(self) -> Array:
        return jnp.zeros(0)

    def start(self, drive: Array, grid: Grid) -> Array:
        return jnp.zeros(0)
