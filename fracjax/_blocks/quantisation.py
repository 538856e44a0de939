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
"""Trials of the phase φ within a step; chosen by judgement."""


class Quantisation(AbstractBlock):
    r"""The converter rounds to whole steps; the mean of its reading over the noise is

        x = y + w (E[Q(y)] - y),    E[Q(y)]/q = φ + Σ_j [ndtr((y/q - φ - j + 1/2)/b) - 1{j ≤ 0}]

    The noise before the converter rounds the corners: the n-th harmonic of the staircase is
    multiplied by exp(-2 π² n² b²).  Rounding itself has no derivative; its mean over the noise has
    one with respect to y, φ and b: large at the steps and nearly zero between them.
    The staircase can be detected if the noise is below about a third of a step.  Above that its
    mean is nearly a straight line (at b = 1/2 within 0.2 % of a step), and quantisation is
    indistinguishable from noise.  A recording that lies on no grid gets one trial with a step far
    too fine to be detected.
    Ranges: b from 0.02, below which the corners are practically sharp, to 0.5.

    Args:
        phase: initial φ.
        noise: initial b.
        step: q [response].

    Attributes:
        share: w, 1 for a converter and 0 for none, one number, dimensionless.
        phase: φ, the position of a code within a step, which depends on the unknown offset, one
            number [steps].
        noise: b, standard deviation of the noise before the converter, one number [steps].
        step: q, the step between the recording's codes, one number [response].

    Source: Widrow & Kollár, Quantization Noise (2008), chapter 19.
    """

    share: Parameter
    phase: Parameter
    noise: Parameter
    step: Array | np.ndarray

    def __init__(self, phase: float, noise: float = 0.1, *, step: float):
        self.share = Parameter(1.0, plausible=(0.5, 1.5), gain=True)
        # Half a step beyond the period on either side, so that no start is at a bound.
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
        # Reading minus true value, in steps: noise of b ≤ 0.5 reaches only the nearest five jumps.
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
    sentence="the converter that records the response rounds it to whole steps",
    equation="y + w (E[round(y)] - y)",
    source="Widrow & Kollar, Quantization Noise (2008)",
    trials=_trials,
    separated_by={
        "coulomb_friction": "slow ramps: a converter's steps repeat at the same levels, friction "
        "follows the reversals",
    },
    concealed_by="the noise, if it exceeds a third of a step",
    axes=("level", "phase", "time"),
    one_sided=True,
    rate_independent=True,
)
