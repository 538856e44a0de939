"""Drive limited by its supply."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values


class Saturation(AbstractBlock):
    r"""The amplifier cannot exceed its supply:

        v = min(u, u_max)

    The derivative with respect to u_max is 1 where the drive is cut and 0 elsewhere.

    Args:
        threshold: initial u_max.
        low: the lowest drive of the recording [drive].
        high: the highest drive of the recording [drive].

    Attributes:
        threshold: u_max, one number [drive].

    Source: Khalil, Nonlinear Systems (2002), section 1.2.
    """

    threshold: Parameter

    def __init__(self, threshold: float, *, low: float, high: float):
        lowest, highest = low + 0.3 * (high - low), high
        self.threshold = Parameter(threshold, "drive", lower=lowest, upper=highest)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return jnp.minimum(drive, self.threshold.value)


def _trials(setting: Setting) -> list:
    low, high = setting.drive_low, setting.drive_high
    block = Saturation(0.5 * (low + high), low=low, high=high)
    # A threshold just below the highest drive cuts, and shows itself, only at the peaks.  With
    # trials a factor of three apart, one between them is found with half its strength in either.
    cut = np.geomspace(0.4, 1.5e-4, 20)
    return at_values(block, [{"threshold": high - share * (high - low)} for share in cut])


EFFECT = Effect(
    name="saturation",
    site="drive",
    sentence="the drive is cut off above a threshold, as by an amplifier at its supply",
    equation="min(u, u_max)",
    source="Khalil, Nonlinear Systems (2002), section 1.2",
    trials=_trials,
    separated_by={"electrostriction": "a measured drive: saturation is flat beyond a threshold"},
    concealed_by="the asymmetry term k_p of the hysteresis",
    axes=("level", "phase", "harmonics"),
    one_sided=True,
    rate_independent=True,
)
