"""The inverse of the LFDH model, as feed-forward."""

from __future__ import annotations

from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter, set_values
from ._block import AbstractLinearBlock
from .lfdh import LFDH


class InverseLFDH(AbstractLinearBlock):
    r"""From the desired displacement x_d to the command u_c [L 10, 12]:

        U_c/X_d = (1 + χ s^μ) / (k_0 + k_δ s^δ) = (c_0 + c_μ s^μ) / (1 + κ s^δ),   0 < μ, δ < 1

    k_0, k_δ and χ are those of LFDH.  Both gains c_0 and c_μ enter linearly, so that the inverse
    can be fitted by itself.  The default values are those of [L 12].

    Attributes:
        c_0: c_0 = 1/k_0 = RC / ρ K_amp (n d33)², one number [response/drive].
        c_mu: c_μ = χ/k_0, one number [response/drive · s^μ].
        kappa: the paper's κ = k_δ/k_0, one number [s^δ].
        delta: δ, one number, dimensionless.
        mu: μ, one number, dimensionless.

    Source: Zhu & Zhou (2012), equations (10) and (12).
    """

    c_0: Parameter
    c_mu: Parameter
    kappa: Parameter
    delta: Parameter
    mu: Parameter

    def __init__(
        self,
        c_0: float = 79.6379,
        c_mu: float = 16.523,
        kappa: float = 11.3885,
        delta: float = 0.046153,
        mu: float = 0.44346,
    ):
        self.c_0 = Parameter(c_0, "response/drive", gain=True)
        self.c_mu = Parameter(c_mu, "response/drive*s^mu", gain=True)
        self.kappa = Parameter(
            kappa, "s^delta", lower=1e-6, upper=1e4, plausible=(1e-2, 30.0), logarithmic=True
        )
        self.delta = Parameter(delta, lower=1e-3, upper=0.999, plausible=(0.02, 0.6))
        self.mu = Parameter(mu, lower=1e-3, upper=0.999, plausible=(0.05, 0.9))

    @classmethod
    def of(cls, lfdh: LFDH) -> InverseLFDH:
        """The inverse of an LFDH block, with its parameter values.

        Args:
            lfdh: the block, whose response unit is this one's drive unit.

        Returns:
            The inverse.
        """
        k_0 = lfdh.k_0.value
        values = {
            "c_0": 1 / k_0,
            "c_mu": lfdh.chi.value / k_0,
            "kappa": lfdh.k_delta.value / k_0,
            "delta": lfdh.delta.value,
            "mu": lfdh.mu.value,
        }
        return set_values(cls(), values)

    def symbol(self, s: Array) -> Array:
        numerator = self.c_0.value + self.c_mu.value * s**self.mu.value
        return numerator / (1 + self.kappa.value * s**self.delta.value)

    def static_gain(self) -> ArrayLike:
        return self.c_0.value
