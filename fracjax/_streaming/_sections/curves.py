"""Laws without memory: the section is the block itself, one sample long."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from ..._blocks import (
    AbstractBlock,
    CubicNonlinearity,
    Electrostriction,
    Saturation,
    SensorNonlinearity,
)
from ..._operators import Grid
from ._section import Response, Sampling, Section, State, section_of


class Curve(Section):
    """A function of this sample's drive alone."""

    def __init__(self, block: AbstractBlock, step: float):
        self.block, self.grid = block, Grid(step)
        self.gains, self.labels = np.ones(1), (type(block).__name__,)

    def start(self, drive: Array) -> State:
        return ()

    def begin(self, state: State) -> Response:
        return lambda drive: (self.block(jnp.reshape(drive, (1,)), self.grid), ())


@section_of.register(CubicNonlinearity)
@section_of.register(Electrostriction)
@section_of.register(Saturation)
@section_of.register(SensorNonlinearity)
def _(block: AbstractBlock, sampling: Sampling) -> Section:
    return Curve(block, sampling.step)
