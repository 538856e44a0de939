r"""Noise models whose parameters are sampled with the model's: white, AR(p), measured, Student-t.

With e the measured minus the predicted response, c each recording's own coefficients (its offset
first) and X their columns, noise is what a filter makes white:

    w = filter * (e - X c),     ln p(e) = Σ_t [ ln p(w_t) + ln filter_0 ]

over the samples whose predecessors in the filter count too: the first p are conditioned on.  Where
w is normal, c is integrated out exactly under a flat prior,

    ∫ p(e | c) dc = (2π)^{-(n-q)/2} filter_0^n |XᵀX|^{-1/2} exp(-|w_⊥|²/2),

X filtered and w_⊥ what is left of w beside it.  Gains are integrated out likewise (`_marginal`).
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
from ._prior import AbstractPrior, Logarithmic, Normal, TruncatedNormal, Uniform, within_a_factor

_DECADE = 10.0
_LARGEST_ORDER = 12
_OWN_SPANS = 10.0
# 95 % between 2 and 60 degrees of freedom: from heavy tails to all but normal.
_TAILS = Logarithmic(
    TruncatedNormal(np.log(120.0) / 2, np.log(30.0) / 2 / 1.96, np.log(1.0), np.log(1e3))
)

Signals = tuple[Array | np.ndarray, ...]
Problems = tuple[AbstractProblem, ...]


class Term(NamedTuple):
    """One number that is sampled, in `unit`, and where a search for the mode begins."""

    name: str
    unit: str
    prior: AbstractPrior
    start: float


class AbstractNoiseModel(eqx.Module):
    """What is left between prediction and measurement, as a density with parameters."""

    @property
    @abc.abstractmethod
    def name(self) -> str:
        """What a result calls it."""

    @property
    @abc.abstractmethod
    def taps(self) -> int | None:
        """How many taps of a filter its parameters change, 1 where only the scale; None where the
        density needs more of the samples than their inner products."""

    @abc.abstractmethod
    def prepared(self, preparation: Preparation) -> Preparation:
        """The recordings with the filter, and the samples that count, of this noise."""

    @abc.abstractmethod
    def terms(self, fit: Fit, residuals: Signals, problems: Problems) -> tuple[Term, ...]:
        """The noise's own unknowns, common to all recordings; residuals (L,) as `log_density`'s."""

    @abc.abstractmethod
    def scaled(self, values: Array | np.ndarray, problem: AbstractProblem) -> AbstractProblem:
        """The problem with the filter that makes this noise white, of unit scale."""

    @abc.abstractmethod
    def log_density(self, values: Array, residuals: Signals, problems: Problems) -> Array:
        """ln p(e | values) of residuals (L,) that still hold the recordings' own terms."""

    @abc.abstractmethod
    def own(
        self, values: Array, residuals: Signals, problems: Problems, normals: Signals
    ) -> Signals:
        """A draw of the recordings' own terms (L,), from standard normal numbers (q,) each."""

    @abc.abstractmethod
    def innovations(
        self, values: np.ndarray, generator: np.random.Generator, size: int
    ) -> np.ndarray:
        """Draws (size,) of the white w."""


class Eliminated(NamedTuple):
    """What is left when numbers z (g,) are integrated out: ln of the integral, and their normal
    density given all else, N(centre, (factorᵀ factor)⁻¹) with factor (g, g) upper triangular."""

    log_density: Array
    centre: Array
    factor: Array


class AbstractGaussianNoise(AbstractNoiseModel):
    """Normal noise, the recordings' own coefficients integrated out."""

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
        apart: int,
    ) -> Eliminated:
        """Residuals e - B z with z (g,) integrated out, given B (L, g) and what z has for a prior:
        standard normal where `weights` (g,) is 1, flat where it is 0.  The first `apart` columns
        are all but orthogonal to each other, of which there may be many."""
        total, rows = jnp.zeros(()), []
        for residual, column, problem in zip(residuals, columns, problems, strict=True):
            scaled = self.scaled(values, problem)
            count = jnp.asarray(scaled.count)
            signals = jnp.concatenate([column, jnp.asarray(residual)[:, None]], axis=1)
            own = jnp.asarray(problem.own)
            size = own.shape[1]
            whitened = scaled.whiten(jnp.concatenate([own, signals], axis=1))
            factor, left = _reduced(whitened, size)
            total += count * jnp.log(scaled.whitening[0]) - jnp.log(jnp.diag(factor)).sum()
            total -= (count - size) * np.log(2 * np.pi) / 2
            rows.append(left)
        prior = jnp.pad(jnp.diag(jnp.asarray(weights)), ((0, 0), (0, 1)))
        triangle, half, rest = _triangular(jnp.concatenate([*rows, prior]), apart)
        total -= rest / 2 + jnp.log(jnp.diag(triangle)).sum()
        return Eliminated(total, solve_triangular(triangle, half), triangle)

    def own(
        self, values: Array, residuals: Signals, problems: Problems, normals: Signals
    ) -> Signals:
        found = []
        for residual, problem, normal in zip(residuals, problems, normals, strict=True):
            own = jnp.asarray(problem.own)
            signals = jnp.concatenate([own, jnp.asarray(residual)[:, None]], axis=1)
            factor, _ = _reduced(self.scaled(values, problem).whiten(signals), own.shape[1])
            drawn = solve_triangular(factor[:, :-1], factor[:, -1] + normal)
            found.append(own @ drawn)
        return tuple(found)

    def innovations(
        self, values: np.ndarray, generator: np.random.Generator, size: int
    ) -> np.ndarray:
        return generator.standard_normal(size)


def _reduced(columns: Array, count: int) -> tuple[Array, Array]:
    """Of columns (L, n): the first `count` rows (count, n) of R in their QR, and what is left
    (L, n - count) of the others beside those.

    Modified Gram–Schmidt: as accurate as Householder's way for both (Björck, BIT 7 (1967) 1),
    without its calls of LAPACK, and differentiable.
    """
    rows, left = [jnp.zeros((0, columns.shape[1]))], columns
    for k in range(count):
        length = jnp.sqrt(left[:, 0] @ left[:, 0])
        unit = left[:, 0] / length
        others = unit @ left[:, 1:]
        left = left[:, 1:] - unit[:, None] * others
        rows.append(jnp.concatenate([jnp.zeros(k), length[None], others])[None])
    return jnp.concatenate(rows), left


def _triangular(columns: Array, apart: int) -> tuple[Array, Array, Array]:
    """Of columns (L, g + 1): R (g, g) of the first g, their orthonormal basis times the last (g,),
    and the squared length of what is left of the last.

    By Cholesky for the first `apart`, which are too many for Gram–Schmidt and need it less.
    """
    size, rows, left = columns.shape[1] - 1, [], columns
    if apart:
        first, left = columns[:, :apart], columns[:, apart:]
        factor = jnp.linalg.cholesky(first.T @ first)
        half = solve_triangular(factor, first.T @ left, lower=True)
        left = left - first @ solve_triangular(factor, half, lower=True, trans=1)
        rows = [jnp.concatenate([factor.T, half], axis=1)]
    others, left = _reduced(left, size - apart)
    triangle = jnp.concatenate([*rows, jnp.pad(others, ((0, 0), (apart, 0)))])
    return triangle[:, :size], triangle[:, size], left[:, 0] @ left[:, 0]


def _refiltered(problem: AbstractProblem, whitening: Array) -> AbstractProblem:
    return eqx.tree_at(lambda p: p.whitening, problem, whitening)


def _with_filters(preparation: Preparation, taps: int) -> Preparation:
    """Recordings whose noise is white of unit size, `taps` - 1 samples conditioned on."""
    unit = preparation.takes[0].recording.response_unit
    taken = np.eye(1, taps)[0]
    sigmas = [_noise_of(take.noise).sigma for take in preparation.takes]
    return preparation.with_noises([Noise(s, unit, "residual", taken, 1.0) for s in sigmas])


def _noise_of(noise: Noise | None) -> Noise:
    assert noise is not None  # a fit always ends with one
    return noise


def _series(fit: Fit) -> list[np.ndarray]:
    """What the fit left in each recording, over the samples that count."""
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
        floor = _noise_of(take.noise).sigma
        prior = within_a_factor(floor, _DECADE)
        left = float(np.sqrt(np.mean(np.concatenate(_series(fit)) ** 2)))
        return (Term("noise.sigma", take.recording.response_unit, prior, left),)

    def scaled(self, values: Array | np.ndarray, problem: AbstractProblem) -> AbstractProblem:
        return _refiltered(problem, jnp.asarray(problem.whitening) / values[0])


class MeasuredNoise(AbstractGaussianNoise):
    """Noise of the colour that the fit was weighed by, times a common scale.

    That colour comes from repeats, rests or the residual, as `Noise.method` says.
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
        return _refiltered(problem, jnp.asarray(problem.whitening) / values[0])


def _scale_term(fit: Fit) -> Term:
    """The noise over what was measured: 95 % within a factor of ten."""
    floor = np.concatenate(
        [np.full(take.used.sum(), _noise_of(take.noise).sigma) for take in fit.preparation.takes]
    )
    left = float(np.sqrt(np.mean((np.concatenate(_series(fit)) / floor) ** 2)))
    return Term("noise.scale", "1", within_a_factor(1.0, _DECADE), left)


class ARNoise(AbstractGaussianNoise):
    r"""Autoregressive noise e_t = Σ_k φ_k e_{t-k} + σ ε_t, of order p ≤ 12.

    Sampled as partial autocorrelations in (-1, 1), uniform, which are all stationary processes and
    no other, and the innovations' standard deviation σ [response].
    Source: Barndorff-Nielsen & Schou, J. Multivariate Anal. 3 (1973) 408.
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
        coefficients, innovation = autoregression(_series(fit))
        start = np.zeros(self.order)
        found = partial_autocorrelations(-coefficients[1:])[: self.order]
        start[: found.size] = found
        partials = [
            Term(f"noise.partial[{k + 1}]", "1", Uniform(-1.0, 1.0), float(value))
            for k, value in enumerate(start)
        ]
        floor = _noise_of(fit.preparation.takes[0].noise).innovation
        sigma = Term("noise.sigma", unit, within_a_factor(floor, _DECADE), innovation)
        return (*partials, sigma)

    def scaled(self, values: Array | np.ndarray, problem: AbstractProblem) -> AbstractProblem:
        taps = jnp.concatenate([jnp.ones(1), -autoregressive(jnp.asarray(values[:-1]))])
        padding = (0, problem.whitening.shape[0] - taps.size)
        return _refiltered(problem, jnp.pad(taps, padding) / values[-1])


def ar_noise_of(fit: Fit) -> ARNoise:
    """AR(p) of the order that BIC chooses for what the fit left, at least 1."""
    coefficients, _ = autoregression(_series(fit))
    return ARNoise(min(max(coefficients.size - 1, 1), _LARGEST_ORDER))


def autoregressive(partials: Array) -> Array:
    """Coefficients φ (p,) from partial autocorrelations (p,), by Levinson's recursion."""
    found = jnp.zeros(0)
    for k in range(partials.shape[0]):
        found = jnp.concatenate([found - partials[k] * found[::-1], partials[k : k + 1]])
    return found


def partial_autocorrelations(coefficients: np.ndarray) -> np.ndarray:
    """Partial autocorrelations (p,) from coefficients φ (p,): the recursion backwards."""
    left, found = np.asarray(coefficients, float), []
    while left.size:
        last = left[-1]
        found.append(last)
        left = (left[:-1] + last * left[-2::-1]) / (1 - last**2)
    return np.array(found[::-1])


class StudentNoise(AbstractNoiseModel):
    r"""Noise of the measured colour whose innovations are Student's t: outliers weigh little.

        w/s ~ t_ν,     s the scale over what was measured, ν degrees of freedom

    The recordings' own coefficients, their offsets first, are sampled: no closed integral exists.
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
        return _refiltered(problem, jnp.asarray(problem.whitening) / values[0])

    def log_density(self, values: Array, residuals: Signals, problems: Problems) -> Array:
        total = jnp.zeros(())
        terms = self.own(values, residuals, problems, ())
        for residual, problem, term in zip(residuals, problems, terms, strict=True):
            scaled = self.scaled(values, problem)
            assert isinstance(scaled, Problem)  # as `taps` says
            white = scaled.whiten(residual - term)
            each = student_t.logpdf(white, values[1]) + jnp.log(scaled.whitening[0])
            total += jnp.sum(each * scaled.weights)
        return total

    def own(
        self, values: Array, residuals: Signals, problems: Problems, normals: Signals
    ) -> Signals:
        found, at = [], 2
        for problem in problems:
            count = problem.own.shape[1]
            found.append(jnp.asarray(problem.own) @ values[at : at + count])
            at += count
        return tuple(found)

    def innovations(
        self, values: np.ndarray, generator: np.random.Generator, size: int
    ) -> np.ndarray:
        return generator.standard_t(values[1], size)
