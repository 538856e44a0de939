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
    slopes, moved = _changes(step, shared, _before(start, states), inputs, along)
    return states, _carried(slopes, moved.at[0].add(slopes[0] * along[1]))


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def settled(step: Step, shared: Any, start: Array, inputs: Any) -> Array:
    """States (N,) of the cycle that ends where it begins, sought from a start.

    By Newton's steps: a cycle F forgets a share of what it starts from, and x + (F - x) / (1 - F')
    is what would be left after infinitely many.  Its derivative is that of the condition x = F(x).
    Where a cycle forgets nothing it is that which follows the start, or some cycles later.
    """

    def improved(found: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
        begun, cycles = found[0], found[3]
        states = recursion(step, shared, begun, inputs)
        forgotten = 1 - jnp.prod(_slopes(step, shared, _before(begun, states), inputs))
        change = (states[-1] - begun) / jnp.where(forgotten > _LEAST_FORGOTTEN, forgotten, 1.0)
        return begun + change, states, change, cycles + 1

    def moves(found: tuple[Array, Array, Array, Array]) -> Array:
        begun, _, change, cycles = found
        return (jnp.abs(change) > _SETTLED * (1 + jnp.abs(begun))) & (cycles < _MOST_CYCLES)

    (count,) = {len(each) for each in jax.tree.leaves(inputs)}
    unknown = jnp.full((count,), jnp.inf, start.dtype)
    begun = start, unknown, unknown[0], jnp.zeros((), int)
    return jax.lax.while_loop(moves, improved, begun)[1]


@settled.defjvp
def _settled_elsewhere(step: Step, at: tuple, along: tuple) -> tuple[Array, Array]:
    """As a recursion's, from the change of the start with which the cycle ends too."""
    shared, start, inputs = at
    states = settled(step, shared, start, inputs)
    slopes, moved = _changes(step, shared, _before(states[-1], states), inputs, along)
    once, kept = _carried(slopes, moved), jnp.cumprod(slopes)
    forgotten = 1 - kept[-1]
    forgets = forgotten > _LEAST_FORGOTTEN
    return states, once + kept * forgets * once[-1] / jnp.where(forgets, forgotten, 1.0)


def _before(start: Array, states: Array) -> Array:
    return jnp.append(start, states[:-1])


def _changes(
    step: Step, shared: Any, before: Array, inputs: Any, along: tuple
) -> tuple[Array, Array]:
    """What each step (N,) makes of a small change of the state before, and of what it is given."""
    steps = jax.vmap(step, (None, 0, 0))
    _, moved = jax.jvp(lambda s, i: steps(s, before, i), (shared, inputs), (along[0], along[2]))
    return _slopes(step, shared, before, inputs), moved


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
