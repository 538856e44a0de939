"""Standard errors from the whitened Jacobian, and parameters that the data do not determine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.signal import lfilter

from .._blocks import AbstractBlock
from .._naming import suffix_of
from .._parameters import Parameter, named_parameters
from .._prepare import Conditions, FreeParameter, autoregression, free_parameters_of, prior_rows
from .._solve import Linearised, sensitivity
from ._estimate import Estimate, is_at_bound, physical_unit

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


def uncertainty_of(
    blocks: tuple[AbstractBlock, ...],
    problems: Sequence[Linearised],
    conditions: Conditions,
    *,
    units: tuple[str, str],
    inflation: float,
    residuals: Sequence[np.ndarray] | None = None,
    derivative: np.ndarray | None = None,
) -> Uncertainty:
    """The uncertainty of all free parameters.

    With J the derivative whitened by the noise, P the rows of the priors and A = JᵀJ + PᵀP:

        covariance = A⁻¹ (f² JᵀRJ + PᵀP) A⁻¹

    f = `inflation` ≥ 1 is the ratio of residual to noise, so that a model that does not fit gets
    wider, not narrower, intervals.  R is the autocorrelation of the whitened `residuals`, from
    their autoregression with its order by BIC.  It is the unit matrix where there are no residuals,
    or where they are white.  R thus accounts for a noise that was assumed white and is not, and for
    a persistent mismatch.  `derivative` is J where it is known already; without
    `residuals` its inner products suffice.

    R comes from an autoregression and not from products of scores (Newey & West), whose truncated
    sums underestimate the errors when tens of samples are correlated.  As the noise is stationary
    and independent of J, the covariance is the same and more precise.

    Sources: Newey & West, Econometrica 55 (1987) 703; Andrews & Monahan, Econometrica 60 (1992)
        953.
    """
    parameters = free_parameters_of(blocks[0], len(problems), conditions)
    if derivative is None:
        derivative = sensitivity(blocks, problems, parameters)[1]
    priors = prior_rows(parameters, conditions)
    nothing = np.zeros((len(priors.means), derivative.shape[1] - len(parameters.labels)))
    rows = np.concatenate([priors.shapes, priors.gains, nothing], axis=1)
    stacked = np.concatenate([derivative, (rows.T / priors.sds).T])
    lengths = np.maximum(np.linalg.norm(stacked, axis=0), _LEAST_LENGTH)
    counted = [np.asarray(p.weights) > 0 for p in problems]
    recursion = np.ones(1)
    if residuals is not None:
        used = [r[c] for r, c in zip(residuals, counted, strict=True)]
        recursion = autoregression(used)[0]
    if recursion.size == 1 and not len(rows):
        # R = 1, so that the basis, whose products would be 1, need not be computed.
        _, singular, right = np.linalg.svd(np.linalg.qr(stacked / lengths, mode="r"))
        middle = inflation**2 * np.eye(singular.size)
    else:
        basis, triangle = np.linalg.qr(stacked / lengths)
        turn, singular, right = np.linalg.svd(triangle)
        ends = np.cumsum([len(c) for c in counted])
        *parts, prior = np.split(basis @ turn, ends)
        coloured = [_coloured(part, recursion) for part in parts]
        middle = inflation**2 * np.sum([c.T @ c for c in coloured], axis=0) + prior.T @ prior
    spread = right.T / np.maximum(singular, 1e-12)
    count = len(parameters.labels)

    def physical(inside: np.ndarray) -> np.ndarray:
        """The covariance (n, n) in the parameters' units, from its middle matrix."""
        return (spread @ inside @ spread.T / np.outer(lengths, lengths))[:count, :count]

    covariance = physical(middle)
    response_size = np.linalg.norm([p.size for p in problems])
    sizes = np.linalg.norm(derivative, axis=0)[:count] / response_size
    errors = np.sqrt(np.diag(covariance))
    named = [named_parameters(block) for block in blocks[: 1 if parameters.shared else None]]
    estimates = tuple(
        _estimate(parameter, parameter in parameters.gains, named, error, error * size, units)
        for parameter, error, size in zip(
            parameters.shapes + parameters.gains, errors, sizes, strict=True
        )
    )
    correlation = covariance / np.outer(errors, errors)
    labels = parameters.labels
    pairs = tuple(
        f"{labels[i]} and {labels[j]} (correlation {correlation[i, j]:+.4f})"
        for i, j in combinations(range(count), 2)
        if abs(correlation[i, j]) > _STRONG_CORRELATION
    )
    curvature = np.sqrt(np.diag(physical(np.eye(len(lengths)))))
    order = recursion.size - 1
    return Uncertainty(estimates, pairs, curvature, order, correlation)


def _coloured(columns: np.ndarray, recursion: np.ndarray) -> np.ndarray:
    """Columns C (L, n) as HᵀC, with HHᵀ the autocorrelation of an autoregression."""
    if recursion.size == 1:
        return columns
    impulse = np.zeros(len(columns))
    impulse[0] = 1.0
    power = np.sum(np.asarray(lfilter([1.0], recursion, impulse)) ** 2)
    # Backwards in time, and beyond the first sample, because the noise began before it.
    reversed_ = np.concatenate([columns[::-1], np.zeros_like(columns)])
    return np.asarray(lfilter([1.0], recursion, reversed_, axis=0)) / np.sqrt(power)


def _estimate(
    free_parameter: FreeParameter,
    gain: bool,
    named: Sequence[Mapping[str, Parameter]],
    error: float,
    share: float,
    units: tuple[str, str],
) -> Estimate:
    """The estimate of a free parameter, from each recording's parameters by name.

    For a gain, `share` is the effect of its error as a share of the response.
    """
    recording, k = free_parameter.recording, free_parameter.component
    parameter = named[recording or 0][free_parameter.name]
    value = parameter.component(parameter.value, k)
    low, high = (parameter.component(end, k) for end in parameter.plausible)
    if gain:
        identified = share <= _SHARE_OF_RESPONSE
    elif parameter.logarithmic:
        identified = error / value <= 0.5 * np.log(high / low)
    else:
        identified = error <= 0.5 * (high - low)
    return Estimate(
        free_parameter.label,
        value,
        float(error),
        physical_unit(parameter.unit, units),
        bool(identified),
        is_at_bound(parameter, k),
        parameter.logarithmic,
        path=free_parameter.name + suffix_of(free_parameter.label),
    )
