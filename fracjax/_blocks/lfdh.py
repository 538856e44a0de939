"""Linear fractional differentiation hysteresis (LFDH) of Zhu et al. 2012."""

from __future__ import annotations

from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._physical import require_positive


class LFDH(AbstractLinearBlock):
    r"""A linear model with fractional powers in numerator and denominator [L 8, 9]:

        G(s) = (k_0 + k_δ s^δ) / (1 + χ s^μ),      0 < μ, δ < 1

    Both gains k_0 and k_δ enter linearly.  The default values are those identified in [L 11].

    Attributes:
        k_0: k_0 = ρ K_amp (n d33)² / RC, one number [response/drive].
        k_delta: k_δ = k_0 κ, one number [response/drive · s^δ].
        chi: χ, one number [s^μ].
        delta: δ, one number, dimensionless.
        mu: μ, one number, dimensionless.

    Source: Zhu & Zhou, Modeling and Compensation for Hysteresis Nonlinearity of a Piezoelectrically
    Actuated Fast Tool Servo Based on a Novel Linear Model (2012), equations (8), (9), (11).
    """

    k_0: Parameter
    k_delta: Parameter
    chi: Parameter
    delta: Parameter
    mu: Parameter

    def __init__(
        self,
        k_0: float = 1 / 79.6379,
        k_delta: float = 11.3885 / 79.6379,
        chi: float = 16.523 / 79.6379,
        delta: float = 0.046153,
        mu: float = 0.44346,
    ):
        self.k_0 = Parameter(k_0, "response/drive", gain=True)
        self.k_delta = Parameter(k_delta, "response/drive*s^delta", gain=True)
        self.chi = Parameter(
            chi, "s^mu", lower=1e-6, upper=1e3, plausible=(1e-2, 3.0), logarithmic=True
        )
        self.delta = Parameter(delta, lower=1e-3, upper=0.999, plausible=(0.02, 0.6))
        self.mu = Parameter(mu, lower=1e-3, upper=0.999, plausible=(0.05, 0.9))

    @classmethod
    def from_physical(
        cls,
        *,
        rho: float,
        K_amp: float,
        n: float,
        d33: float,
        R: float,
        C: float,
        kappa: float,
        chi: float,
        delta: float,
        mu: float,
    ) -> LFDH:
        """The block with the quantities of [L 9]: k_0 = ρ K_amp (n d33)²/RC and k_δ = k_0 κ.

        By [L 5] and [L 6] RC would multiply only the rate of x.  [L 7] multiplies x by it too, and
        [L 9] has 1/RC in its gain: a mistake of the paper, for which ρ compensates.

        Args:
            rho: ρ, in the unit that gives k_0 the unit [response/drive].
            K_amp: amplification, dimensionless.
            n: number of layers.
            d33: piezoelectric constant [m/V].
            R: resistance [ohm].
            C: capacitance [F].
            kappa: κ [s^delta].
            chi: χ [s^mu].
            delta: δ, dimensionless.
            mu: μ, dimensionless.

        Returns:
            The block.

        Raises:
            InputError: if R or C is not positive.
        """
        require_positive("LFDH", R=R, C=C)
        k_0 = rho * K_amp * (n * d33) ** 2 / (R * C)
        return cls(k_0, k_0 * kappa, chi, delta, mu)

    def symbol(self, s: Array) -> Array:
        numerator = self.k_0.value + self.k_delta.value * s**self.delta.value
        return numerator / (1 + self.chi.value * s**self.mu.value)

    def static_gain(self) -> ArrayLike:
        return self.k_0.value
