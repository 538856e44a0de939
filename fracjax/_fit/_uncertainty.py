"""Standard errors from the whitened Jacobian, and what the data do not determine."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from .._blocks import AbstractBlock
from .._parameters import Parameter, named_parameters
from ._layout import layout_of
from ._least_squares import jacobian
from ._problem import Problem

_CLOSE = 0.995
_SHARE_OF_RESPONSE = 0.05


@dataclass(frozen=True)
class Estimate:
    """A fitted parameter with its standard error, in `unit`.

    `identified` is false where the data leave it open by more than half its plausible range, or, of
    a gain, by more than 5 % of the response.  `at_bound` says that the fit ended on a bound.
    """

    name: str
    value: float
    standard_error: float
    unit: str
    identified: bool
    at_bound: bool

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval."""
        half = 1.96 * self.standard_error
        return self.value - half, self.value + half


def orthonormal(jacobian: np.ndarray) -> np.ndarray:
    """An orthonormal basis (N, r) of what the fitted parameters can produce to first order."""
    lengths = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian[:, lengths > 0] / lengths[lengths > 0]
    left, singular, _ = np.linalg.svd(scaled, full_matrices=False)
    return left[:, singular > 1e-9 * singular[0]]


def estimates(
    block: AbstractBlock,
    problems: tuple[Problem, ...],
    units: tuple[str, str],
    inflation: float,
) -> tuple[tuple[Estimate, ...], tuple[str, ...]]:
    """Estimates of all free parameters, and pairs that the data only know together.

    Covariance = inflation² (JᵀJ)⁻¹ with J whitened by the noise; `inflation` ≥ 1 is the ratio of
    residual to noise, so that a model that does not fit gets wider, not narrower, intervals.
    """
    derivative = np.asarray(jacobian(block, problems)[1])
    lengths = np.linalg.norm(derivative, axis=0) + 1e-300
    _, singular, right = np.linalg.svd(derivative / lengths, full_matrices=False)
    spread = right.T / np.maximum(singular, 1e-12)
    covariance = spread @ spread.T
    errors = inflation * np.sqrt(np.diag(covariance)) / lengths
    correlation = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))

    layout, parameters = layout_of(block), named_parameters(block)
    whitened = np.concatenate([p.whiten(p.response - p.response.mean()) for p in problems])
    response_size = np.linalg.norm(whitened)
    found, labels, at = [], layout.labels, 0
    for name, size in layout.shapes + layout.gains:
        parameter = parameters[name]
        low, high = (np.broadcast_to(b, np.shape(parameter.value)) for b in parameter.plausible)
        for k in range(size):
            value = float(np.ravel(parameter.value)[k])
            error = float(errors[at])
            if (name, size) in layout.gains:
                identified = error * lengths[at] <= _SHARE_OF_RESPONSE * response_size
            elif parameter.logarithmic:
                identified = error / value <= 0.5 * np.log(np.ravel(high)[k] / np.ravel(low)[k])
            else:
                identified = error <= 0.5 * (np.ravel(high)[k] - np.ravel(low)[k])
            found.append(
                Estimate(
                    labels[at],
                    value,
                    error,
                    physical_unit(parameter.unit, units),
                    bool(identified),
                    _at_bound(parameter, k),
                )
            )
            at += 1
    pairs = tuple(
        f"{labels[i]} and {labels[j]} (correlation {correlation[i, j]:+.4f})"
        for i, j in combinations(range(len(labels)), 2)
        if abs(correlation[i, j]) > _CLOSE
    )
    return tuple(found), pairs


def _at_bound(parameter: Parameter, k: int) -> bool:
    """Whether component k lies within a thousandth of its range of a bound that is not zero."""
    size = np.size(parameter.value)
    bounds = (parameter.lower, parameter.value, parameter.upper)
    low, value, high = (float(np.broadcast_to(np.ravel(b), (size,))[k]) for b in bounds)
    if not np.isfinite(high - low):
        return False
    if parameter.logarithmic:
        low, value, high = np.log(low), np.log(value), np.log(high)
    elif low == 0 and value < high / 2:
        return False
    return bool(min(value - low, high - value) < 1e-3 * (high - low))


def physical_unit(unit: str, units: tuple[str, str]) -> str:
    """A parameter's unit with the recording's drive and response units written in."""
    drive, response = units
    return unit.replace("response", response).replace("drive", drive)
