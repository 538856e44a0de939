"""Noise models whose parameters are sampled with the model's: white, AR(p), measured, Student-t.

Let e be the measured minus the predicted response, c each recording's own coefficients (its offset
first) and X their columns.  A filter makes the noise white:

    w = filter * (e - X c),     ln p(e) = Σ_t [ ln p(w_t) + ln filter_0 ]

over the samples whose predecessors within the filter's length count too; the density is conditional
on the first p samples.  If w is normal, c is integrated out exactly under a flat prior,

    ∫ p(e | c) dc = (2π)^{-(n-q)/2} filter_0^n |XᵀX|^{-1/2} exp(-|w_⊥|²/2),

with X filtered and w_⊥ the part of w orthogonal to it.  Gains are integrated out in the same way
(`_marginal`).
Source: Box, Jenkins & Reinsel, Time Series Analysis, ch. 7; Bretthorst, Bayesian Spectrum Analysis
(1988), ch. 3, for the integral.
"""

from __future__ import annotations

import abc
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import solve_triangular
from jax.scipy.stats import t as student_t

from .._fit import Fit
from .._prepare import AbstractProblem, Noise, Preparation, Problem, autoregression
from ._factors import gram_schmidt, triangular_factor
from ._prior import AbstractPrior, Logarithmic, Normal, TruncatedNormal, Uniform, within_a_factor

# The widths of the priors were chosen by judgement.
_DECADE = 10.0
"""Factor around the fit's noise within which its level lies with 95 % prior probability."""
_LARGEST_ORDER = 12
"""Largest order of an autoregressive noise."""
_OWN_SPANS = 10.0
"""Prior standard deviation of a recording's own coefficients, in spans of its response."""
_TAILS = Logarithmic(
    TruncatedNormal(np.log(120.0) / 2, np.log(30.0) / 2 / 1.96, np.log(1.0), np.log(1e3))
)
"""Prior of the degrees of freedom: 95 % between 2 and 60, from heavy tails to nearly normal."""

Signals = tuple[Array | np.ndarray, ...]
Problems = tuple[AbstractProblem, ...]


class Term(NamedTuple):
    """One sampled parameter.

    `prior` is its prior and `start` the value at which the search for the mode begins, both in
    `unit`.
    """

    name: str
    unit: str
    prior: AbstractPrior
    start: float


class AbstractNoiseModel(eqx.Module):
    """The difference between measured and predicted response, as a density with parameters."""

    @property
    @abc.abstractmethod
    def name(self) -> str:
        """The name of the noise model in results."""

    @property
    @abc.abstractmethod
    def taps(self) -> int | None:
        """The number of filter taps that its parameters change, 1 if they change its scale only.

        None if the density depends on more of the samples than their inner products.
        """

    @abc.abstractmethod
    def prepared(self, preparation: Preparation) -> Preparation:
        """The fit's preparation with the filter, and the samples that count, of this noise."""

    @abc.abstractmethod
    def terms(self, fit: Fit, residuals: Signals, problems: Problems) -> tuple[Term, ...]:
        """The noise's own parameters, common to all recordings.

        Args:
            fit: The fit.
            residuals: Measured minus predicted response (L,) of each recording, as in
                `log_density`.
            problems: The prepared recordings.

        Returns:
            The parameters to sample, with unit, prior and start.
        """

    @abc.abstractmethod
    def scaled(self, values: Array | np.ndarray, problem: AbstractProblem) -> AbstractProblem:
        """The problem with the filter that gives noise with parameters (n,) unit variance."""

    @abc.abstractmethod
    def log_density(self, values: Array, residuals: Signals, problems: Problems) -> Array:
        """ln p(e | values) of the residuals of all recordings.

        Args:
            values: Values of the noise's parameters (n,), in their units.
            residuals: Measured minus predicted response (L,) of each recording, including its own
                terms, in the response's unit.
            problems: The prepared recordings.

        Returns:
            The logarithm of the density (a scalar).
        """

    @abc.abstractmethod
    def own(
        self, values: Array, residuals: Signals, problems: Problems, normals: Signals
    ) -> Signals:
        """A draw of the recordings' own terms.

        Args:
            values: Values of the noise's parameters (n,), in their units.
            residuals: Measured minus predicted response (L,) of each recording, in its unit.
            problems: The prepared recordings.
            normals: Standard normal numbers (q,) for each recording.

        Returns:
            The own terms (L,) of each recording, in the response's unit.
        """

    @abc.abstractmethod
    def innovations(
        self, values: np.ndarray, generator: np.random.Generator, size: int
    ) -> np.ndarray:
        """Draws (size,) of the white noise w, dimensionless, for noise parameters (n,)."""


class Eliminated(NamedTuple):
    """The result of integrating out normal numbers z (g,).

    `log_density` is ln of the integral.  Given everything else, z has the normal density
    N(`centre`, (factorᵀ factor)⁻¹) with `factor` (g, g) upper triangular.
    """

    log_density: Array
    centre: Array
    factor: Array


class AbstractGaussianNoise(AbstractNoiseModel):
    """Normal noise, with the recordings' own coefficients integrated out."""

    def log_density(self, values: Array, residuals: Signals, problems: Problems) -> Array:
        columns = tuple(jnp.zeros((residual.shape[0], 0)) for residual in residuals)
        return self.eliminated(values, residuals, columns, jnp.zeros(0), problems, 0).log_density

    def eliminated(
        self,
        values: Array,
        residuals: Signals,
        columns: Signals,
        weights: Array | np.ndarray,
        problems: Problems,
        orthogonal: int,
    ) -> Eliminated:
        """Integrate z (g,) out of residuals e - B z, with B (L, g) the `columns` of each recording.

        Args:
            values: Values of the noise's parameters (n,), in their units.
            residuals: Residuals e (L,) of each recording, including its own terms.
            columns: Columns B (L, g) of each recording.
            weights: Prior of each z (g,): standard normal where it is 1, flat where it is 0.
            problems: The prepared recordings.
            orthogonal: How many columns at the start are nearly orthogonal to each other; these may
                be many.

        Returns:
            The logarithm of the integral, and the density of z given everything else.
        """
        total, rows = jnp.zeros(()), []
        for residual, column, problem in zip(residuals, columns, problems, strict=True):
            scaled = self.scaled(values, problem)
            count = jnp.asarray(scaled.count)
            signals = jnp.concatenate([column, jnp.asarray(residual)[:, None]], axis=1)
            own = jnp.asarray(problem.own)
            size = own.shape[1]
            whitened = scaled.whiten(jnp.concatenate([own, signals], axis=1))
            factor, remainder = gram_schmidt(whitened, size)
            total += count * jnp.log(scaled.whitening[0]) - jnp.log(jnp.diag(factor)).sum()
            total -= (count - size) * np.log(2 * np.pi) / 2
            rows.append(remainder)
        prior = jnp.pad(jnp.diag(jnp.asarray(weights)), ((0, 0), (0, 1)))
        triangle, projection, squared_length = triangular_factor(
            jnp.concatenate([*rows, prior]), orthogonal
        )
        total -= squared_length / 2 + jnp.log(jnp.diag(triangle)).sum()
        return Eliminated(total, solve_triangular(triangle, projection), triangle)

    def own(
        self, values: Array, residuals: Signals, problems: Problems, normals: Signals
    ) -> Signals:
        draws = []
        for residual, problem, normal in zip(residuals, problems, normals, strict=True):
            own = jnp.asarray(problem.own)
            signals = jnp.concatenate([own, jnp.asarray(residual)[:, None]], axis=1)
            factor, _ = gram_schmidt(self.scaled(values, problem).whiten(signals), own.shape[1])
            coefficients = solve_triangular(factor[:, :-1], factor[:, -1] + normal)
            draws.append(own @ coefficients)
        return tuple(draws)

    def innovations(
        self, values: np.ndarray, generator: np.random.Generator, size: int
    ) -> np.ndarray:
        return generator.standard_normal(size)


def _with_whitening(problem: AbstractProblem, whitening: Array) -> AbstractProblem:
    """The problem with another whitening filter (taps,)."""
    return eqx.tree_at(lambda p: p.whitening, problem, whitening)


def _with_filters(preparation: Preparation, taps: int) -> Preparation:
    """The recordings prepared for white noise of standard deviation 1 and this filter length."""
    unit = preparation.takes[0].recording.response_unit
    filter_ = np.eye(1, taps)[0]
    sigmas = [_noise(take.noise).sigma for take in preparation.takes]
    return preparation.with_noises([Noise(s, unit, "residual", filter_, 1.0) for s in sigmas])


def _noise(noise: Noise | None) -> Noise:
    """The noise of a prepared recording, which a fit always has."""
    assert noise is not None  # a fit always has one at its end
    return noise


def _used_residuals(fit: Fit) -> list[np.ndarray]:
    """The fit's residuals of each recording, at the samples that count."""
    takes = fit.preparation.takes
    return [r[take.used] for r, take in zip(fit.residuals, takes, strict=True)]


class WhiteNoise(AbstractGaussianNoise):
    """Independent normal noise of standard deviation σ [response]."""

    @property
    def name(self) -> str:
        return "white"

    @property
    def taps(self) -> int:
        return 1

    def prepared(self, preparation: Preparation) -> Preparation:
        return _with_filters(preparation, 1)

    def terms(self, fit: Fit, residuals: Signals, problems: Problems) -> tuple[Term, ...]:
        take = fit.preparation.takes[0]
        fit_sd = _noise(take.noise).sigma
        prior = within_a_factor(fit_sd, _DECADE)
        residual_sd = float(np.sqrt(np.mean(np.concatenate(_used_residuals(fit)) ** 2)))
        return (Term("noise.sigma", take.recording.response_unit, prior, residual_sd),)

    def scaled(self, values: Array | np.ndarray, problem: AbstractProblem) -> AbstractProblem:
        return _with_whitening(problem, jnp.asarray(problem.whitening) / values[0])


class MeasuredNoise(AbstractGaussianNoise):
    """Noise of the colour by which the fit was weighted, times a common scale.

    The colour comes from repeats, rests or the residual, as `Noise.method` states.
    """

    @property
    def name(self) -> str:
        return "measured"

    @property
    def taps(self) -> int:
        return 1

    def prepared(self, preparation: Preparation) -> Preparation:
        return preparation

    def terms(self, fit: Fit, residuals: Signals, problems: Problems) -> tuple[Term, ...]:
        return (_scale_term(fit),)

    def scaled(self, values: Array | np.ndarray, problem: AbstractProblem) -> AbstractProblem:
        return _with_whitening(problem, jnp.asarray(problem.whitening) / values[0])


def _scale_term(fit: Fit) -> Term:
    """The noise's scale relative to the fit's noise: 95 % within a factor of ten."""
    fit_sd = np.concatenate(
        [np.full(take.used.sum(), _noise(take.noise).sigma) for take in fit.preparation.takes]
    )
    scale = float(np.sqrt(np.mean((np.concatenate(_used_residuals(fit)) / fit_sd) ** 2)))
    return Term("noise.scale", "1", within_a_factor(1.0, _DECADE), scale)


class ARNoise(AbstractGaussianNoise):
    """Autoregressive noise e_t = Σ_k φ_k e_{t-k} + σ ε_t, of order p ≤ 12.

    It is sampled as partial autocorrelations, uniform in (-1, 1), which cover exactly the
    stationary processes, and the innovations' standard deviation σ [response].
    Source: Barndorff-Nielsen & Schou, J. Multivariate Anal. 3 (1973) 408.

    Attributes:
        order: The order p.
    """

    order: int = eqx.field(static=True)

    @property
    def name(self) -> str:
        return f"AR({self.order})"

    @property
    def taps(self) -> int:
        return self.order + 1

    def prepared(self, preparation: Preparation) -> Preparation:
        return _with_filters(preparation, self.order + 1)

    def terms(self, fit: Fit, residuals: Signals, problems: Problems) -> tuple[Term, ...]:
        unit = fit.preparation.takes[0].recording.response_unit
        coefficients, innovation = autoregression(_used_residuals(fit))
        start = np.zeros(self.order)
        partials_of_fit = partial_autocorrelations(-coefficients[1:])[: self.order]
        start[: partials_of_fit.size] = partials_of_fit
        partials = [
            Term(f"noise.partial[{k + 1}]", "1", Uniform(-1.0, 1.0), float(value))
            for k, value in enumerate(start)
        ]
        fit_sd = _noise(fit.preparation.takes[0].noise).innovation
        sigma = Term("noise.sigma", unit, within_a_factor(fit_sd, _DECADE), innovation)
        return (*partials, sigma)

    def scaled(self, values: Array | np.ndarray, problem: AbstractProblem) -> AbstractProblem:
        taps = jnp.concatenate([jnp.ones(1), -autoregressive(jnp.asarray(values[:-1]))])
        padding = (0, problem.whitening.shape[0] - taps.size)
        return _with_whitening(problem, jnp.pad(taps, padding) / values[-1])


def ar_noise_of(fit: Fit) -> ARNoise:
    """AR(p) noise of the order that BIC chooses for the fit's residual, at least 1."""
    coefficients, _ = autoregression(_used_residuals(fit))
    return ARNoise(min(max(coefficients.size - 1, 1), _LARGEST_ORDER))


def autoregressive(partials: Array) -> Array:
    """Coefficients φ (p,) from partial autocorrelations (p,), by Levinson's recursion."""
    coefficients = jnp.zeros(0)
    for k in range(partials.shape[0]):
        coefficients = jnp.concatenate(
            [coefficients - partials[k] * coefficients[::-1], partials[k : k + 1]]
        )
    return coefficients


def partial_autocorrelations(coefficients: np.ndarray) -> np.ndarray:
    """Partial autocorrelations (p,) from coefficients φ (p,), by the inverse recursion."""
    remaining, partials = np.asarray(coefficients, float), []
    while remaining.size:
        last = remaining[-1]
        partials.append(last)
        remaining = (remaining[:-1] + last * remaining[-2::-1]) / (1 - last**2)
    return np.array(partials[::-1])


class StudentNoise(AbstractNoiseModel):
    """Noise of the measured colour with innovations of Student's t: outliers weigh little.

        w/s ~ t_ν,     s the scale relative to the fit's noise, ν degrees of freedom

    The recordings' own coefficients, their offsets first, are sampled, because their integral has
    no closed form.
    Source: Lange, Little & Taylor, J. Am. Stat. Assoc. 84 (1989) 881.
    """

    @property
    def name(self) -> str:
        return "Student-t"

    @property
    def taps(self) -> None:
        return None

    def prepared(self, preparation: Preparation) -> Preparation:
        return preparation

    def terms(self, fit: Fit, residuals: Signals, problems: Problems) -> tuple[Term, ...]:
        freedom = Term("noise.degrees_of_freedom", "1", _TAILS, 10.0)
        unit = fit.preparation.takes[0].recording.response_unit
        own = []
        for at, (take, problem) in enumerate(zip(fit.preparation.takes, problems, strict=True)):
            response = take.recording.response
            prior = Normal(response.mean(), _OWN_SPANS * np.ptp(response))
            assert isinstance(problem, Problem)
            used = np.asarray(problem.weights) > 0
            starts = np.linalg.lstsq(problem.own[used], residuals[at][used], rcond=None)[0]
            names = ["offset", *(f"past[{k}]" for k in range(1, starts.size))]
            label = f"[{at}]" if len(problems) > 1 else ""
            own += [
                Term(f"{name}{label}", unit, prior, float(start))
                for name, start in zip(names, starts, strict=True)
            ]
        return (_scale_term(fit), freedom, *own)

    def scaled(self, values: Array | np.ndarray, problem: AbstractProblem) -> AbstractProblem:
        return _with_whitening(problem, jnp.asarray(problem.whitening) / values[0])

    def log_density(self, values: Array, residuals: Signals, problems: Problems) -> Array:
        total = jnp.zeros(())
        terms = self.own(values, residuals, problems, ())
        for residual, problem, term in zip(residuals, problems, terms, strict=True):
            scaled = self.scaled(values, problem)
            assert isinstance(scaled, Problem)  # as `taps` says
            white = scaled.whiten(residual - term)
            log_densities = student_t.logpdf(white, values[1]) + jnp.log(scaled.whitening[0])
            total += jnp.sum(log_densities * scaled.weights)
        return total

    def own(
        self, values: Array, residuals: Signals, problems: Problems, normals: Signals
    ) -> Signals:
        terms, at = [], 2
        for problem in problems:
            count = problem.own.shape[1]
            terms.append(jnp.asarray(problem.own) @ values[at : at + count])
            at += count
        return tuple(terms)

    def innovations(
        self, values: np.ndarray, generator: np.random.Generator, size: int
    ) -> np.ndarray:
        return generator.standard_t(values[1], size)
