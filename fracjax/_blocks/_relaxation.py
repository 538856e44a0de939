"""States that relax exponentially towards a target, from sample to sample."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array

from .._operators import History


def relax(targets: Array, exponents: Array, history: History) -> Array:
    """States (N,) that relax towards targets (N,): z_n = s_n + (z_{n-1} - s_n) exp(-x_n), x_n ≥ 0.

    The state before the first sample is 0.  With `periodic` history it is the one that a further
    cycle does not change: over a cycle z → z exp(-Σ x_n) + b, so that it is b / (1 - exp(-Σ x_n)).
    """
    steps = (targets, jnp.exp(-exponents))

    def step(state: Array, target_and_decay: tuple[Array, Array]) -> tuple[Array, Array]:
        target, decay = target_and_decay
        state = target + (state - target) * decay
        return state, state

    start = jnp.zeros(())
    if history == "periodic":
        end, _ = jax.lax.scan(step, start, steps)
        start = end / -jnp.expm1(-jnp.sum(exponents))
    return jax.lax.scan(step, start, steps)[1]
