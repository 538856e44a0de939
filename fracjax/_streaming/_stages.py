r"""The inverse of each part of a model in series: solved for its drive, or filtered.

A nonlinear law F, frozen at its state, is a function of this sample's drive that rises (or falls)
everywhere; its drive is the root of F(u) = y within a bracket, by Newton's method, with bisection
where that would leave the bracket or not halve the step.  For plays F is piecewise straight, and
Newton's method ends at the exact root after as many steps as pieces are crossed.  The state then
advances by the drive that was *applied*: at a limit nothing winds up.

A linear law is inverted as the difference equations of 1/G(s), which hold within the band.  At a
limit their state advances by the motion whose drive is the one applied (Hanus' conditioning).  What
answers to accelerations, such as a mode, then counts as slow: to bring it at once to where it
should be would ask for drives of either sign in turn, each at a limit again.
Source: Press et al., Numerical Recipes (2007), section 9.4; Hanus, Kinnaert & Henrotte, Automatica
23 (1987) 729.
"""

from __future__ import annotations

import abc
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from ._sections import Linear, Section, State, weighed

MOST_STEPS = 60
"""Most steps of the root's search: bisection alone is exact to rounding after as many."""
_EPSILONS = 4
"""The search ends at a step below so many rounding errors of the drive's range."""


class Stage(abc.ABC):
    """The inverse of one part of the model: from its response back to its drive."""

    gains: np.ndarray
    sign: float

    @abc.abstractmethod
    def start(self, drive: Array) -> tuple[Array, State]:
        """The response at rest at a drive, and the state."""

    @abc.abstractmethod
    def drive_for(
        self, state: State, gains: Any, response: Array, bracket: tuple[Any, Any], eps: Array
    ) -> Array:
        """The drive within a bracket whose response is nearest to the given one."""

    @abc.abstractmethod
    def advance(
        self, state: State, gains: Any, drive: Array, aim: Array, eps: Array
    ) -> tuple[Array, Array, State]:
        """The response to the applied drive, which is the aim [response] where that was reached,
        its features, and the state after it."""


class Solved(Stage):
    """A law that is solved for its drive, sample by sample."""

    def __init__(self, section: Section, rising: bool, span: float):
        self.section, self.sign, self.span = section, 1.0 if rising else -1.0, span
        self.gains = section.gains

    def start(self, drive: Array) -> tuple[Array, State]:
        law = self.section.start(drive)
        state = {"at": drive, "move": jnp.zeros_like(drive), "law": law}
        return self.section.response(law)(drive)[0], state

    def drive_for(
        self, state: State, gains: Any, response: Array, bracket: tuple[Any, Any], eps: Array
    ) -> Array:
        respond = self.section.begin(state["law"])
        scaled = self.sign * jnp.asarray(gains)

        def law(drive: Array) -> Array:
            return weighed(respond(drive)[0], scaled)

        target, close = self.sign * response, _EPSILONS * eps * self.span
        low, high = bracket

        def unfinished(search: tuple[Array, ...]) -> Array:
            return (search[5] < MOST_STEPS) & (jnp.abs(search[3]) > close)

        def improve(search: tuple[Array, ...]) -> tuple[Array, ...]:
            low, high, drive, last, earlier, steps = search
            value, slope = jax.jvp(law, (drive,), (jnp.ones_like(drive),))
            missing = target - value
            low = jnp.where(missing >= 0, drive, low)
            high = jnp.where(missing <= 0, drive, high)
            newton = jnp.minimum(jnp.maximum(drive + missing / slope, low), high)
            slow = (slope <= 0) | (jnp.abs(newton - drive) > 0.5 * jnp.abs(earlier))
            better = jnp.where(slow, 0.5 * (low + high), newton)
            return low, high, better, better - drive, last, steps + 1

        # Where it moves on as it did, plays that were pushed are pushed on.
        begin = jnp.minimum(jnp.maximum(state["at"] + state["move"], low), high)
        far = jnp.full_like(begin, 4 * self.span)
        search = (low + 0 * begin, high + 0 * begin, begin, far, far, jnp.zeros((), int))
        return jax.lax.while_loop(unfinished, improve, search)[2]

    def advance(
        self, state: State, gains: Any, drive: Array, aim: Array, eps: Array
    ) -> tuple[Array, Array, State]:
        features, law = self.section.begin(state["law"])(drive)
        after = {"at": drive, "move": drive - state["at"], "law": law}
        return weighed(features, gains), features, after


class Filtered(Stage):
    """A linear law, inverted by the difference equations of 1/G(s)."""

    def __init__(self, inverse: Linear, span: float):
        self.inverse, self.span, self.gains = inverse, span, np.ones(1)
        self.sign = -1.0 if inverse.static < 0 else 1.0

    def start(self, drive: Array) -> tuple[Array, State]:
        static = self.inverse.static
        response = drive / static if static else 0 * drive
        return response, self.inverse.start(response)

    def drive_for(
        self, state: State, gains: Any, response: Array, bracket: tuple[Any, Any], eps: Array
    ) -> Array:
        drive = self.inverse.response(state)(response)[0]
        return jnp.minimum(jnp.maximum(drive, bracket[0]), bracket[1])

    def advance(
        self, state: State, gains: Any, drive: Array, aim: Array, eps: Array
    ) -> tuple[Array, Array, State]:
        close = jnp.sqrt(eps) * self.span
        response, after = self.inverse.advance(state, drive, aim, close)
        return response, jnp.reshape(response, (1,)), after
