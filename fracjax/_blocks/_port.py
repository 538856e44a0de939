"""Ports of machines: where further physics acts on linear dynamics, and what it depends on."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

from jax import Array
from jax.typing import ArrayLike

PortKind = Literal["force", "flow", "signal"]
"""What acts at a port: a force on a motion, a flow into a store, or a signal added to one."""


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
