"""Standard errors from the whitened Jacobian, and what the data do not determine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.signal import lfilter

from .._blocks import AbstractBlock
from .._parameters import named_parameters
from .._prepare import Conditions, Number, autoregression, numbers_of, prior_rows
from .._solve import Linearised, sensitivity
from ._combinations import Combination, combinations_of
from ._estimate import Estimate, is_at_bound, physical_unit

_CLOSE = 0.995
_SHARE_OF_RESPONSE = 0.05
_LEAST_LENGTH = 1e-100
"""Of a parameter that moves nothing the error is as large as can still be squared."""


@dataclass(frozen=True)
class Uncertainty:
    """What is known of a fit's numbers.

    `correlated` names pairs that the data only know together, `combinations` what they know of
    them.  `curvature` (n,) are the errors that χ² alone gives the estimates.  `order` is that of
    the residual's autoregression, 0 where it is white.
    """

    estimates: tuple[Estimate, ...]
    correlated: tuple[str, ...]
    combinations: tuple[Combination, ...]
    curvature: np.ndarray
    order: int


def uncertainty_of(
    blocks: tuple[AbstractBlock, ...],
    problems: Sequence[Linearised],
    conditions: Conditions,
    *,
    units: tuple[str, str],
    inflation: float,
    residuals: Sequence[np.ndarray] | None = None,
) -> Uncertainty:
    r"""The uncertainty of all free parameters.

    With J the derivative whitened by the noise, P the rows of the priors and A = JᵀJ + PᵀP:

        covariance = A⁻¹ (f² JᵀRJ + PᵀP) A⁻¹

    f = `inflation` ≥ 1 is the ratio of residual to noise, so that a model that does not fit gets
    wider, not narrower, intervals.  R is the autocorrelation of the whitened `residuals`, from
    their autoregression, its order by BIC: the unit matrix where there are none, or the noise is as
    it was taken to be.  A noise given as white that is not, and a mismatch that lasts, then count
    for what they are.
    R from an autoregression rather than from products of scores (Newey & West), whose truncated
    sums are too small for the errors of tens of correlated samples; the noise being stationary and
    independent of J, it is the same covariance, better known.
    Sources: Newey & West, Econometrica 55 (1987) 703; Andrews & Monahan, Econometrica 60 (1992)
    953.
    """
    numbers = numbers_of(blocks[0], len(problems), conditions)
    derivative = sensitivity(blocks, problems, numbers)[1]
    priors = prior_rows(numbers, conditions)
    nothing = np.zeros((len(priors.means), derivative.shape[1] - len(numbers.labels)))
    rows = np.concatenate([priors.shapes, priors.gains, nothing], axis=1)
    stacked = np.concatenate([derivative, (rows.T / priors.sds).T])
    lengths = np.maximum(np.linalg.norm(stacked, axis=0), _LEAST_LENGTH)
    left, singular, right = np.linalg.svd(stacked / lengths, full_matrices=False)
    spread = right.T / np.maximum(singular, 1e-12)
    counted = [np.asarray(p.weights) > 0 for p in problems]
    recursion = np.ones(1)
    if residuals is not None:
        used = [r[c] for r, c in zip(residuals, counted, strict=True)]
        recursion = autoregression(used)[0]
    ends = np.cumsum([len(c) for c in counted])
    *parts, prior = np.split(left, ends)
    coloured = [_coloured(part, recursion) for part in parts]
    middle = inflation**2 * np.sum([c.T @ c for c in coloured], axis=0) + prior.T @ prior
    count = len(numbers.labels)

    def physical(inside: np.ndarray) -> np.ndarray:
        return (spread @ inside @ spread.T / np.outer(lengths, lengths))[:count, :count]

    covariance = physical(middle)
    whole = np.linalg.norm([p.size for p in problems])
    sizes = np.linalg.norm(derivative, axis=0)[:count] / whole
    errors = np.sqrt(np.diag(covariance))
    found = tuple(
        _estimate(number, number in numbers.gains, blocks, error, error * size, units)
        for number, error, size in zip(numbers.shapes + numbers.gains, errors, sizes, strict=True)
    )
    correlation = covariance / np.outer(errors, errors)
    labels = numbers.labels
    pairs = tuple(
        f"{labels[i]} and {labels[j]} (correlation {correlation[i, j]:+.4f})"
        for i, j in combinations(range(count), 2)
        if abs(correlation[i, j]) > _CLOSE
    )
    values = np.array([e.value for e in found])
    together = combinations_of(labels, values, [e.unit for e in found], covariance)
    curvature = np.sqrt(np.diag(physical(np.eye(len(lengths)))))
    return Uncertainty(found, pairs, together, curvature, recursion.size - 1)


def _coloured(columns: np.ndarray, recursion: np.ndarray) -> np.ndarray:
    """Columns C (L, n) as HᵀC, with HHᵀ the autocorrelation of an autoregression."""
    if recursion.size == 1:
        return columns
    impulse = np.zeros(len(columns))
    impulse[0] = 1.0
    power = np.sum(np.asarray(lfilter([1.0], recursion, impulse)) ** 2)
    # Against time, and on beyond the first sample, for the noise began before it.
    reversed_ = np.concatenate([columns[::-1], np.zeros_like(columns)])
    return np.asarray(lfilter([1.0], recursion, reversed_, axis=0)) / np.sqrt(power)


def _estimate(
    number: Number,
    gain: bool,
    blocks: tuple[AbstractBlock, ...],
    error: float,
    share: float,
    units: tuple[str, str],
) -> Estimate:
    """One number's estimate; of a gain, `share` is what its error is worth of the response."""
    parameter, k = named_parameters(blocks[number.recording or 0])[number.name], number.component
    value = float(np.ravel(parameter.value)[k])
    low, high = (
        np.ravel(np.broadcast_to(end, np.shape(parameter.value)))[k] for end in parameter.plausible
    )
    if gain:
        identified = share <= _SHARE_OF_RESPONSE
    elif parameter.logarithmic:
        identified = error / value <= 0.5 * np.log(high / low)
    else:
        identified = error <= 0.5 * (high - low)
    return Estimate(
        number.label,
        value,
        float(error),
        physical_unit(parameter.unit, units),
        bool(identified),
        is_at_bound(parameter, k),
        parameter.logarithmic,
    )
