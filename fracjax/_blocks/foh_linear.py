"""The linear terms of fractional-order hysteresis (FOH)."""

from __future__ import annotations

from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock

LARGEST_ORDER = 0.95
"""The largest |order| of FOH: at 1 the term would be a derivative or an integral, which other terms
can replace; chosen by judgement."""


class FOHLinear(AbstractLinearBlock):
    r"""The terms of FOH that are linear in the drive [F 8, first term of F 9]:

        k_l u + k_h D^α u,     G(s) = k_l + k_h s^α

    The paper's linear module is k_l u alone; it assigns k_h D^α u, though linear in u, to the
    nonlinear one.

    Attributes:
        k_l: linear gain, one number [response/drive].
        k_h: gain of the fractional term, one number [response/drive · s^α].
        alpha: α, -0.95 < α < 0.95, one number, dimensionless.

    Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, equations (8) and (9).
    """

    k_l: Parameter
    k_h: Parameter
    alpha: Parameter

    def __init__(self, k_l: float = 0.5, k_h: float = 0.5, alpha: float = 0.1):
        self.k_l = Parameter(k_l, "response/drive", gain=True)
        self.k_h = Parameter(k_h, "response/drive*s^alpha", gain=True)
        self.alpha = Parameter(
            alpha, lower=-LARGEST_ORDER, upper=LARGEST_ORDER, plausible=(-0.6, 0.6)
        )

    def symbol(self, s: Array) -> Array:
        return self.k_l.value + self.k_h.value * s**self.alpha.value

    def static_gain(self) -> ArrayLike:
        return self.k_l.value
