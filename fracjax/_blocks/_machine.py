"""A machine: linear dynamics with states, and the ports at which further physics acts on them."""

from __future__ import annotations

import abc
from typing import Any, Literal, NamedTuple

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from .._operators import Grid
from ._block import AbstractLinearBlock

PortKind = Literal["force", "flow"]
"""What acts at a port: a force on a motion, or a flow into a store."""


class Motion(NamedTuple):
    """What an effect at a port depends on, arrays of one shape.

    Attributes:
        position: the position or the level there [response unit].
        velocity: its rate [response unit/s].
        drive: the machine's drive [drive unit].
    """

    position: Any
    velocity: Any
    drive: Any


class System(NamedTuple):
    """Linear dynamics dx/dt = A x + b u, y = c x + d u.

    Attributes:
        a: A (n, n) [1/s].
        b: (n,) in state units per drive unit and second.
        c: (n,) in response units per state unit.
        d: one number [response/drive].
    """

    a: Array
    b: Array
    c: Array
    d: ArrayLike


class Port(NamedTuple):
    """A place in a machine where a force or a flow may act, linear in the states.

    Attributes:
        kind: what acts there.
        enters: (n,) by how much one drive unit of it changes the rates of the states.
        position: (n,) the position or the level as a sum of the states.
        velocity: (n,) its rate as a sum of the states.
        direct: by how much one drive unit of it changes the response at once [response/drive].
    """

    kind: PortKind
    enters: Array
    position: Array
    velocity: Array
    direct: ArrayLike


class AbstractMachine(AbstractLinearBlock):
    """A linear block with states and ports: drive (N,) → response (N,).

    Alone it is a linear block like any other.  `machine @ effect` adds physics at a port, which
    depends on the motion that it changes: no block before or after the machine can express it.
    """

    @abc.abstractmethod
    def system(self) -> System:
        """The dynamics in states x (n,)."""

    @abc.abstractmethod
    def ports(self) -> dict[str, Port]:
        """The ports by name; an effect takes the first of its kind unless told."""

    @abc.abstractmethod
    def scales(self) -> Array:
        """(n,) the unit that each state is measured in, over the response's [s^k]."""

    @property
    def settles(self) -> bool:
        """Whether a constant drive leads to an equilibrium, as it does where a spring holds."""
        return True

    def start(self, drive: Array, grid: Grid) -> Array:
        """The states (n,) before the first sample: in equilibrium with a constant drive, or 0."""
        a, b, *_ = self.system()
        if grid.history == "rest" or not self.settles:
            return jnp.zeros_like(b)
        return -jnp.linalg.solve(a, b) * drive[0]

    def opened(self, site: str) -> AbstractMachine:
        """This machine with the parameters free that what acts at a port depends on."""
        return self

    def __matmul__(self, effect: Any) -> Any:
        """This machine with an effect at its first port of the effect's kind."""
        from .within import Within  # a block around machines, which know nothing of it

        return Within(self) @ effect
