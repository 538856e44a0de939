"""Estimates of creep parameters with their standard errors and intervals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._blocks import PEADynamics
from .._fit import is_at_bound, logarithmic_interval
from .._parameters import Parameter, named_parameters

BOUNDED = ("mu", "frequency", "damping")
"""Parameters of PEADynamics that have bounds."""


@dataclass(frozen=True)
class CreepEstimate:
    """A parameter with its standard error and 95 % interval.

    Attributes:
        name: The parameter's name.
        value: Its estimate, in `unit`.
        standard_error: Its standard error, in `unit`.
        low: Lower end of the 95 % interval, in `unit`.
        high: Upper end of the 95 % interval, in `unit`.
        unit: Its unit, in terms of response and drive, or "1".
        identified: False if the table does not determine the parameter: the standard error exceeds
            half its plausible range (for a gain: half the whole gain), or the fit ended on a bound.
    """

    name: str
    value: float
    standard_error: float
    low: float
    high: float
    unit: str
    identified: bool


def inverse_square(jacobian: np.ndarray) -> np.ndarray:
    """(JᵀJ)⁻¹ (n, n), large but finite in directions to which J (N, n) is insensitive.

    The floors of 1e-9 limit it to 1e18 of the scaled inverse; chosen by judgement.
    """
    lengths = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-9)
    _, singular, right_vectors = np.linalg.svd(jacobian / lengths, full_matrices=False)
    spread = right_vectors.T / np.maximum(singular, 1e-9) / lengths[:, None]
    return spread @ spread.T


def _half_width(parameter: Parameter) -> float:
    """Half the plausible range, as a standard error at the parameter's value."""
    low, high = parameter.plausible
    if parameter.logarithmic:
        return float(0.5 * np.log(high / low) * parameter.value)
    return float(0.5 * (high - low))


def linear_estimate(
    name: str, value: float, error: float, quantile: float, unit: str, identified: bool
) -> CreepEstimate:
    """An estimate with an interval that is symmetric; `quantile` is in standard errors."""
    low, high = value - quantile * error, value + quantile * error
    return CreepEstimate(name, value, error, low, high, unit, identified)


def logarithmic_estimate(
    name: str, value: float, error: float, quantile: float, unit: str, identified: bool
) -> CreepEstimate:
    """An estimate with an interval that is symmetric on a logarithmic scale, and always finite."""
    low, high = logarithmic_interval(value, quantile * error)
    return CreepEstimate(name, value, error, low, high, unit, identified)


def estimates_of(
    block: PEADynamics,
    order: float,
    errors: dict[str, float],
    quantile: float,
    level: float,
    power: float,
) -> tuple[CreepEstimate, ...]:
    """Estimates of the block's parameters and of the creep order.

    `level` is the whole gain [response/drive] at the table's centre, and `power` is s^-μ there.
    """
    parameters = named_parameters(block)
    # If μ may be 0, g and g_μ cannot be distinguished.
    separable = abs(float(block.mu.value)) > quantile * errors["mu"]
    largest = {name: _half_width(parameters[name]) for name in BOUNDED}
    largest |= {"gain": 0.5 * level * separable, "creep_gain": 0.5 * level * separable * power}
    estimates = [
        (logarithmic_estimate if p.logarithmic else linear_estimate)(
            name,
            float(p.value),
            errors[name],
            quantile,
            p.unit,
            bool(errors[name] <= largest[name]) and not is_at_bound(p, 0),
        )
        for name, p in parameters.items()
    ]
    order_identified = bool(errors["creep_order"] <= largest["mu"])
    return (
        *estimates,
        linear_estimate(
            "creep_order", order, errors["creep_order"], quantile, "1", order_identified
        ),
    )


def mode_unidentified(estimate: CreepEstimate) -> CreepEstimate:
    """The estimate; of a mode that the table does not show, with its bounds as interval."""
    if estimate.name not in ("frequency", "damping"):
        return estimate
    parameter = named_parameters(PEADynamics())[estimate.name]
    return replace(
        estimate,
        standard_error=_half_width(parameter),
        low=float(parameter.lower),
        high=float(parameter.upper),
        identified=False,
    )
