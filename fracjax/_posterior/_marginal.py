"""The posterior with the gains integrated out: chains move over the nonlinear parameters only.

For fixed other parameters, the response is affine in the gains.  If the gains are normal a priori,
g = m + s z with z ~ N(0, 1), and the noise is normal too, both integrals have closed forms,

    ∫ p(data | z, rest) p(z) dz  ∝  p(data | z*, rest) exp(-|z*|²/2) / |R|,
    p(z | data, rest) = N(z*, (RᵀR)⁻¹),    RᵀR = 1 + BᵀB,

with B the whitened columns after projecting out the recordings' own terms.  Gains drawn from the
second at every point of the chain have exactly their joint posterior with the other parameters;
nothing is approximated.  A flat prior is the same without the 1.  A bound far outside the joint
posterior makes no difference.
Source: Bretthorst, Bayesian Spectrum Analysis (1988), ch. 3; Liu, J. Am. Stat. Assoc. 89 (1994)
958, for the effect of collapsing on the chain.
"""

from __future__ import annotations

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import solve_triangular

from .._computing import compiled
from ._laplace import Laplace, laplace
from ._likelihood import Target
from ._noise_models import AbstractGaussianNoise, Eliminated, Signals
from ._prior import AbstractPrior, Normal, TruncatedNormal, Uniform, values_of

_REACH = 5.0
"""Distance of a bound, in standard deviations, from which on a gain may be integrated out: less
than one draw in a million lies beyond it."""
_PART = 16
"""Rows that are computed in one call, so that one compiled program serves any number of rows."""
_DIFFERENCE = 1e-3
"""Step of the central differences, in standard deviations; chosen by judgement."""


class _Linear(eqx.Module):
    """Priors of the gains that are integrated out (g,): g = mean + sd z.

    z is standard normal where `weight` is 1, and flat where it is 0; g lies between `lower` and
    `upper`.
    """

    mean: np.ndarray
    sd: np.ndarray
    weight: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


class Marginal(eqx.Module):
    """A target with the gains at the positions `integrated` integrated out.

    Its standard coordinates (D',) are those of the other parameters, in order.
    """

    target: Target
    linear: _Linear
    integrated: tuple[int, ...] = eqx.field(static=True)

    @property
    def sampled(self) -> tuple[int, ...]:
        """Positions of the coordinates' parameters among the target's values."""
        count = len(self.target.priors)
        return tuple(k for k in range(count) if k not in self.integrated)

    def values(self, standard: Array) -> Array:
        """Physical values (D',) of the sampled parameters."""
        return values_of([self.target.priors[k] for k in self.sampled], standard)

    def log_posterior(self, standard: Array) -> Array:
        """ln of the integral of p(data | v) p(v) over the gains, v standard normal a priori.

        A constant is missing if a gain has bounds.  The value is -∞ if it is not finite.
        """
        if not isinstance(self.target.noise, AbstractGaussianNoise):
            return self.target.log_posterior(standard)
        prior = -(jnp.dot(standard, standard) + standard.size * np.log(2 * np.pi)) / 2
        density = self._eliminated(self._centred(standard)).log_density + prior
        return jnp.asarray(jnp.where(jnp.isfinite(density), density, -jnp.inf))

    @property
    def normal_count(self) -> int:
        """How many normal numbers `complete` needs: one per gain and discrepancy column."""
        return self.target.columns + len(self.integrated)

    def complete(self, standard: Array, normals: Array) -> Array:
        """All values (D,) and the discrepancy's coefficients (K,).

        Gains and coefficients are drawn from their density given the other parameters, by standard
        normal numbers (K + g,).  A gain beyond a bound, one in a million, is moved to the bound.
        """
        values, linear = self._centred(standard), self.linear
        if not self.normal_count:
            return values
        conditional, count = self._eliminated(values), self.target.columns
        drawn = conditional.centre + solve_triangular(conditional.factor, normals)
        gains = jnp.clip(linear.mean + linear.sd * drawn[count:], linear.lower, linear.upper)
        size = values[self.target.size - 1]
        return jnp.concatenate([values.at[self._at].set(gains), size * drawn[:count]])

    @property
    def _at(self) -> np.ndarray:
        """The positions of the gains, as an index array."""
        return np.array(self.integrated, int)

    def _centred(self, standard: Array) -> Array:
        """All values (D,), the gains at the centre of their priors."""
        values = jnp.zeros(len(self.target.priors)).at[self._at].set(self.linear.mean)
        return values.at[np.array(self.sampled)].set(self.values(standard))

    def _eliminated(self, values: Array) -> Eliminated:
        """The integral over gains and discrepancy at values (D,), and their density given these."""
        target, count = self.target, len(self.integrated)
        gains, at = target.gains(values), self._at - target.predict.shapes

        def residuals(shifts: Array) -> Signals:
            return target.residuals(values, gains.at[at].add(self.linear.sd * shifts))

        # The affine map is evaluated at unit shifts: under vmap, all that depends on the
        # shapes alone is computed once, and second derivatives compile in half the time that
        # tangents need.
        responses = jax.vmap(residuals)(jnp.eye(count + 1, count, -1))
        at_centre = tuple(response[0] for response in responses)
        columns = tuple(
            jnp.concatenate(
                [values[target.size - 1] * of_discrepancy, (response[0] - response[1:]).T], axis=1
            )
            for response, of_discrepancy in zip(responses, target.discrepancy, strict=True)
        )
        weights = jnp.concatenate([jnp.ones(target.columns), self.linear.weight])
        assert isinstance(target.noise, AbstractGaussianNoise)  # otherwise none is integrated out
        return target.noise.eliminated(
            target.noise_values(values),
            at_centre,
            columns,
            weights,
            target.problems,
            target.columns,
        )


def marginal_of(target: Target, start: np.ndarray) -> tuple[Marginal, Laplace]:
    """The target with as many gains integrated out as possible, and its Laplace approximation.

    These are the gains with a normal, truncated normal or uniform prior under normal noise.  Gains
    with a bound within five standard deviations stay in the chain.  `start` (D,) holds the standard
    coordinates of all parameters.
    """
    positions = _candidates(target)
    while True:
        marginal = Marginal(target, _linear(target, positions), positions)
        approximation = laplace(marginal, start[np.array(marginal.sampled)])
        means, sds = figures(marginal, approximation)
        at, linear = np.array(positions, int), marginal.linear
        low, high = means[at] - _REACH * sds[at], means[at] + _REACH * sds[at]
        # Written so that a gain that is not a number is not free.
        free = (low > linear.lower) & (high < linear.upper)
        if free.all():
            return marginal, approximation
        positions = tuple(k for k, is_free in zip(positions, free, strict=True) if is_free)


def _candidates(target: Target) -> tuple[int, ...]:
    """Positions of the gains whose prior and noise allow to integrate them out."""
    if not isinstance(target.noise, AbstractGaussianNoise):
        return ()
    kinds = Normal, TruncatedNormal, Uniform
    return tuple(
        k for k in range(target.predict.shapes, target.size) if isinstance(target.priors[k], kinds)
    )


def _linear(target: Target, positions: Sequence[int]) -> _Linear:
    """The priors of the gains at these positions."""
    rows = np.array([_as_normal(target.priors[k]) for k in positions]).reshape(-1, 5)
    return _Linear(*rows.T)


def _as_normal(prior: AbstractPrior) -> tuple[float, float, float, float, float]:
    """Mean, scale, weight, lower and upper bound of a prior."""
    match prior:
        case Normal():
            return float(prior.mean), float(prior.sd), 1.0, -np.inf, np.inf
        case TruncatedNormal():
            bounds = float(prior.lower), float(prior.upper)
            return float(prior.mean), float(prior.sd), 1.0, *bounds
        case Uniform():
            low, high = float(prior.lower), float(prior.upper)
            return (low + high) / 2, (high - low) / 2, 0.0, low, high
    raise AssertionError(f"{prior} is none of the candidates'")


@compiled
def _compiled_complete(marginal: Marginal, standards: np.ndarray, normals: np.ndarray) -> Array:
    """`complete` for rows of coordinates (n, D') and normal numbers (n, K + g), compiled."""
    return jax.vmap(marginal.complete)(jnp.asarray(standards), jnp.asarray(normals))


def complete_draws(
    marginal: Marginal, standards: np.ndarray, generator: np.random.Generator
) -> np.ndarray:
    """All physical values (n, D + K) at coordinates (n, D'), with gains and coefficients drawn."""
    normals = generator.standard_normal((len(standards), marginal.normal_count))
    return _complete_rows(marginal, standards, normals)


def _complete_rows(marginal: Marginal, standards: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """`complete` for any number of rows, in parts of one size."""
    padding = ((0, -len(standards) % _PART), (0, 0))
    points, numbers = np.pad(standards, padding), np.pad(normals, padding)
    parts = [
        np.asarray(_compiled_complete(marginal, points[k : k + _PART], numbers[k : k + _PART]))
        for k in range(0, len(points), _PART)
    ]
    return np.concatenate(parts)[: len(standards)]


def figures(marginal: Marginal, approximation: Laplace) -> tuple[np.ndarray, np.ndarray]:
    """All values (D + K,) at the mode, and their standard deviations to first order.

    They come from differences along the approximation's axes, by the program that completes draws.
    """
    size, gains = approximation.mode.size, marginal.normal_count
    steps = _DIFFERENCE * np.eye(size)
    coordinates = np.concatenate([np.zeros((1 + gains, size)), steps, -steps])
    normals = np.zeros((len(coordinates), gains))
    normals[1 : 1 + gains] = np.eye(gains)
    values = _complete_rows(marginal, approximation.at(coordinates), normals)
    by_normals = values[1 : 1 + gains] - values[0]
    forward, backward = values[1 + gains :][:size], values[1 + gains + size :]
    by_coordinates = (forward - backward) / (2 * _DIFFERENCE)
    return values[0], np.sqrt(np.sum(np.concatenate([by_normals, by_coordinates]) ** 2, axis=0))
