"""Creep: the paper's fractional power law, the logarithmic law, and a sum of relaxations."""

from __future__ import annotations

import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._effect import Effect, Setting, at_values
from ._ladder import RELAXATIONS, AbstractLadder, ladders


class Creep(AbstractLinearBlock):
    r"""A fractional integral of small order [F 11]:

        G_c(s) = k_c s^-μ        (constant phase -90°·μ)

    After a step it continues as t^μ/Γ(1+μ) ≈ 1 + μ (ln t + 0.577…): the logarithmic law, with
    2.303 μ per decade of time.  Creep is counted from the value before t = 0.  After a hysteresis
    k_c merges with that block's gains, and is fixed there.

    Args:
        k_c: initial k_c.
        mu: initial μ.
        fixed_gain: whether k_c is fixed.

    Attributes:
        k_c: gain, one number [s^-μ].
        mu: μ, one number, dimensionless.

    Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, equations (10) and (11).
    """

    k_c: Parameter
    mu: Parameter

    def __init__(self, k_c: float = 1.0, mu: float = 0.0072, *, fixed_gain: bool = False):
        self.k_c = Parameter(k_c, "s^-mu", gain=True, fixed=fixed_gain)
        self.mu = Parameter(mu, lower=1e-5, upper=0.3, plausible=(1e-3, 0.04), logarithmic=True)

    def symbol(self, s: Array) -> Array:
        return self.k_c.value * s**-self.mu.value

    def static_gain(self) -> ArrayLike:
        return self.k_c.value


# Nodes of the trapezoidal rule in ln x for ∫ exp(-x)/(z+x) dx: the integrand is analytic in a strip
# of half-width π/2 for Re z ≥ 0, so that a spacing of 0.7 errs by about exp(-π²/0.7) ≈ 1e-6.
_NODES = np.exp(np.arange(-16.0, 3.6, 0.7))
_WEIGHTS = 0.7 * _NODES * np.exp(-_NODES)


class LogarithmicCreep(AbstractLinearBlock):
    r"""Each change of the response continues with the logarithm of time:

        step response 1 + γ log10(1 + t/t_0),      G(s) = 1 + γ/ln 10 · e^z E_1(z),   z = s t_0

    The exponential integral is a sum of relaxations, e^z E_1(z) = ∫ exp(-x)/(z + x) dx, which is
    also the physics: many Kelvin–Voigt elements in series.

    Attributes:
        gamma: γ, creep per decade of time, one number, dimensionless.
        onset: t_0, the time at which creep sets in, one number [s].

    Source: Jung & Gweon, Rev. Sci. Instrum. 71 (2000) 1896; Abramowitz & Stegun 5.1.28.
    """

    gamma: Parameter
    onset: Parameter

    def __init__(self, gamma: float = 0.01, onset: float = 0.05):
        self.gamma = Parameter(
            gamma, lower=1e-5, upper=0.5, plausible=(1e-4, 0.1), logarithmic=True
        )
        self.onset = Parameter(
            onset, "s", lower=1e-4, upper=30.0, plausible=(2e-4, 10.0), logarithmic=True
        )

    def symbol(self, s: Array) -> Array:
        z = s * self.onset.value
        # In real arithmetic, whose quotients take a fifth of the time of complex ones.
        real, imaginary = z.real[..., None] + _NODES, z.imag
        shares = _WEIGHTS / (real**2 + imaginary[..., None] ** 2)
        integral = (real * shares).sum(axis=-1) - 1j * imaginary * shares.sum(axis=-1)
        return 1 + self.gamma.value / np.log(10) * integral

    def static_gain(self) -> ArrayLike:
        return 1.0


class KelvinVoigtCreep(AbstractLadder):
    r"""A few relaxations in series with the actuator, each a spring parallel to a damper:

        G(s) = 1 + Σ_i g_i/(1 + τ_i s),    τ_i = τ ρ^(i-1),    i = 1 … 4

    Equal shares approximate the logarithmic law, with g/log10 ρ per decade, between the shortest
    and the longest τ_i; the shares of real actuators are less even.

    Args:
        gain: initial value of every g_i.
        fastest: initial τ.
        ratio: initial ρ.

    Attributes:
        gains: g_i (4,), the share of the response that comes late with τ_i, dimensionless.
        fastest: τ, the shortest time constant, one number [s].
        ratio: ρ, the ratio of one time constant to the next, one number, dimensionless.

    Source: Croft, Shed & Devasia, J. Dyn. Syst. Meas. Control 123 (2001) 35, with three elements.
    """

    gains: Parameter
    fastest: Parameter
    ratio: Parameter

    def __init__(self, gain: float = 0.01, fastest: float = 0.05, ratio: float = 6.0):
        gains = np.full(RELAXATIONS, gain)
        self.gains = Parameter(gains, lower=0.0, upper=0.5, plausible=(0.0, 0.1))
        self.fastest = Parameter(
            fastest, "s", lower=1e-4, upper=30.0, plausible=(1e-3, 10.0), logarithmic=True
        )
        self.ratio = Parameter(ratio, lower=2.0, upper=30.0, plausible=(3.0, 15.0))

    def relaxation(self, k: int, z: Array) -> Array:
        return self.gains.value[k] / (1 + z)


def _trials(setting: Setting) -> list:
    logarithmic, ladder = LogarithmicCreep(gamma=0.02), KelvinVoigtCreep()
    trials = at_values(logarithmic, [{"onset": t} for t in (0.003, 0.03, 0.3, 3.0)])
    return [*trials, *at_values(ladder, ladders(0.005, 0.05, 0.5))]


EFFECT = Effect(
    name="creep",
    site="response",
    sentence="after each change of the drive the displacement keeps creeping with the logarithm "
    "of time, in proportion to the change",
    equation="step response 1 + gamma log10(1 + t/t0), or four relaxations g_i/(1 + tau_i s)",
    source="Jung & Gweon, Rev. Sci. Instrum. 71 (2000) 1896; Croft, Shed & Devasia, J. Dyn. Syst. "
    "Meas. Control 123 (2001) 35; Xu et al., Fractal Fract. 8 (2024) 3, eq. (11) for the power law "
    "that the logarithm approximates",
    trials=_trials,
    separated_by={
        "thermal_drift": "steps up and down with holds over three decades of time",
        "drive_lag": "steps up and down with holds over three decades of time",
    },
    concealed_by="the order alpha and the gain k_h of the hysteresis",
    axes=("time", "reversal", "frequency"),
    one_sided=True,
)
