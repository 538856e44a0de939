"""Physics inside a machine: a force or a flow at one of its ports, and its catalogue entry."""

from __future__ import annotations

import abc
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from .._parameters import Parameter
from ._port import Motion, PortKind


class AbstractInside(eqx.Module):
    """Physics at a port of a machine, in units of its drive: it follows from the motion there.

    A new one is a class with its parameters, `kind`, `size` and `act`; one without memory derives
    from `AbstractForce` and has `force` instead of `act`.  It then works in every machine with such
    a port, is fitted with it, and is offered to the diagnosis by an `InsideEffect`.

    Attributes:
        kind: the kind of port at which it acts.
        size: the parameter that it is proportional to.
        sticks: whether it can stop the motion, as dry friction does; it is then integrated by the
            implicit Euler rule, of first order, under which a stuck motion stays at rest.
        is_placed: whether it changes where the machine is displaced as a whole, unlike what follows
            from velocities and steps alone, or, between filters, has a parameter that says where it
            is; only then is the drive's offset fitted beside the response's.
    """

    __getattribute__ = object.__getattribute__  # as in a block

    kind: ClassVar[PortKind] = "force"
    size: ClassVar[str]
    sticks: ClassVar[bool] = False
    is_placed: ClassVar[bool] = True

    def memory(self) -> Any:
        """What it remembers before the first sample: a tree of numbers, () for nothing."""
        return ()

    @abc.abstractmethod
    def act(self, now: Motion, before: Motion, memory: Any, step: Any) -> tuple[Array, Any]:
        """What acts at the end of a step.

        Args:
            now: the motion at the end of the step.
            before: the motion at its beginning.
            memory: what it remembered then.
            step: the time between both [s].

        Returns:
            The force or the flow [drive unit], and what it remembers now.
        """


class AbstractForce(AbstractInside):
    """Physics at a port without memory: a function of the present motion [drive unit]."""

    @abc.abstractmethod
    def force(self, motion: Motion) -> Array:
        """The force or the flow [drive unit] at a motion, of the motion's shape."""

    def act(self, now: Motion, before: Motion, memory: Any, step: Any) -> tuple[Array, Any]:
        return self.force(now), memory


def _no_experiment() -> dict[str, str]:
    """No look-alikes: the default of `InsideEffect.separated_by`."""
    return {}


@dataclass(frozen=True)
class InsideEffect:
    """One entry of the catalogue of physics inside machines.

    Attributes:
        name: the effect's name.
        kind: the kind of port at which it acts.
        sentence: the physics, in words.
        equation: the equation, in plain text.
        source: the literature.
        trials: from the motion (arrays (N,)) of a fitted machine, blocks at typical sizes and
            several shapes; each is a column of the diagnosis and a start of the refit.  Motion and
            effects are in the units of drive and response.
        separated_by: for each look-alike, the experiment that distinguishes the two.
        one_sided: whether its trials have the only sign that physics allows, as friction has.
    """

    name: str
    kind: PortKind
    sentence: str
    equation: str
    source: str
    trials: Callable[[Motion], Sequence[AbstractInside]]
    separated_by: dict[str, str] = field(default_factory=_no_experiment)
    one_sided: bool = False


_DECADES = 1e5
"""How far a positive parameter may move from where it starts, as a factor."""


def positive(value: float, unit: str, *, fixed: bool = False) -> Parameter:
    """A parameter that physics keeps above 0, fitted on a logarithmic scale about a value > 0."""
    return Parameter(
        value, unit, lower=value / _DECADES, upper=value * _DECADES, logarithmic=True, fixed=fixed
    )


def rms(signal: Any) -> float:
    """The rms of a signal about 0, in its unit; 1 for a signal that is 0."""
    level = float(jnp.sqrt(jnp.mean(jnp.square(jnp.asarray(signal)))))
    return level or 1.0
