"""States that follow from sample to sample, and what a change makes of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

_UNROLLED = 8

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
    before = jnp.append(start, states[:-1])
    steps = jax.vmap(step, (None, 0, 0))
    _, slopes = jax.jvp(lambda x: steps(shared, x, inputs), (before,), (jnp.ones_like(before),))
    _, moved = jax.jvp(lambda s, i: steps(s, before, i), (shared, inputs), (along[0], along[2]))
    return states, _carried(slopes, moved.at[0].add(slopes[0] * along[1]))


def run_in(step: Step, shared: Any, start: Array, inputs: Any, cycles: int) -> Array:
    """The state that a recursion has come to after cycles of the same inputs."""

    def cycle(state: Array, _: None) -> tuple[Array, None]:
        return recursion(step, shared, state, inputs)[-1], None

    return jax.lax.scan(cycle, start, length=cycles)[0]


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
