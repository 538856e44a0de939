r"""The posterior with the gains integrated out: chains move over what enters nonlinearly alone.

All else held, a response is affine in its gains.  Where these are normal a priori, g = m + s z with
z ~ N(0, 1), and the noise is normal too, both integrals are closed forms,

    ∫ p(data | z, rest) p(z) dz  ∝  p(data | z*, rest) exp(-|z*|²/2) / |R|,
    p(z | data, rest) = N(z*, (RᵀR)⁻¹),    RᵀR = 1 + BᵀB,

B the whitened columns beside the recordings' own terms.  Drawn from the second at every point of
the chain, the gains have their joint posterior with all else exactly: nothing is approximated.
A flat prior is the same without the 1; a bound that the joint posterior does not reach makes no
difference.
Source: Bretthorst, Bayesian Spectrum Analysis (1988), ch. 3; Liu, J. Am. Stat. Assoc. 89 (1994)
958, for what collapsing does to the chain.
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
_PART = 16
_DIFFERENCE = 1e-3


class _Linear(eqx.Module):
    """Priors of the numbers integrated out (g,): g = mean + sd z, z standard normal where `weight`
    is 1 and flat where it is 0, between `lower` and `upper`."""

    mean: np.ndarray
    sd: np.ndarray
    weight: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


class Marginal(eqx.Module):
    """A target without the numbers at the positions `integrated`, gains all.

    Standard coordinates (D',) are those of the others, in order.
    """

    target: Target
    linear: _Linear
    integrated: tuple[int, ...] = eqx.field(static=True)

    @property
    def sampled(self) -> tuple[int, ...]:
        """Positions of what the coordinates stand for, among the target's values."""
        count = len(self.target.priors)
        return tuple(k for k in range(count) if k not in self.integrated)

    def values(self, standard: Array) -> Array:
        """Physical values (D',) of what is sampled."""
        return values_of([self.target.priors[k] for k in self.sampled], standard)

    def log_posterior(self, standard: Array) -> Array:
        """ln of the integral of p(data | v) p(v) over the gains, v standard normal a priori, but
        for a constant where a gain has bounds; -∞ where it is no number."""
        if not isinstance(self.target.noise, AbstractGaussianNoise):
            return self.target.log_posterior(standard)
        prior = -(jnp.dot(standard, standard) + standard.size * np.log(2 * np.pi)) / 2
        density = self._eliminated(self._centred(standard)).log_density + prior
        return jnp.asarray(jnp.where(jnp.isfinite(density), density, -jnp.inf))

    @property
    def drawn(self) -> int:
        """How many normal numbers `complete` takes: one a gain, and one a discrepancy's column."""
        return self.target.columns + len(self.integrated)

    def complete(self, standard: Array, normals: Array) -> Array:
        """All values (D,) and the discrepancy's coefficients (K,).

        Gains and coefficients are drawn from their density given the others, by standard normal
        numbers (K + g,).  A gain beyond a bound, one in a million, is put on it.
        """
        values, linear = self._centred(standard), self.linear
        if not self.drawn:
            return values
        found, count = self._eliminated(values), self.target.columns
        drawn = found.centre + solve_triangular(found.factor, normals)
        gains = jnp.clip(linear.mean + linear.sd * drawn[count:], linear.lower, linear.upper)
        size = values[self.target.size - 1]
        return jnp.concatenate([values.at[self._at].set(gains), size * drawn[:count]])

    @property
    def _at(self) -> np.ndarray:
        return np.array(self.integrated, int)

    def _centred(self, standard: Array) -> Array:
        """All values (D,), the gains at the middle of their priors."""
        values = jnp.zeros(len(self.target.priors)).at[self._at].set(self.linear.mean)
        return values.at[np.array(self.sampled)].set(self.values(standard))

    def _eliminated(self, values: Array) -> Eliminated:
        target, count = self.target, len(self.integrated)
        gains, at = target.gains(values), self._at - target.predict.shapes

        def residuals(moved: Array) -> Signals:
            return target.residuals(values, gains.at[at].add(self.linear.sd * moved))

        # An affine map by its values: what depends on the shapes alone is computed once under vmap,
        # and second derivatives cost half as much to compile as with tangents.
        corners = jax.vmap(residuals)(jnp.eye(count + 1, count, -1))
        centred = tuple(corner[0] for corner in corners)
        columns = tuple(
            jnp.concatenate([values[target.size - 1] * beside, (corner[0] - corner[1:]).T], axis=1)
            for corner, beside in zip(corners, target.discrepancy, strict=True)
        )
        weights = jnp.concatenate([jnp.ones(target.columns), self.linear.weight])
        assert isinstance(target.noise, AbstractGaussianNoise)  # else nothing is integrated out
        return target.noise.eliminated(
            target.of_noise(values), centred, columns, weights, target.problems, target.columns
        )


def marginal_of(target: Target, start: np.ndarray) -> tuple[Marginal, Laplace]:
    """The target with all gains integrated out that can be, and its Laplace approximation.

    Those are gains with a normal, truncated normal or uniform prior under normal noise, but for the
    ones with a bound within five standard deviations: they stay in the chain.  `start` (D,) are
    standard coordinates of all.
    """
    left = _candidates(target)
    while True:
        marginal = Marginal(target, _linear(target, left), left)
        found = laplace(marginal, start[np.array(marginal.sampled)])
        means, sds = figures(marginal, found)
        at, linear = np.array(left, int), marginal.linear
        low, high = means[at] - _REACH * sds[at], means[at] + _REACH * sds[at]
        # Written so that what is no number is not free either.
        free = (low > linear.lower) & (high < linear.upper)
        if free.all():
            return marginal, found
        left = tuple(k for k, kept in zip(left, free, strict=True) if kept)


def _candidates(target: Target) -> tuple[int, ...]:
    if not isinstance(target.noise, AbstractGaussianNoise):
        return ()
    kinds = Normal, TruncatedNormal, Uniform
    return tuple(
        k for k in range(target.predict.shapes, target.size) if isinstance(target.priors[k], kinds)
    )


def _linear(target: Target, positions: Sequence[int]) -> _Linear:
    rows = np.array([_as_normal(target.priors[k]) for k in positions]).reshape(-1, 5)
    return _Linear(*rows.T)


def _as_normal(prior: AbstractPrior) -> tuple[float, float, float, float, float]:
    """Mean, scale, weight and bounds."""
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
def _completed(marginal: Marginal, standards: np.ndarray, normals: np.ndarray) -> Array:
    return jax.vmap(marginal.complete)(jnp.asarray(standards), jnp.asarray(normals))


def completed(
    marginal: Marginal, standards: np.ndarray, generator: np.random.Generator
) -> np.ndarray:
    """All physical values (n, D + K) at coordinates (n, D'), gains and coefficients drawn."""
    normals = generator.standard_normal((len(standards), marginal.drawn))
    return _complete(marginal, standards, normals)


def _complete(marginal: Marginal, standards: np.ndarray, normals: np.ndarray) -> np.ndarray:
    padding = ((0, -len(standards) % _PART), (0, 0))
    points, moves = np.pad(standards, padding), np.pad(normals, padding)
    parts = [
        np.asarray(_completed(marginal, points[k : k + _PART], moves[k : k + _PART]))
        for k in range(0, len(points), _PART)
    ]
    return np.concatenate(parts)[: len(standards)]


def figures(marginal: Marginal, found: Laplace) -> tuple[np.ndarray, np.ndarray]:
    """All values (D + K,) at the mode, and their standard deviations to first order.

    By differences along the approximation's axes: the program that completes draws does it.
    """
    size, gains = found.mode.size, marginal.drawn
    steps = _DIFFERENCE * np.eye(size)
    coordinates = np.concatenate([np.zeros((1 + gains, size)), steps, -steps])
    normals = np.zeros((len(coordinates), gains))
    normals[1 : 1 + gains] = np.eye(gains)
    values = _complete(marginal, found.at(coordinates), normals)
    drawn = values[1 : 1 + gains] - values[0]
    ahead, behind = values[1 + gains :][:size], values[1 + gains + size :]
    moved = (ahead - behind) / (2 * _DIFFERENCE)
    return values[0], np.sqrt(np.sum(np.concatenate([drawn, moved]) ** 2, axis=0))
