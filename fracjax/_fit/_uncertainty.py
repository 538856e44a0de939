"""Standard errors from the whitened Jacobian, and parameters that the data do not determine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._blocks import AbstractBlock
from .._filters import solve_recursion
from .._naming import suffix_of
from .._parameters import named_parameters
from .._prepare import Conditions, FreeParameter, autoregression, free_parameters_of, prior_rows
from .._solve import Linearised, sensitivity
from ._estimate import Estimate, at_bound, physical_unit

_STRONG_CORRELATION = 0.995
"""Correlation from which two parameters are reported as strongly correlated.  Chosen by
judgement."""
_SHARE_OF_RESPONSE = 0.05
"""Largest effect of a gain's error, as a share of the response, of an identified gain.  Chosen by
judgement."""
_LEAST_LENGTH = 1e-100
"""If a parameter has no effect, its standard error is the largest whose square is finite."""


@dataclass(frozen=True)
class Uncertainty:
    """The uncertainty of a fit's free parameters.

    Attributes:
        estimates: the parameters with standard errors, in their units.
        correlated: pairs that are strongly correlated, as texts.
        curvature: (n,) standard errors from χ² alone, in the parameters' units.
        order: the order of the residual's autoregression, 0 where it is white.
        correlation: (n, n) of the estimates, dimensionless.
    """

    estimates: tuple[Estimate, ...]
    correlated: tuple[str, ...]
    curvature: np.ndarray
    order: int
    correlation: np.ndarray


class Evidence(NamedTuple):
    """What the uncertainty of a fit follows from.

    Attributes:
        blocks: each recording's block.
        problems: the recordings' problems.
        inflation: the ratio f of residual to noise, at least 1.
        derivative: (ΣL, parameters + own), J; its inner products suffice where there are no
            residuals.
        residuals: per recording (L,) the whitened residual, None where it is white.
        highest: the highest frequency [Hz] that the recordings show: half the greatest rate.
    """

    blocks: tuple[AbstractBlock, ...]
    problems: Sequence[Linearised]
    inflation: float
    derivative: np.ndarray
    residuals: Sequence[np.ndarray] | None = None
    highest: float = np.inf


def uncertainty_of(
    blocks: tuple[AbstractBlock, ...],
    problems: Sequence[Linearised],
    conditions: Conditions,
    *,
    units: tuple[str, str],
    inflation: float,
) -> Uncertainty:
    """The uncertainty of all free parameters of a fit with a white residual."""
    parameters = free_parameters_of(blocks[0], len(problems), conditions)
    derivative = sensitivity(blocks, problems, parameters)[1]
    evidence = Evidence(blocks, problems, inflation, derivative)
    return uncertainties_of([evidence], conditions, units)[0]


def uncertainties_of(
    fits: Sequence[Evidence], conditions: Conditions, units: tuple[str, str]
) -> list[Uncertainty]:
    """The uncertainty of all free parameters of each of fits alike: of one block with one set of
    bounds, with derivatives of one shape.

    With J the derivative whitened by the noise, P the rows of the priors and A = JᵀJ + PᵀP:

        covariance = A⁻¹ (f² JᵀRJ + PᵀP) A⁻¹

    f ≥ 1 is the inflation, so that a model that does not fit gets wider, not narrower, intervals.
    R is the autocorrelation of the whitened residuals, from their autoregression with its order by
    BIC.  It is the unit matrix where there are no residuals, or where they are white.  R thus
    accounts for a noise that was assumed white and is not, and for a persistent mismatch.

    R comes from an autoregression and not from products of scores (Newey & West), whose truncated
    sums underestimate the errors when tens of samples are correlated.  As the noise is stationary
    and independent of J, the covariance is the same and more precise.

    Sources: Newey & West, Econometrica 55 (1987) 703; Andrews & Monahan, Econometrica 60 (1992)
        953.
    """
    parameters = free_parameters_of(fits[0].blocks[0], len(fits[0].problems), conditions)
    labels, count = parameters.labels, len(parameters.labels)
    derivatives = np.stack([fit.derivative for fit in fits])
    priors = prior_rows(parameters, conditions)
    nothing = np.zeros((len(priors.means), derivatives.shape[2] - count))
    rows = np.concatenate([priors.shapes, priors.gains, nothing], axis=1) / priors.sds[:, None]
    repeated = np.broadcast_to(rows, (len(fits), *rows.shape))
    stacked = np.concatenate([derivatives, repeated], axis=1)
    lengths = np.maximum(np.linalg.norm(stacked, axis=1, keepdims=True), _LEAST_LENGTH)
    recursions = [_recursion(fit) for fit in fits]
    inflations = np.array([fit.inflation for fit in fits])[:, None, None]
    if len(rows) or any(recursion.size > 1 for recursion in recursions):
        basis, triangle = np.linalg.qr(stacked / lengths)
        turn, singular, right = np.linalg.svd(triangle)
        of_samples, of_priors = np.split(basis @ turn, [derivatives.shape[1]], axis=1)
        pairs = zip(of_samples, fits, recursions, strict=True)
        squares = np.array([_coloured_square(*pair) for pair in pairs])
        middle = inflations**2 * squares + of_priors.swapaxes(1, 2) @ of_priors
    else:
        # R = 1, so that the basis, whose products would be 1, need not be computed.
        _, singular, right = np.linalg.svd(np.linalg.qr(stacked / lengths, mode="r"))
        middle = inflations**2 * np.eye(derivatives.shape[2])
    spread = right.swapaxes(1, 2) / np.maximum(singular, 1e-12)[:, None] / lengths.swapaxes(1, 2)
    spread = spread[:, :count]

    def errors_and_covariances(middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """In the parameters' units, from their middle matrices (R, n, n)."""
        covariances = spread @ middle @ spread.swapaxes(1, 2)
        return np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)), covariances

    errors, covariances = errors_and_covariances(middle)
    curvatures, _ = errors_and_covariances(np.eye(derivatives.shape[2]))
    correlations = covariances / (errors[:, :, None] * errors[:, None])
    response_sizes = [np.linalg.norm([p.size for p in fit.problems]) for fit in fits]
    sizes = np.linalg.norm(derivatives, axis=1)[:, :count] / np.array(response_sizes)[:, None]
    free = zip(parameters.shapes + parameters.gains, errors.T, sizes.T, strict=True)
    columns = [
        _estimates(one, one in parameters.gains, fits, error, error * size, units)
        for one, error, size in free
    ]
    estimates = list(zip(*columns, strict=True)) if columns else [()] * len(fits)
    texts: list[list[str]] = [[] for _ in fits]
    for at, i, j in np.argwhere(np.abs(np.triu(correlations, 1)) > _STRONG_CORRELATION):
        value = correlations[at, i, j]
        texts[at].append(f"{labels[i]} and {labels[j]} (correlation {value:+.4f})")
    orders = [recursion.size - 1 for recursion in recursions]
    pairs = map(tuple, texts)
    each = zip(estimates, pairs, curvatures, orders, correlations, strict=True)
    return [Uncertainty(*values) for values in each]


def _recursion(fit: Evidence) -> np.ndarray:
    """The coefficients (p+1,) of the autoregression of a fit's whitened residuals."""
    if fit.residuals is None:
        return np.ones(1)
    pairs = zip(fit.residuals, fit.problems, strict=True)
    return autoregression([r[np.asarray(p.weights) > 0] for r, p in pairs])[0]


def _coloured_square(columns: np.ndarray, fit: Evidence, recursion: np.ndarray) -> np.ndarray:
    """CᵀRC (n, n) of the columns C (ΣL, n) of a fit's recordings."""
    ends = np.cumsum([len(problem.weights) for problem in fit.problems])[:-1]
    coloured = [_coloured(part, recursion) for part in np.split(columns, ends)]
    return np.sum([c.T @ c for c in coloured], axis=0)


def _coloured(columns: np.ndarray, taps: np.ndarray) -> np.ndarray:
    """Columns C (L, n) as HᵀC, with HHᵀ the autocorrelation of an autoregression."""
    if taps.size == 1:
        return columns
    impulse = np.zeros(len(columns))
    impulse[0] = 1.0
    power = np.sum(solve_recursion(taps, impulse) ** 2)
    # Backwards in time, and beyond the first sample, because the noise began before it.
    reversed_ = np.concatenate([columns[::-1], np.zeros_like(columns)])
    return solve_recursion(taps, reversed_) / np.sqrt(power)


def _estimates(
    free_parameter: FreeParameter,
    gain: bool,
    fits: Sequence[Evidence],
    errors: np.ndarray,
    shares: np.ndarray,
    units: tuple[str, str],
) -> list[Estimate]:
    """The estimates of a free parameter, one for each of fits alike (R,), with its errors (R,).

    For a gain, `shares` (R,) are the effects of its errors as shares of the responses.
    """
    recording, k = free_parameter.recording or 0, free_parameter.component
    members = [named_parameters(fit.blocks[recording])[free_parameter.name] for fit in fits]
    first = members[0]
    values = np.array([first.component(member.value, k) for member in members])
    low, high = (first.component(end, k) for end in first.plausible)
    if gain:
        identified = shares <= _SHARE_OF_RESPONSE
    elif first.logarithmic:
        identified = errors / values <= 0.5 * np.log(high / low)
    else:
        identified = errors <= 0.5 * (high - low)
    if first.unit == "Hz":
        # Beyond it a mode acts as a mere delay, which its frequency makes look well determined.
        identified &= values <= [fit.highest for fit in fits]
    of_each = (values, errors, identified, at_bound(first, k, values))
    label, unit = free_parameter.label, physical_unit(first.unit, units)
    path = free_parameter.name + suffix_of(label)
    return [
        Estimate(label, value, error, unit, enough, ends, first.logarithmic, path=path)
        for value, error, enough, ends in zip(*(each.tolist() for each in of_each), strict=True)
    ]
