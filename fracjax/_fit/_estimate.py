"""A fitted parameter with its standard error and interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._parameters import Parameter

_MOST = 100.0
"""More than e^100 is no interval, and would overflow."""


@dataclass(frozen=True)
class Estimate:
    """A fitted parameter with its standard error, in `unit`.

    `identified` is false where the data leave it open by more than half its plausible range, or, of
    a gain, by more than 5 % of the response.  `at_bound` says that the fit ended on a bound.
    `logarithmic` is the parameter's own: a time constant known to half its value is known by a
    factor, and never negative.  `ends` are those of the 95 % interval by the parameter's profile,
    where that was asked for.
    """

    name: str
    value: float
    standard_error: float
    unit: str
    identified: bool
    at_bound: bool
    logarithmic: bool = False
    ends: tuple[float, float] | None = None

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval: the profile's, or v ± 1.96 s and, of a logarithmic parameter,
        v exp(± 1.96 s/v)."""
        if self.ends is not None:
            return self.ends
        half = 1.96 * self.standard_error
        if self.logarithmic:
            return logarithmic_interval(self.value, half)
        return self.value - half, self.value + half

    def to_dict(self) -> dict:
        """Plain data, as in fit.json, where it stands under its name."""
        low, high = self.interval
        return {
            "value": self.value,
            "standard_error": self.standard_error,
            "low": low,
            "high": high,
            "unit": self.unit,
            "identified": self.identified,
            "at_bound": self.at_bound,
        }


def logarithmic_interval(value: float, half: float) -> tuple[float, float]:
    """Symmetric in the logarithm; value ± half where that is small, and finite where it is open."""
    factor = float(np.exp(min(half / value, _MOST)))
    return value / factor, value * factor


def is_at_bound(parameter: Parameter, k: int) -> bool:
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
