"""Priors, each a monotone map of a standard normal number, so that all have one scale.

A value x = Q(Φ(v)), with Q the prior's quantile function, has that prior exactly if v is standard
normal.  Chains run over v: they never meet a bound, and one unit of v is one prior width.
"""

from __future__ import annotations

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.special import ndtr, ndtri
from jax.typing import ArrayLike

from .._parameters import Parameter
from .._prepare import ROOT_TWO_PI, AbstractPrior, Normal, float64_array

_HALF_WIDTH = 1.959963984540054
"""Half the width of a normal density's central 95 %, in standard deviations."""
_GAIN_SPANS = 10.0
"""Prior standard deviation of a gain without a stated range, relative to its expected size; by
judgement."""


@jax.custom_jvp
def _truncated(v: Array, below: Array, above: Array) -> Array:
    """z with Φ(z) = below + (1 - below - above) Φ(v)."""
    # From the nearer tail, because far out in the upper one 1 - Φ(v) loses all digits.
    tail = jnp.where(v < 0, below, above) + (1 - below - above) * ndtr(jnp.where(v < 0, v, -v))
    quantile = ndtri(tail)
    return jnp.asarray(jnp.where(v < 0, quantile, -quantile))


@_truncated.defjvp
def _truncated_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    """dz/dv = (1 - below - above) φ(v)/φ(z), for constant tails.

    Unlike the derivative of ndtri's polynomials it takes no time to compile.
    """
    v, below, above = primals
    z = _truncated(v, below, above)
    return z, (1 - below - above) * jnp.exp((z**2 - v**2) / 2) * tangents[0]


class TruncatedNormal(AbstractPrior):
    """A normal density truncated to [lower, upper], all values in the parameter's unit."""

    mean: np.ndarray = eqx.field(converter=float64_array)
    sd: np.ndarray = eqx.field(converter=float64_array)
    lower: np.ndarray = eqx.field(converter=float64_array)
    upper: np.ndarray = eqx.field(converter=float64_array)

    def _tails(self) -> tuple[Array, Array]:
        """The shares of the whole normal density below `lower` and above `upper`."""
        return ndtr((self.lower - self.mean) / self.sd), ndtr((self.mean - self.upper) / self.sd)

    def value(self, standard: ArrayLike) -> Array:
        return jnp.asarray(self.mean + self.sd * _truncated(jnp.asarray(standard), *self._tails()))

    def standard(self, value: ArrayLike) -> Array:
        x = (jnp.clip(jnp.asarray(value), self.lower, self.upper) - self.mean) / self.sd
        below, above = self._tails()
        tail = ndtr(jnp.where(x < 0, x, -x)) - jnp.where(x < 0, below, above)
        v = ndtri(tail / (1 - below - above))
        return jnp.asarray(jnp.where(x < 0, v, -v))

    def log_density(self, value: ArrayLike) -> Array:
        below, above = self._tails()
        x = (jnp.asarray(value) - self.mean) / self.sd
        inside = (value >= self.lower) & (value <= self.upper)
        density = -(x**2) / 2 - jnp.log(self.sd) - ROOT_TWO_PI - jnp.log(1 - below - above)
        return jnp.asarray(jnp.where(inside, density, -jnp.inf))


class Uniform(AbstractPrior):
    """p(x) = 1/(upper - lower) between the two bounds, both in the parameter's unit."""

    lower: np.ndarray = eqx.field(converter=float64_array)
    upper: np.ndarray = eqx.field(converter=float64_array)

    def value(self, standard: ArrayLike) -> Array:
        return jnp.asarray(self.lower + (self.upper - self.lower) * ndtr(jnp.asarray(standard)))

    def standard(self, value: ArrayLike) -> Array:
        share = (jnp.asarray(value) - self.lower) / (self.upper - self.lower)
        return ndtri(jnp.clip(share, 0.0, 1.0))

    def log_density(self, value: ArrayLike) -> Array:
        inside = (value >= self.lower) & (value <= self.upper)
        return jnp.where(inside, -jnp.log(self.upper - self.lower), -jnp.inf)


class Logarithmic(AbstractPrior):
    """ln x has the density `of_logarithm`; p(x) is that density divided by x."""

    of_logarithm: AbstractPrior

    def value(self, standard: ArrayLike) -> Array:
        return jnp.exp(self.of_logarithm.value(standard))

    def standard(self, value: ArrayLike) -> Array:
        return self.of_logarithm.standard(jnp.log(jnp.maximum(value, 0.0)))

    def log_density(self, value: ArrayLike) -> Array:
        positive = jnp.where(jnp.asarray(value) > 0, value, 1.0)
        density = self.of_logarithm.log_density(jnp.log(positive)) - jnp.log(positive)
        return jnp.where(jnp.asarray(value) > 0, density, -jnp.inf)


def within_a_factor(centre: float, factor: float) -> AbstractPrior:
    """Log-normal prior, with 95 % between centre/factor and centre·factor."""
    return Logarithmic(Normal(np.log(centre), np.log(factor) / _HALF_WIDTH))


def prior_of(parameter: Parameter, component: int, size: float) -> AbstractPrior:
    """The prior of one component of a parameter.

    It is normal, or log-normal if the parameter is fitted on a logarithmic scale, with 95 % within
    its plausible range, truncated to its bounds.  Parameters without a range, such as gains, have a
    normal prior about 0 with a standard deviation of ten times `size`, the value at which the
    parameter's contribution is as large as the response itself.
    """
    bounds = (*parameter.plausible, parameter.lower, parameter.upper)
    shape = np.shape(parameter.value)
    low, high, lower, upper = (
        float(np.ravel(np.broadcast_to(bound, shape))[component]) for bound in bounds
    )
    if not np.isfinite(high - low):
        sd = _GAIN_SPANS * size
        if np.isinf(lower) and np.isinf(upper):
            return Normal(0.0, sd)
        return TruncatedNormal(np.clip(0.0, lower, upper), sd, lower, upper)
    if parameter.logarithmic:
        low, high, lower, upper = np.log([low, high, lower, upper])
    middle, half = (low + high) / 2, (high - low) / 2
    prior = TruncatedNormal(middle, half / _HALF_WIDTH, lower, upper)
    return Logarithmic(prior) if parameter.logarithmic else prior


def values_of(priors: Sequence[AbstractPrior], standard: Array) -> Array:
    """Values (n,) at standard coordinates (n,); priors of one type are evaluated together."""
    by_type: dict[object, list[int]] = {}
    for k, prior in enumerate(priors):
        by_type.setdefault(jax.tree_util.tree_structure(prior), []).append(k)
    values, order = [jnp.zeros(0)], []
    for members in by_type.values():
        positions = np.array(members)
        stacked = jax.tree_util.tree_map(lambda *x: jnp.stack(x), *[priors[k] for k in members])
        values.append(jax.vmap(lambda prior, v: prior.value(v))(stacked, standard[positions]))
        order += members
    return jnp.concatenate(values)[np.argsort(np.array(order, int))]
