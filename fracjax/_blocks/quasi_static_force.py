"""Quasi-static force of the stack on its mechanism."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock


class QuasiStaticForce(AbstractLinearBlock):
    r"""Force of the stack's stiffness, far below the first resonance [L 6]:

        F = k_pzt x,     x = n d33 u_pzt

    The drive is the displacement x, the response the force F.  n d33 belongs to the block before.

    Attributes:
        stiffness: k_pzt, one number [response/drive], such as N/µm.

    Source: Zhu & Zhou (2012), equation (6).
    """

    stiffness: Parameter

    def __init__(self, stiffness: float = 1.0):
        self.stiffness = Parameter(stiffness, "response/drive", gain=True)

    def symbol(self, s: Array) -> Array:
        return self.stiffness.value * jnp.ones_like(s)

    def static_gain(self) -> ArrayLike:
        return self.stiffness.value
