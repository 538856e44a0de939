"""The prior of a parameter: the density of one value, and the normal one."""

from __future__ import annotations

import abc

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

ROOT_TWO_PI = np.log(2 * np.pi) / 2
"""ln √2π, of the normal density."""


def float64_array(value: ArrayLike) -> np.ndarray:
    """The value as a float64 array, also where JAX computes in float32."""
    # An array and not a float, so that one compiled program serves all priors of the same kind.
    return np.asarray(value, dtype=np.float64)


class AbstractPrior(eqx.Module):
    """The density of one value in its physical unit."""

    @abc.abstractmethod
    def value(self, standard: ArrayLike) -> Array:
        """The value x = Q(Φ(v)) of a standard normal v, with Q the quantile function of the prior.

        Args:
            standard: v, dimensionless, of any shape.

        Returns:
            x in the parameter's unit, of that shape.
        """

    @abc.abstractmethod
    def standard(self, value: ArrayLike) -> Array:
        """The standard normal v of a value, infinite on a bound.

        Args:
            value: x in the parameter's unit, of any shape.

        Returns:
            v, dimensionless, of that shape.
        """

    @abc.abstractmethod
    def log_density(self, value: ArrayLike) -> Array:
        """ln p(x), with -∞ outside the bounds.

        Args:
            value: x in the parameter's unit, of any shape.

        Returns:
            ln p of that shape, p in one over the parameter's unit.
        """


class Normal(AbstractPrior):
    """A normal prior: p(x) = exp(-(x - mean)²/2 sd²) / (sd √2π).

    Attributes:
        mean: the mean in the parameter's unit, one value or one per component.
        sd: the standard deviation in the parameter's unit, of the same shape, above 0.
    """

    mean: np.ndarray = eqx.field(converter=float64_array)
    sd: np.ndarray = eqx.field(converter=float64_array)

    def value(self, standard: ArrayLike) -> Array:
        """The value mean + sd · v of a standard normal v.

        Args:
            standard: v, dimensionless, of any shape.

        Returns:
            x in the parameter's unit, of that shape.
        """
        return jnp.asarray(self.mean + self.sd * jnp.asarray(standard))

    def standard(self, value: ArrayLike) -> Array:
        """The standard normal v = (x - mean)/sd of a value.

        Args:
            value: x in the parameter's unit, of any shape.

        Returns:
            v, dimensionless, of that shape.
        """
        return (jnp.asarray(value) - self.mean) / self.sd

    def log_density(self, value: ArrayLike) -> Array:
        """ln p(x).

        Args:
            value: x in the parameter's unit, of any shape.

        Returns:
            ln p of that shape, p in one over the parameter's unit.
        """
        return -(self.standard(value) ** 2) / 2 - jnp.log(self.sd) - ROOT_TWO_PI
