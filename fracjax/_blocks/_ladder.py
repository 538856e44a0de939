"""Relaxations side by side, their times in a ratio: what a ladder of creep and a layer share."""

from __future__ import annotations

from abc import abstractmethod

import equinox as eqx
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock

RELAXATIONS = 4
_RATIOS = (4.0, 12.0)


class AbstractLadder(AbstractLinearBlock):
    r"""G(s) = 1 + Σ_i R_i(τ_i s),    τ_i = τ ρ^(i-1),    i = 1 … 4

    τ [s] the fastest time, ρ the ratio of one to the next, dimensionless; each law says its R_i.
    Source: Ferry, Viscoelastic Properties of Polymers (1980), chapter 1, for spectra of relaxation.
    """

    fastest: eqx.AbstractVar[Parameter]
    ratio: eqx.AbstractVar[Parameter]

    @abstractmethod
    def relaxation(self, k: int, z: Array) -> Array:
        """R_k at z = τ_k s."""

    @property
    def times(self) -> Array:
        """τ_i (4,) [s]."""
        return self.fastest.value * self.ratio.value ** np.arange(RELAXATIONS)

    def symbol(self, s: Array) -> Array:
        gain = 1 + self.relaxation(0, s * self.times[0])
        for k in range(1, RELAXATIONS):
            gain = gain + self.relaxation(k, s * self.times[k])
        return gain

    def static_gain(self) -> ArrayLike:
        return 1.0


def ladders(*fastest: float) -> list[dict[str, float]]:
    """Narrow ladders and wide ones, to be tried: from one a refit does not find the other."""
    return [{"fastest": t, "ratio": ratio} for t in fastest for ratio in _RATIOS]
