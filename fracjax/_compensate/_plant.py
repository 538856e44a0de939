"""A model as seen from a converter: drive samples in, response samples out."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._blocks import AbstractBlock
from .._operators import Grid, History


class Plant(eqx.Module):
    """The response (N,) of a block to drive samples (N,) `step` [s] apart, plus an offset.

    The drive is interpolated on a grid `oversampling` times finer: by straight lines or, if
    `smooth`, by the cubic through the four nearest samples.  Both are linear in the samples.
    """

    block: AbstractBlock
    step: np.ndarray
    offset: np.ndarray
    history: History = eqx.field(static=True)
    oversampling: int = eqx.field(static=True)
    smooth: bool = eqx.field(static=True)

    def __call__(self, drive: Array) -> Array:
        fine = upsample(drive, self.oversampling, self.smooth, self.history)
        grid = Grid(self.step / self.oversampling, self.history)
        return self.block(fine, grid)[:: self.oversampling] + self.offset


def upsample(drive: Array, oversampling: int, smooth: bool, history: History) -> Array:
    """The drive (N,) interpolated on a finer grid, in the drive's unit.

    The result has shape ((N-1)·oversampling + 1,), or (N·oversampling,) with periodic history.
    """
    if oversampling == 1:
        return drive
    if history == "periodic":
        padded = jnp.concatenate([drive[-1:], drive, drive[:2]])
    else:
        before = 2 * drive[0] - drive[1]
        after = 2 * drive[-1] - drive[-2]
        padded = jnp.concatenate([before[None], drive, after[None]])
    a, b, c, d = padded[:-3], padded[1:-2], padded[2:-1], padded[3:]
    x = (np.arange(oversampling) / oversampling)[:, None]
    if smooth:
        pieces = (
            -a * x * (x - 1) * (x - 2) / 6
            + b * (x + 1) * (x - 1) * (x - 2) / 2
            - c * (x + 1) * x * (x - 2) / 2
            + d * (x + 1) * x * (x - 1) / 6
        )
    else:
        pieces = b + x * (c - b)
    fine = pieces.T.reshape(-1)
    return fine if history == "periodic" else jnp.concatenate([fine, drive[-1:]])
