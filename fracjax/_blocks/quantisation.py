"""Steps of the converter that records the response."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.special import ndtr

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values

_PHASES = 8


class Quantisation(AbstractBlock):
    r"""The converter knows whole steps only; on average over its noise it reads

        x = y + w (E[Q(y)] - y),    E[Q(y)]/q = φ + Σ_j [ndtr((y/q - φ - j + 1/2)/b) - 1{j ≤ 0}]

    q [response] is the step, read from the recording's own codes; φ the place of a code within a
    step, which depends on the unknown offset and so is fitted; b [steps] the noise before the
    converter, which rounds the corners: the staircase's n-th harmonic falls by exp(-2 π² n² b²).
    Rounding itself has no derivative; its mean over the noise has one, in y as in φ and b, and this
    is what is differentiated: steep at the steps and nearly nothing between.  w is 1 for a
    converter, and 0 for none.
    What is seen: the staircase, where the noise is below about a third of a step.  Above, its mean
    is a straight line again (at b = 1/2 it departs by 0.2 % of a step), and quantisation is
    noise: then it cannot be told from noise, nor is it.  A recording that lies on no grid gets one
    trial with a step far too fine to be seen.
    Ranges: b from 0.02, below which the corners are sharp to all purposes, to 0.5.
    Source: Widrow & Kollár, Quantization Noise (2008), chapter 19.
    """

    share: Parameter
    phase: Parameter
    noise: Parameter
    step: Array | np.ndarray

    def __init__(self, phase: float, noise: float = 0.1, *, step: float):
        self.share = Parameter(1.0, plausible=(0.5, 1.5), gain=True)
        # Half a step beyond the period on either side, so that no start is at a wall.
        self.phase = Parameter(phase, lower=-0.5, upper=1.5, plausible=(-0.5, 1.5))
        self.noise = Parameter(
            noise, lower=0.02, upper=0.5, plausible=(0.02, 0.5), logarithmic=True
        )
        self.step = np.asarray(step, float)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        place = drive / self.step - self.phase.value
        within = place - jnp.floor(place)
        # Read minus true, in steps: the nearest five jumps are all that noise up to b reaches.
        steps = sum(
            ndtr((within - jump) / self.noise.value) for jump in (-1.5, -0.5, 0.5, 1.5, 2.5)
        )
        error = steps - 2 - within
        return drive + self.share.value * self.step * error


def _trials(setting: Setting) -> list:
    if setting.resolution == 0:
        return [Quantisation(0.0, step=1e-6 * setting.response_span)]
    block = Quantisation(0.0, step=setting.resolution)
    return at_values(block, [{"phase": place / _PHASES} for place in range(_PHASES)])


EFFECT = Effect(
    name="quantisation",
    site="response",
    sentence="the converter that records the response knows whole steps only, and rounds to them",
    equation="y + w (E[round(y)] - y)",
    source="Widrow & Kollar, Quantization Noise (2008)",
    trials=_trials,
    separated_by={
        "coulomb_friction": "slow ramps: a converter's steps repeat at the same levels, what "
        "friction holds back follows the reversals",
    },
    concealed_by="the noise, once it reaches a third of a step",
    axes=("level", "phase", "time"),
    one_sided=True,
)
