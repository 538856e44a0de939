"""Fractional-order hysteresis (FOH) of Xu et al. 2024."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from .._operators import Grid, derivative, speed
from .._parameters import Parameter, replace_parameters
from ._block import AbstractBlock
from .foh_linear import FOHLinear
from .foh_rate_term import FOHRateTerm


class FOH(AbstractBlock):
    r"""Linear part plus fractional part plus a rate-weighted fractional part [F 8, 9]:

        f(u) = k_l u + k_h D^α u + k_p |u̇| D^β u

    The orders satisfy -0.95 < α, β < 0.95.  The derivative of |u̇| at its kink is 0, as in JAX.
    `linear_part` and `rate_term` are its terms as separate blocks.

    The paper's Table 1 gives k_l = -0.0017418, k_h = 0.0044141, β = -0.13501 and prints 0.02729
    for both k_p and α, surely a misprint: at its 1 Hz and 100 V that k_p would make the last term
    two thousand times the others.  They are not the default values.

    Attributes:
        k_l: linear gain, one number [response/drive].
        k_h: gain of the fractional term, one number [response/drive · s^α].
        k_p: gain of the rate-weighted term, one number [response/drive² · s^(1+β)].
        alpha: α, one number, dimensionless.
        beta: β, one number, dimensionless.

    Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, equations (8) and (9).
    """

    k_l: Parameter
    k_h: Parameter
    k_p: Parameter
    alpha: Parameter
    beta: Parameter

    def __init__(
        self,
        k_l: float = 0.5,
        k_h: float = 0.5,
        k_p: float = 0.0,
        alpha: float = 0.1,
        beta: float = -0.1,
    ):
        linear, term = FOHLinear(k_l, k_h, alpha), FOHRateTerm(k_p, beta)
        self.k_l, self.k_h, self.alpha = linear.k_l, linear.k_h, linear.alpha
        self.k_p, self.beta = term.k_p, term.beta

    @property
    def linear(self) -> bool:
        return False

    @property
    def linear_part(self) -> FOHLinear:
        """k_l u + k_h D^α u, with these parameters."""
        return replace_parameters(
            FOHLinear(), {"k_l": self.k_l, "k_h": self.k_h, "alpha": self.alpha}
        )

    @property
    def rate_term(self) -> FOHRateTerm:
        """k_p |u̇| D^β u, with these parameters."""
        return replace_parameters(FOHRateTerm(), {"k_p": self.k_p, "beta": self.beta})

    def __call__(self, drive: Array, grid: Grid) -> Array:
        # Not by the single convolution of `linear_part`: here the derivative with respect to each
        # gain needs no further transform.  Both orders' transforms together take three quarters of
        # the time of one after the other.
        orders = jnp.stack([self.alpha.value, self.beta.value])
        alpha, beta = derivative(orders[:, None], drive, grid)
        weighted = speed(drive, grid) * beta
        return self.k_l.value * drive + self.k_h.value * alpha + self.k_p.value * weighted
