"""What is known of a parameter before the data: the density of one number, and the normal one."""

from __future__ import annotations

import abc

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

ROOT_TWO_PI = np.log(2 * np.pi) / 2


def number(value: ArrayLike) -> np.ndarray:
    """A float64 array, which survives without x64."""
    # An array, not a float: compiled programs then serve any prior of the same kind.
    return np.asarray(value, dtype=np.float64)


class AbstractPrior(eqx.Module):
    """The density of one number in its physical unit."""

    @abc.abstractmethod
    def value(self, standard: ArrayLike) -> Array:
        """The value x = Q(Φ(v)) that a standard normal v stands for."""

    @abc.abstractmethod
    def standard(self, value: ArrayLike) -> Array:
        """The v that stands for a value; infinite on a bound."""

    @abc.abstractmethod
    def log_density(self, value: ArrayLike) -> Array:
        """ln p(x), x in its unit; -∞ outside the bounds."""


class Normal(AbstractPrior):
    """p(x) = exp(-(x - mean)²/2 sd²) / (sd √2π), mean and sd in the parameter's unit."""

    mean: np.ndarray = eqx.field(converter=number)
    sd: np.ndarray = eqx.field(converter=number)

    def value(self, standard: ArrayLike) -> Array:
        return jnp.asarray(self.mean + self.sd * jnp.asarray(standard))

    def standard(self, value: ArrayLike) -> Array:
        return (jnp.asarray(value) - self.mean) / self.sd

    def log_density(self, value: ArrayLike) -> Array:
        return -(self.standard(value) ** 2) / 2 - jnp.log(self.sd) - ROOT_TWO_PI
