"""States that follow from sample to sample, and their derivatives."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

_MOST_CYCLES = 20
"""Newton's steps at most."""
_SETTLED = 1e-13
"""The change of the start, relative to 1 + its size, at which a cycle counts as closed: a few
hundred times the rounding error."""
_LEAST_FORGOTTEN = 1e-6
"""1 - F' below which a cycle counts as one that depends on its start for ever; chosen by judgement.
"""

Step = Callable[[Any, Array, Any], Array]


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def recursion(step: Step, shared: Any, start: Array, inputs: Any) -> Array:
    """States (N,) x_n = step(shared, x_{n-1}, inputs_n) from a start x_{-1}, each a single number.

    `shared` is the same for all samples, `inputs` (N, …) are each sample's own; the step is a
    function of these alone.  Its derivatives are taken for all samples at once, when all states
    have been computed.  Taken sample by sample through the recursion they would cost ten times as
    much, if the step is long.
    """

    def one(state: Array, sample: Any) -> tuple[Array, Array]:
        state = step(shared, state, sample)
        return state, state

    return jax.lax.scan(one, start, inputs)[1]


@recursion.defjvp
def _recursion_jvp(step: Step, at: tuple, along: tuple) -> tuple[Array, Array]:
    """The states (N,) and their change x'_n = a_n x'_{n-1} + b_n: a_n is the derivative of the step
    with respect to the state before, b_n its change through `shared` and `inputs`."""
    shared, start, inputs = at
    states = recursion(step, shared, start, inputs)
    slopes, direct = _changes(step, shared, _before(start, states), inputs, along)
    return states, _accumulated(slopes, direct.at[0].add(slopes[0] * along[1]))


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def settled(step: Step, shared: Any, start: Array, inputs: Any) -> Array:
    """States (N,) of the steady cycle, which ends where it begins, found by Newton's method.

    A cycle x → F(x) has the derivative F' < 1 with respect to its start x, and the next start is
    x + (F - x) / (1 - F').  The derivative of the result is that of the condition x = F(x).  If F'
    is 1, the result is the cycle that follows the start, or a later one.
    """

    def improve(progress: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
        first, cycles = progress[0], progress[3]
        states = recursion(step, shared, first, inputs)
        forgotten = 1 - jnp.prod(_slopes(step, shared, _before(first, states), inputs))
        change = (states[-1] - first) / jnp.where(forgotten > _LEAST_FORGOTTEN, forgotten, 1.0)
        return first + change, states, change, cycles + 1

    def is_changing(progress: tuple[Array, Array, Array, Array]) -> Array:
        first, _, change, cycles = progress
        return (jnp.abs(change) > _SETTLED * (1 + jnp.abs(first))) & (cycles < _MOST_CYCLES)

    (count,) = {len(each) for each in jax.tree.leaves(inputs)}
    unknown = jnp.full((count,), jnp.inf, start.dtype)
    progress = start, unknown, unknown[0], jnp.zeros((), int)
    return jax.lax.while_loop(is_changing, improve, progress)[1]


@settled.defjvp
def _settled_jvp(step: Step, at: tuple, along: tuple) -> tuple[Array, Array]:
    """The states (N,) and their change, as for a recursion whose start changes as its end does."""
    shared, start, inputs = at
    states = settled(step, shared, start, inputs)
    slopes, direct = _changes(step, shared, _before(states[-1], states), inputs, along)
    once, kept = _accumulated(slopes, direct), jnp.cumprod(slopes)
    forgotten = 1 - kept[-1]
    forgets = forgotten > _LEAST_FORGOTTEN
    return states, once + kept * forgets * once[-1] / jnp.where(forgets, forgotten, 1.0)


def _before(start: Array, states: Array) -> Array:
    """The state before each sample (N,), from the start and the states (N,)."""
    return jnp.append(start, states[:-1])


def _changes(
    step: Step, shared: Any, before: Array, inputs: Any, along: tuple
) -> tuple[Array, Array]:
    """Each step's derivative (N,) with respect to the state before, and its change (N,) through
    `shared` and `inputs`."""
    steps = jax.vmap(step, (None, 0, 0))
    _, direct = jax.jvp(lambda s, i: steps(s, before, i), (shared, inputs), (along[0], along[2]))
    return _slopes(step, shared, before, inputs), direct


def _slopes(step: Step, shared: Any, before: Array, inputs: Any) -> Array:
    """Each step's derivative (N,) with respect to the state before."""

    def steps(states: Array) -> Array:
        return jax.vmap(step, (None, 0, 0))(shared, states, inputs)

    return jax.jvp(steps, (before,), (jnp.ones_like(before),))[1]


def _accumulated(slopes: Array, direct: Array) -> Array:
    """x (N,) with x_n = a_n x_{n-1} + b_n and x_{-1} = 0, from slopes a (N,) and direct changes b
    (N,).

    It is solved as a linear system, since JAX cannot transpose a scan within a derivative.
    """

    def matvec(x: Array) -> Array:
        return x - slopes * jnp.append(0.0, x[:-1])

    def one(x: Array, slope_and_change: tuple[Array, Array]) -> tuple[Array, Array]:
        slope, b = slope_and_change
        x = slope * x + b
        return x, x

    def forwards(_: Callable, b: Array) -> Array:
        return jax.lax.scan(one, jnp.zeros(()), (slopes, b))[1]

    def backwards(_: Callable, b: Array) -> Array:
        later = jnp.append(slopes[1:], 0.0)
        return jax.lax.scan(one, jnp.zeros(()), (later, b), reverse=True)[1]

    return jax.lax.custom_linear_solve(matvec, direct, forwards, backwards)
