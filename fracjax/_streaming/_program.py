"""The functions of a stream, start, step and sound, as JAX programs of numbers and arrays.

The step survives what a loop meets: a sample that is no number is replaced by the last one that
was; a drive stays within its limits whatever is asked; a state that is no number, or that was never
started, is started anew from the last drive.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from ._adaptive import Learning
from ._chain import Chain
from ._sections import Section, State

HELD, LEVEL, SLEW, RESTARTED = 1, 2, 4, 8
FLAGS = {
    HELD: "the sample was no number, and the last one was used",
    LEVEL: "the drive is at a limit",
    SLEW: "the drive changes as fast as it may",
    RESTARTED: "the state was lost or never started; it was started from rest",
}


class Output(NamedTuple):
    """What one step gives."""

    output: Array
    predicted: Array
    flags: Array


class Limits(NamedTuple):
    """Lowest and highest drive, and its largest change per sample [drive], at most all the way."""

    low: float
    high: float
    change: float


class ModelProgram:
    """From drive to response."""

    inputs = ("drive",)

    def __init__(self, section: Section, offset: float, limits: Limits):
        self.section, self.offset, self.limits = section, offset, limits

    def start(self, drive: Array) -> State:
        """The state of a stage that has rested at a drive [drive]."""
        at = _clipped(drive, self.limits.low, self.limits.high)
        return {"started": jnp.ones(()), "drive": at, "law": self.section.start(at)}

    def step(self, eps: Array, state: State, drive: Array) -> tuple[Output, State]:
        """The response to one sample of the drive."""
        applied, held = _finite_or(drive, state["drive"])
        inside = _clipped(applied, self.limits.low, self.limits.high)
        response, law = self.section.response(state["law"])(inside)
        flags = held * HELD + jnp.where(inside != applied, LEVEL, 0)
        after = {"started": state["started"], "drive": inside, "law": law}
        return Output(response + self.offset, response + self.offset, flags), after


class InverseProgram:
    """From desired response to drive."""

    def __init__(self, chain: Chain, offset: float, limits: Limits, learning: Learning | None):
        self.chain, self.offset, self.limits, self.learning = chain, offset, limits, learning
        self.inputs = ("desired",) if learning is None else ("desired", "measured")

    def start(self, drive: Array) -> State:
        """The state of a stage that has rested at a drive [drive]."""
        at = _clipped(drive, self.limits.low, self.limits.high)
        response, states = self.chain.start(at)
        state = {
            "started": jnp.ones(()),
            "drive": at,
            "desired": response + self.offset,
            "stage": states,
        }
        if self.learning is not None:
            state["learning"] = self.learning.start()
        return state

    def step(
        self, eps: Array, state: State, desired: Array, measured: Array | None = None
    ) -> tuple[Output, State]:
        """The drive for one sample of the desired response."""
        aim, held = _finite_or(desired, state["desired"])
        low, high, change = self.limits
        last = state["drive"]
        nearest = jnp.maximum(last - change, low), jnp.minimum(last + change, high)
        stages, learning = self.chain.stages, self.learning
        gains: list[Any] = [stage.gains for stage in stages]
        offsets: list[Any] = [0.0] * len(stages)
        if learning is not None:
            gains[learning.at], offsets[learning.at] = learning.scaled(state["learning"])
        drive, aims = aim - self.offset, [aim] * len(stages)
        for k in reversed(range(len(stages))):
            bracket = nearest if k == 0 else tuple(self.chain.ranges[k])
            aims[k] = drive - offsets[k]
            drive = stages[k].drive_for(state["stage"][k], gains[k], aims[k], bracket, eps)
        value, states, features = drive, [], None
        for k, stage in enumerate(stages):
            value, features_here, after = stage.advance(
                state["stage"][k], gains[k], value, aims[k], eps
            )
            value = value + offsets[k]
            states.append(after)
            if learning is not None and k == learning.at:
                features = features_here
        predicted = value + self.offset
        after = {
            "started": state["started"],
            "drive": drive,
            "desired": aim,
            "stage": tuple(states),
        }
        if learning is not None:
            assert measured is not None
            assert features is not None
            usable = jnp.isfinite(measured)
            missed = jnp.where(usable, measured - predicted, 0.0)
            learnt = learning.follow(state["learning"], features, missed)
            after["learning"] = _selected(usable, learnt, state["learning"])
            held = jnp.where(usable, held, 1)
        flags = held * HELD + jnp.where((drive <= low) | (drive >= high), LEVEL, 0)
        if change < high - low:
            fast = jnp.abs(drive - last) >= change - 4 * eps * (high - low)
            flags = flags + jnp.where(fast, SLEW, 0)
        return Output(drive, predicted, flags), after


Program = ModelProgram | InverseProgram


class Described(NamedTuple):
    """A stream, as code is written from it.

    Attributes:
        program: Its functions.
        model: Name of the model.
        units: Units of drive and response.
        step: The time step [s].
        limits: Lowest and highest drive [drive].
        about: Lines about it.
        start: The state at rest at a drive [drive].
        run: Outputs, predictions and flags (N,) for inputs, each (N,), from a state.
    """

    program: Program
    model: str
    units: tuple[str, str]
    step: float
    limits: tuple[float, float]
    about: str
    start: Callable[[float], State]
    run: Callable[[tuple[np.ndarray, ...], State], tuple]


def _clipped(drive: Array, low: float, high: float) -> Array:
    return jnp.minimum(jnp.maximum(drive, low), high)


def _finite_or(value: Array, last: Array) -> tuple[Array, Array]:
    """A value, or the last one where it is no number; and whether it is none, 0 or 1."""
    finite = jnp.isfinite(value)
    return jnp.where(finite, value, last), jnp.where(finite, 0, 1)


def _selected(condition: Array, one: State, other: State) -> State:
    """One state or the other."""
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), one, other)


def sound(state: State) -> Array:
    """Whether a state was started and all of it are numbers."""
    total = sum(jnp.sum(leaf) for leaf in jax.tree.leaves(state))
    return (state["started"] == 1) & jnp.isfinite(total)


def revived_step(
    program: Program, eps: Array, state: State, inputs: tuple[Array, ...]
) -> tuple[Output, State]:
    """A step from a state as it is if it is sound, else from rest where the drive was."""

    def anew(state: State) -> State:
        return program.start(_finite_or(state["drive"], jnp.zeros(()))[0])

    whole = sound(state)
    output, after = program.step(eps, jax.lax.cond(whole, lambda s: s, anew, state), *inputs)
    return output._replace(flags=output.flags + jnp.where(whole, 0, RESTARTED)), after
