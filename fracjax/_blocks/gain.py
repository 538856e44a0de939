"""A plain gain."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock


class Gain(AbstractLinearBlock):
    r"""The actuator of the first approximation: it follows its drive in proportion.

        y = k u

    An effect that is fitted alone is fitted on this actuator.

    Attributes:
        k: k, one number [response/drive].

    Source: Adriaens, de Koning & Banning, IEEE/ASME Trans. Mechatron. 5 (2000) 331, the linear
    relation that hysteresis, creep and vibration depart from.
    """

    k: Parameter

    def __init__(self, k: float = 1.0):
        self.k = Parameter(k, "response/drive", gain=True)

    def symbol(self, s: Array) -> Array:
        return self.k.value * jnp.ones_like(s)

    def static_gain(self) -> ArrayLike:
        return self.k.value
