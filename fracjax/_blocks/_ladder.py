"""A sum of relaxations whose time constants form a geometric sequence, for creep and layers."""

from __future__ import annotations

from abc import abstractmethod

import equinox as eqx
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock

RELAXATIONS = 4
"""Relaxations in a ladder; chosen by judgement."""
_RATIOS = (4.0, 12.0)
"""Ratios of the trials, a narrow and a wide ladder; chosen by judgement."""


class AbstractLadder(AbstractLinearBlock):
    r"""G(s) = 1 + Σ_i R_i(τ_i s),    τ_i = τ ρ^(i-1),    i = 1 … 4

    Each block of this family defines its R_i(z).

    Attributes:
        fastest: τ, the shortest time constant, one number [s].
        ratio: ρ, the ratio of one time constant to the next, one number, dimensionless.

    Source: Ferry, Viscoelastic Properties of Polymers (1980), chapter 1, for spectra of relaxation.
    """

    fastest: eqx.AbstractVar[Parameter]
    ratio: eqx.AbstractVar[Parameter]

    @abstractmethod
    def relaxation(self, k: int, z: Array) -> Array:
        """The contribution R_k of one relaxation.

        Args:
            k: index, 0 to 3.
            z: τ_k s, complex (F,), dimensionless.

        Returns:
            R_k(z) (F,), complex, dimensionless.
        """

    @property
    def times(self) -> Array:
        """The time constants τ_i (4,) [s]."""
        return self.fastest.value * self.ratio.value ** np.arange(RELAXATIONS)

    def symbol(self, s: Array) -> Array:
        gain = 1 + self.relaxation(0, s * self.times[0])
        for k in range(1, RELAXATIONS):
            gain = gain + self.relaxation(k, s * self.times[k])
        return gain

    def static_gain(self) -> ArrayLike:
        return 1.0


def ladders(*fastest: float) -> list[dict[str, float]]:
    """Parameter values of narrow and of wide ladders, for each shortest time constant [s]: a refit
    that starts from a narrow one does not find a wide one."""
    return [{"fastest": t, "ratio": ratio} for t in fastest for ratio in _RATIOS]
