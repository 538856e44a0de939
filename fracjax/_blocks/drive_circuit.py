"""The circuit that drives the stack, with its gain."""

from __future__ import annotations

from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._physical import require_positive


class DriveCircuit(AbstractLinearBlock):
    r"""A resistance charges the stack's capacitance, behind an amplifier [L 5]:

        RC du_pzt/dt + u_pzt = K_amp n d33 u_c,     G(s) = G_0 / (1 + τ s)

    The paper calls u_pzt a voltage, but with n d33 [m/V] in its gain it is a displacement; G_0 has
    the recording's units.  DriveLag is the same block with unit gain.

    Attributes:
        gain: G_0 = K_amp n d33, one number [response/drive].
        time_constant: τ = RC, one number [s].

    Source: Zhu & Zhou, Modeling and Compensation for Hysteresis Nonlinearity of a Piezoelectrically
    Actuated Fast Tool Servo Based on a Novel Linear Model (2012), equation (5).
    """

    gain: Parameter
    time_constant: Parameter

    def __init__(self, gain: float = 1.0, time_constant: float = 1e-3):
        self.gain = Parameter(gain, "response/drive", gain=True)
        self.time_constant = Parameter(
            time_constant, "s", lower=1e-7, upper=1.0, plausible=(1e-6, 0.05), logarithmic=True
        )

    @classmethod
    def from_physical(
        cls, *, K_amp: float, n: float, d33: float, R: float, C: float
    ) -> DriveCircuit:
        """The block of a circuit with known components.

        Args:
            K_amp: amplification, dimensionless.
            n: number of layers.
            d33: piezoelectric constant [response/V].
            R: resistance [ohm].
            C: capacitance [F].

        Returns:
            The block, with τ = RC [s].

        Raises:
            InputError: if R or C is not positive.
        """
        require_positive("drive circuit", R=R, C=C)
        return cls(K_amp * n * d33, R * C)

    def symbol(self, s: Array) -> Array:
        return self.gain.value / (1 + self.time_constant.value * s)

    def static_gain(self) -> ArrayLike:
        return self.gain.value
