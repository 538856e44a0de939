"""A single fractional operator."""

from __future__ import annotations

from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock


class SingleOperator(AbstractLinearBlock):
    r"""One fractional operator with a gain [F 7]:

        G(s) = k s^μ,     -1 < μ < 1

    The response to a sine leads by 90°·μ.  A constant drive before t = 0 has no influence (Caputo).

    Attributes:
        k: gain, one number [response/drive · s^μ].
        mu: μ, one number, dimensionless.

    Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, equation (7) and figure 1.
    """

    k: Parameter
    mu: Parameter

    def __init__(self, k: float = 1.0, mu: float = 0.1):
        self.k = Parameter(k, "response/drive*s^mu", gain=True)
        self.mu = Parameter(mu, lower=-0.999, upper=0.999, plausible=(-0.6, 0.6))

    def symbol(self, s: Array) -> Array:
        return self.k.value * s**self.mu.value

    def static_gain(self) -> ArrayLike:
        return 0.0
