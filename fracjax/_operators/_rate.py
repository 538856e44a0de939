"""The rate of a sampled signal."""

import jax.numpy as jnp
from jax import Array

from ._grid import Grid


def rate(signal: Array, grid: Grid) -> Array:
    """d/dt of a signal (N,) by fourth-order central differences; units: signal / s.

    Before the first sample the signal counts as held (`periodic`: as wrapped), after the last one
    as going on straight.
    """
    if grid.history == "periodic":
        padded = jnp.concatenate([signal[-2:], signal, signal[:2]])
    else:
        slope = signal[-1] - signal[-2]
        padded = jnp.concatenate(
            [jnp.full(2, signal[0]), signal, signal[-1] + slope * jnp.arange(1, 3)]
        )
    near = padded[3:-1] - padded[1:-3]
    far = padded[4:] - padded[:-4]
    return (8 * near - far) / (12 * grid.step)
