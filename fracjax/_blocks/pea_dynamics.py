"""Dynamics of a piezoelectric actuator with creep."""

from __future__ import annotations

import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._physical import require_positive


class PEADynamics(AbstractLinearBlock):
    r"""Moving mass on stack and hinge, driven by a force that creeps [F 17–20]:

        m ẍ + (c + c_p) ẋ + (k + k_p) x = k_p U + a D^μ U
        G(s) = (k_p + a s^μ) / (m s² + (c + c_p) s + k + k_p)
             = (g + g_μ s^μ) / (1 + 2 ζ s/ω_0 + s²/ω_0²),   ω_0 = 2π f_0

    From drive to displacement only ratios can be identified; they are the parameters here.  A
    displacement that keeps creeping has g_μ μ < 0.  As μ tends to 0, g and g_μ become strongly
    correlated.  With g = 0 the numerator is the fractional creep of [F 11], of order -μ.

    Args:
        gain: initial g.
        creep_gain: initial g_μ.
        mu: initial μ.
        frequency: initial f_0.
        damping: initial ζ.
        fixed_gain: whether g is fixed, for use after a hysteresis that has its own gain; g_μ is
            then a/k_p [s^μ].

    Attributes:
        gain: g = k_p/(k + k_p), one number [response/drive].
        creep_gain: g_μ = a/(k + k_p), one number [response/drive · s^μ].
        mu: μ, -0.95 < μ < 0.95, one number, dimensionless.
        frequency: f_0 = √((k + k_p)/m)/2π, one number [Hz].
        damping: ζ = (c + c_p)/(2 √(m (k + k_p))), one number, dimensionless.

    Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, equations (17) to (20).
    """

    gain: Parameter
    creep_gain: Parameter
    mu: Parameter
    frequency: Parameter
    damping: Parameter

    def __init__(
        self,
        gain: float = 1.0,
        creep_gain: float = 0.1,
        mu: float = -0.1,
        frequency: float = 1000.0,
        damping: float = 0.02,
        *,
        fixed_gain: bool = False,
    ):
        self.gain = Parameter(gain, "response/drive", gain=True, fixed=fixed_gain)
        # If the gain is fixed, creep_gain is no gain of the whole model, and is iterated in bounds.
        self.creep_gain = (
            Parameter(creep_gain, "s^mu", lower=-10.0, upper=10.0, plausible=(-0.5, 0.5))
            if fixed_gain
            else Parameter(creep_gain, "response/drive*s^mu", gain=True)
        )
        self.mu = Parameter(mu, lower=-0.95, upper=0.95, plausible=(-0.5, 0.5))
        self.frequency = Parameter(
            frequency, "Hz", lower=0.1, upper=1e8, plausible=(10.0, 1e4), logarithmic=True
        )
        self.damping = Parameter(
            damping, lower=1e-4, upper=10.0, plausible=(5e-3, 0.5), logarithmic=True
        )

    @classmethod
    def from_physical(
        cls,
        *,
        m: float,
        c: float,
        c_p: float,
        k: float,
        k_p: float,
        a: float,
        mu: float,
        n_d33: float = 1.0,
    ) -> PEADynamics:
        """The block of an actuator with known mechanical quantities.

        [F 18] calls n d33 k_p [N/V] k_p again, and so does the numerator of [F 20].  If n_d33 is 1,
        k_p is used as printed, with the same value in both places.

        Args:
            m: moving mass [kg].
            c: damping of the hinge [N s/m].
            c_p: damping of the stack [N s/m].
            k: stiffness of the hinge [N/m].
            k_p: stiffness of the stack [N/m].
            a: gain of creep [N/V · s^mu].
            mu: order of creep, dimensionless.
            n_d33: free displacement of the stack per volt [m/V].

        Returns:
            The block, in [m] per [V].

        Raises:
            InputError: if m, k + k_p or c + c_p is not positive.
        """
        stiffness, resistance = k + k_p, c + c_p
        require_positive("PEA dynamics", m=m, **{"k + k_p": stiffness, "c + c_p": resistance})
        omega = float(np.sqrt(stiffness / m))
        return cls(
            gain=n_d33 * k_p / stiffness,
            creep_gain=a / stiffness,
            mu=mu,
            frequency=omega / (2 * np.pi),
            damping=resistance / (2 * m * omega),
        )

    @property
    def accuracy(self) -> int:
        return 3

    def symbol(self, s: Array) -> Array:
        x = s * (1 / (2 * np.pi * self.frequency.value))
        numerator = self.gain.value + self.creep_gain.value * s**self.mu.value
        return numerator * (1 / (1 + x * (2 * self.damping.value + x)))

    def static_gain(self) -> ArrayLike:
        return self.gain.value
