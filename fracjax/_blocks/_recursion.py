"""States that follow from sample to sample, and what a change makes of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

_UNROLLED = 8
_MOST_CYCLES, _SETTLED, _LEAST_FORGOTTEN = 20, 1e-13, 1e-6

Step = Callable[[Any, Array, Any], Array]


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def recursion(step: Step, shared: Any, start: Array, inputs: Any) -> Array:
    """States (N,) x_n = step(shared, x_{n-1}, inputs_n) from a start x_{-1}, each a single number.

    `shared` is the same for all samples, `inputs` (N, …) are each sample's own; the step is a
    function of these alone.  Its derivatives are taken for all samples at once, where the states
    are known.  One sample after the other, through the recursion, they would cost ten times as
    much where the step is long.
    """

    def one(state: Array, given: Any) -> tuple[Array, Array]:
        state = step(shared, state, given)
        return state, state

    return jax.lax.scan(one, start, inputs)[1]


@recursion.defjvp
def _changed(step: Step, at: tuple, along: tuple) -> tuple[Array, Array]:
    """The states, and x'_n = a_n x'_{n-1} + b_n: a what the step makes of a change of the state
    before, b of a change of what it was given."""
    shared, start, inputs = at
    states = recursion(step, shared, start, inputs)
    before = _before(start, states)
    steps, slopes = jax.vmap(step, (None, 0, 0)), _slopes(step, shared, before, inputs)
    _, moved = jax.jvp(lambda s, i: steps(s, before, i), (shared, inputs), (along[0], along[2]))
    return states, _carried(slopes, moved.at[0].add(slopes[0] * along[1]))


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def settled(step: Step, shared: Any, start: Array, inputs: Any) -> Array:
    """The state that one more cycle of the same inputs does not change, sought from a start.

    By Newton's steps: a cycle F forgets a share of what it starts from, and x + (F - x) / (1 - F')
    is what would be left after infinitely many.  Its derivative is that of the condition x = F(x).
    Where a cycle forgets nothing it is the state after some.
    """

    def improved(found: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        state, _, cycles = found
        after, forgotten = _cycle(step, shared, state, inputs)
        change = (after - state) / jnp.where(forgotten > _LEAST_FORGOTTEN, forgotten, 1.0)
        return state + change, change, cycles + 1

    def moves(found: tuple[Array, Array, Array]) -> Array:
        state, change, cycles = found
        return (jnp.abs(change) > _SETTLED * (1 + jnp.abs(state))) & (cycles < _MOST_CYCLES)

    begun = start, jnp.full_like(start, jnp.inf), jnp.zeros((), int)
    return jax.lax.while_loop(moves, improved, begun)[0]


@settled.defjvp
def _settled_elsewhere(step: Step, at: tuple, along: tuple) -> tuple[Array, Array]:
    shared, start, inputs = at
    state = settled(step, shared, start, inputs)

    def once(shared: Any, inputs: Any) -> Array:
        return recursion(step, shared, state, inputs)[-1]

    _, change = jax.jvp(once, (shared, inputs), (along[0], along[2]))
    _, forgotten = _cycle(step, shared, state, inputs)
    forgets = forgotten > _LEAST_FORGOTTEN
    return state, forgets * change / jnp.where(forgets, forgotten, 1.0)


def _cycle(step: Step, shared: Any, state: Array, inputs: Any) -> tuple[Array, Array]:
    """The state after a cycle, and which share of a change of the one before that has forgotten."""
    states = recursion(step, shared, state, inputs)
    return states[-1], 1 - jnp.prod(_slopes(step, shared, _before(state, states), inputs))


def _before(start: Array, states: Array) -> Array:
    return jnp.append(start, states[:-1])


def _slopes(step: Step, shared: Any, before: Array, inputs: Any) -> Array:
    """What each step (N,) makes of a small change of the state before."""

    def steps(states: Array) -> Array:
        return jax.vmap(step, (None, 0, 0))(shared, states, inputs)

    return jax.jvp(steps, (before,), (jnp.ones_like(before),))[1]


def _carried(slopes: Array, moved: Array) -> Array:
    """x (N,) with x_n = a_n x_{n-1} + b_n and x_{-1} = 0, slopes a and b as it moved (N,).

    As the solution of a linear system, for JAX cannot turn round a scan within a derivative.
    """

    def left(x: Array) -> Array:
        return x - slopes * jnp.append(0.0, x[:-1])

    def one(x: Array, given: tuple[Array, Array]) -> tuple[Array, Array]:
        slope, b = given
        x = slope * x + b
        return x, x

    def forwards(_: Callable, b: Array) -> Array:
        return jax.lax.scan(one, jnp.zeros(()), (slopes, b), unroll=_UNROLLED)[1]

    def backwards(_: Callable, b: Array) -> Array:
        later = jnp.append(slopes[1:], 0.0)
        return jax.lax.scan(one, jnp.zeros(()), (later, b), reverse=True, unroll=_UNROLLED)[1]

    return jax.lax.custom_linear_solve(left, moved, forwards, backwards)
