"""The rate-weighted term of fractional-order hysteresis (FOH)."""

from __future__ import annotations

from jax import Array

from .._operators import Grid, derivative, speed
from .._parameters import Parameter
from ._block import AbstractBlock
from .foh_linear import LARGEST_ORDER


class FOHRateTerm(AbstractBlock):
    r"""The term of FOH that is not linear in the drive [second term of F 9]:

        k_p |u̇| D^β u

    At the corners of a triangle |u̇| has the value of both sides.

    Attributes:
        k_p: gain, one number [response/drive² · s^(1+β)].
        beta: β, -0.95 < β < 0.95, one number, dimensionless.

    Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, equation (9).
    """

    k_p: Parameter
    beta: Parameter

    def __init__(self, k_p: float = 0.0, beta: float = -0.1):
        self.k_p = Parameter(k_p, "response/drive^2*s^(1+beta)", gain=True)
        self.beta = Parameter(
            beta, lower=-LARGEST_ORDER, upper=LARGEST_ORDER, plausible=(-0.8, 0.8)
        )

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        weighted = speed(drive, grid) * derivative(self.beta.value, drive, grid)
        return self.k_p.value * weighted
