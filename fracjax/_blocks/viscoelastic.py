"""Fractional viscoelastic materials between strain and stress: a springpot, and with springs."""

from __future__ import annotations

import abc

import numpy as np
from jax import Array
from jax.typing import ArrayLike
from scipy.special import gamma

from .._parameters import Parameter
from ._block import AbstractLinearBlock

_REACH, _NODES = 30.0, 4001
"""Range of the logarithm of r^α, beyond which the kernel is below 1e-12, and nodes within it."""


class AbstractMaterial(AbstractLinearBlock):
    """A material: strain (or displacement) as drive, stress (or force) as response, in their units.

    A stress leads its strain by nature.
    """

    @property
    def leads(self) -> bool:
        return True

    @property
    def accuracy(self) -> int:
        return 2

    @abc.abstractmethod
    def relaxation(self, times: ArrayLike) -> np.ndarray:
        """The relaxation modulus.

        Args:
            times: t > 0 (N,) [s].

        Returns:
            The stress (N,) after a unit step of strain [response/drive].
        """

    @abc.abstractmethod
    def compliance(self, times: ArrayLike) -> np.ndarray:
        """The creep compliance.

        Args:
            times: t > 0 (N,) [s].

        Returns:
            The strain (N,) after a unit step of stress [drive/response].
        """


def mittag_leffler(order: float, argument: ArrayLike) -> np.ndarray:
    """E_α(-x) for 0 < α ≤ 1 and x ≥ 0, as a sum of exponentials over the branch cut.

    Args:
        order: α, dimensionless.
        argument: x (N,), dimensionless.

    Returns:
        The values (N,), dimensionless, to 1e-9.

    Source: Gorenflo, Kilbas, Mainardi & Rogosin, Mittag-Leffler Functions (2014), section 3.4.
    """
    x = np.atleast_1d(np.asarray(argument, dtype=float))
    if order == 1.0:
        return np.exp(-x)
    # E_α(-t^α) = ∫ K(r) exp(-r t) dr, on a logarithmic grid of r, whose rule converges fast.
    log_r = np.linspace(-_REACH / order, _REACH / order, _NODES)
    angle, power = np.pi * order, np.exp(order * log_r)
    kernel = np.sin(angle) * power / (np.pi * (power**2 + 2 * power * np.cos(angle) + 1))
    log_t = np.log(np.maximum(x, np.finfo(float).tiny)) / order
    with np.errstate(over="ignore"):
        decay = np.exp(-np.exp(log_r + log_t[:, None]))
    return np.trapezoid(kernel * decay, log_r, axis=1)


class Springpot(AbstractMaterial):
    r"""Scott Blair's element, between a spring (ν = 0) and a dashpot (ν = 1):

        σ = K D^ν ε,    G(t) = K t^-ν/Γ(1-ν),    J(t) = t^ν/(K Γ(1+ν))

    Attributes:
        modulus: K, one number [response/drive · s^order].
        order: ν, one number, dimensionless.

    Source: Mainardi, Fractional Calculus and Waves in Linear Viscoelasticity (2010), section 3.2.
    """

    modulus: Parameter
    order: Parameter

    def __init__(self, modulus: float = 1.0, order: float = 0.2):
        self.modulus = Parameter(modulus, "response/drive*s^order", gain=True)
        self.order = _order(order)

    def symbol(self, s: Array) -> Array:
        return self.modulus.value * s**self.order.value

    def static_gain(self) -> ArrayLike:
        return 0.0 * self.modulus.value

    def relaxation(self, times: ArrayLike) -> np.ndarray:
        nu = float(self.order.value)
        return float(self.modulus.value) * np.asarray(times, float) ** -nu / gamma(1 - nu)

    def compliance(self, times: ArrayLike) -> np.ndarray:
        nu = float(self.order.value)
        return np.asarray(times, float) ** nu / (float(self.modulus.value) * gamma(1 + nu))


class FractionalMaxwell(AbstractMaterial):
    r"""A spring and a springpot in series; the stress relaxes to 0:

        G(s) = E z/(1 + z),  z = (τ s)^ν,   G(t) = E E_ν(-(t/τ)^ν),   J(t) = (1 + (t/τ)^ν/Γ(1+ν))/E

    Attributes:
        modulus: E, one number [response/drive].
        time_constant: τ, one number [s].
        order: ν, one number, dimensionless.

    Source: Mainardi, Fractional Calculus and Waves in Linear Viscoelasticity (2010), section 3.3.
    """

    modulus: Parameter
    time_constant: Parameter
    order: Parameter

    def __init__(self, modulus: float = 1.0, time_constant: float = 1.0, order: float = 0.3):
        self.modulus = Parameter(modulus, "response/drive", gain=True)
        self.time_constant, self.order = _time_constant(time_constant), _order(order)

    def symbol(self, s: Array) -> Array:
        z = s**self.order.value * self.time_constant.value**self.order.value
        return self.modulus.value * z / (1 + z)

    def static_gain(self) -> ArrayLike:
        return 0.0 * self.modulus.value

    def relaxation(self, times: ArrayLike) -> np.ndarray:
        return float(self.modulus.value) * mittag_leffler(float(self.order.value), _z(self, times))

    def compliance(self, times: ArrayLike) -> np.ndarray:
        creeping = 1 + _z(self, times) / gamma(1 + float(self.order.value))
        return creeping / float(self.modulus.value)


class FractionalKelvinVoigt(AbstractMaterial):
    r"""A spring and a springpot side by side; the strain creeps to a limit:

        G(s) = E (1 + z),    z = (τ s)^ν
        G(t) = E (1 + (t/τ)^-ν/Γ(1-ν)),    J(t) = (1 - E_ν(-(t/τ)^ν))/E

    Attributes:
        modulus: E, one number [response/drive].
        time_constant: τ, one number [s].
        order: ν, one number, dimensionless.

    Source: Mainardi, Fractional Calculus and Waves in Linear Viscoelasticity (2010), section 3.3.
    """

    modulus: Parameter
    time_constant: Parameter
    order: Parameter

    def __init__(self, modulus: float = 1.0, time_constant: float = 1.0, order: float = 0.3):
        self.modulus = Parameter(modulus, "response/drive", gain=True)
        self.time_constant, self.order = _time_constant(time_constant), _order(order)

    def symbol(self, s: Array) -> Array:
        z = s**self.order.value * self.time_constant.value**self.order.value
        return self.modulus.value * (1 + z)

    def static_gain(self) -> ArrayLike:
        return self.modulus.value

    def relaxation(self, times: ArrayLike) -> np.ndarray:
        return float(self.modulus.value) * (
            1 + 1 / (_z(self, times) * gamma(1 - float(self.order.value)))
        )

    def compliance(self, times: ArrayLike) -> np.ndarray:
        creeping = mittag_leffler(float(self.order.value), _z(self, times))
        return (1 - creeping) / float(self.modulus.value)


class FractionalZener(AbstractMaterial):
    r"""The standard solid with a springpot: stiff at once, softer for ever:

        G(s) = (E + E_∞ z)/(1 + z),  z = (τ s)^ν,    G(t) = E + (E_∞ - E) E_ν(-(t/τ)^ν)
        J(t) = 1/E + (1/E_∞ - 1/E) E_ν(-(t/τ_c)^ν),    τ_c^ν = τ^ν E_∞/E

    Attributes:
        modulus: E, at rest, one number [response/drive].
        instantaneous: E_∞, at once, one number [response/drive].
        time_constant: τ, one number [s].
        order: ν, one number, dimensionless.

    Source: Bagley & Torvik, J. Rheol. 27 (1983) 201; Mainardi, Fractional Calculus and Waves in
    Linear Viscoelasticity (2010), section 3.3.
    """

    modulus: Parameter
    instantaneous: Parameter
    time_constant: Parameter
    order: Parameter

    def __init__(
        self,
        modulus: float = 1.0,
        instantaneous: float = 2.0,
        time_constant: float = 1.0,
        order: float = 0.3,
    ):
        self.modulus = Parameter(modulus, "response/drive", gain=True)
        self.instantaneous = Parameter(instantaneous, "response/drive", gain=True)
        self.time_constant, self.order = _time_constant(time_constant), _order(order)

    @property
    def accuracy(self) -> int:
        return 4

    def symbol(self, s: Array) -> Array:
        z = s**self.order.value * self.time_constant.value**self.order.value
        return (self.modulus.value + self.instantaneous.value * z) / (1 + z)

    def static_gain(self) -> ArrayLike:
        return self.modulus.value

    def relaxation(self, times: ArrayLike) -> np.ndarray:
        low, high = float(self.modulus.value), float(self.instantaneous.value)
        return low + (high - low) * mittag_leffler(float(self.order.value), _z(self, times))

    def compliance(self, times: ArrayLike) -> np.ndarray:
        low, high = float(self.modulus.value), float(self.instantaneous.value)
        slower = _z(self, times) * low / high
        return 1 / low + (1 / high - 1 / low) * mittag_leffler(float(self.order.value), slower)


def _order(value: float) -> Parameter:
    return Parameter(value, lower=0.02, upper=1.0, plausible=(0.05, 0.9))


def _time_constant(value: float) -> Parameter:
    return Parameter(
        value, "s", lower=1e-9, upper=1e9, plausible=(1e-4 * value, 1e4 * value), logarithmic=True
    )


def _z(
    block: FractionalMaxwell | FractionalKelvinVoigt | FractionalZener, times: ArrayLike
) -> np.ndarray:
    """(t/τ)^ν (N,), dimensionless."""
    return (np.asarray(times, float) / float(block.time_constant.value)) ** float(block.order.value)
