"""A fitted parameter with its standard error and interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._parameters import Parameter

_MOST = 100.0
"""A factor above e^100 is no useful interval, and would overflow."""


@dataclass(frozen=True)
class Estimate:
    """A fitted parameter with its standard error.

    Attributes:
        name: the parameter's name, with its index or recording where it has one, by its block:
            "resonance.damping", or "damping" where the model is one block.
        value: in `unit`.
        standard_error: in `unit`.
        unit: the parameter's unit.
        identified: false where the standard error exceeds half the plausible range, or, for a gain,
            5 % of the response, and for a frequency above half the sampling rate.
        at_bound: whether the fit ended on a bound.
        logarithmic: whether the parameter is searched for on a logarithmic scale: a time constant
            known to half its value is known by a factor, and never negative.
        ends: the 95 % interval from the parameter's profile, in `unit`, None where none was
            requested.
        path: the name by its place in the composition, such as "second.damping".
        remark: what a table adds, such as the radius of a play.
    """

    name: str
    value: float
    standard_error: float
    unit: str
    identified: bool
    at_bound: bool
    logarithmic: bool = False
    ends: tuple[float, float] | None = None
    path: str = ""
    remark: str = ""

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval, in `unit`.

        It is the profile's where there is one.  Otherwise it is v ± 1.96 s, and for a logarithmic
        parameter v exp(± 1.96 s/v).
        """
        if self.ends is not None:
            return self.ends
        half = 1.96 * self.standard_error
        if self.logarithmic:
            return logarithmic_interval(self.value, half)
        return self.value - half, self.value + half

    def to_dict(self) -> dict:
        """The estimate as plain data, as in fit.json under its name.

        Returns:
            Value, standard error, interval, unit and marks by name.
        """
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
    """The interval value · exp(± half/value), with a factor of at most e^100."""
    factor = float(np.exp(min(half / value, _MOST)))
    return value / factor, value * factor


def is_at_bound(parameter: Parameter, k: int) -> bool:
    """Whether component k is within a thousandth of its range of a bound other than zero."""
    return bool(at_bound(parameter, k, np.array(parameter.component(parameter.value, k))))


def at_bound(parameter: Parameter, k: int, values: np.ndarray) -> np.ndarray:
    """Whether values (…) of component k are as `is_at_bound` says."""
    low, high = (parameter.component(bound, k) for bound in (parameter.lower, parameter.upper))
    if not np.isfinite(high - low):
        return np.zeros(values.shape, bool)
    eligible = (low != 0) | (values >= high / 2)
    if parameter.logarithmic:
        low, values, high = np.log(low), np.log(values), np.log(high)
    return eligible & (np.minimum(values - low, high - values) < 1e-3 * (high - low))


def physical_unit(unit: str, units: tuple[str, str]) -> str:
    """A parameter's unit with the recording's drive and response units inserted."""
    drive, response = units
    return unit.replace("response", response).replace("drive", drive)
