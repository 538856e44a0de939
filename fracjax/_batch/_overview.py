"""What a batch's table says as a whole: spreads, outliers, bounds, residuals above the noise."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .._fit import FAR_ABOVE_NOISE
from .._recording import InputError, conversion

if TYPE_CHECKING:
    import pandas as pd

_OUTLYING = 5.0
"""Distance of an outlier from the median, in robust standard deviations.  Chosen by judgement."""
_NORMAL_DEVIATION = 1.4826
"""A normal distribution's standard deviation over its median absolute deviation."""
_FROM_RESIDUAL = "residual"
"""The noise's origin where it is the residual itself, which then cannot be far above it."""


class Spread(NamedTuple):
    """A column of the table over the fitted recordings, in one unit.

    Attributes:
        name: the parameter, or the score.
        unit: the unit that most of them have.
        values: (R,) in `unit`, NaN where there is none, or one that cannot be converted to it.
        errors: (R,) standard errors in `unit`, NaN where there is none.
        outlying: (R,) whether a value is far from the median.
    """

    name: str
    unit: str
    values: np.ndarray
    errors: np.ndarray
    outlying: np.ndarray

    def quantile(self, share: float) -> float:
        """The value below which this share of the values lies, in `unit`."""
        return float(np.nanquantile(self.values, share))


def parameters_in(rows: pd.DataFrame) -> list[str]:
    """The labels of the fitted parameters."""
    return [str(c).removesuffix(".value") for c in rows.columns if str(c).endswith(".value")]


def spreads(rows: pd.DataFrame) -> list[Spread]:
    """The residual's rms and every parameter, over the recordings that were fitted: one for all
    whose units can be converted to each other."""
    columns = [("RMSE", "rmse", "", "response_unit")]
    columns += [(p, f"{p}.value", f"{p}.standard_error", f"{p}.unit") for p in parameters_in(rows)]
    fitted = (rows["status"] == "fitted").to_numpy()
    return [each for column in columns for each in _spreads(rows, fitted, *column)]


def _spreads(
    rows: pd.DataFrame, fitted: np.ndarray, name: str, value: str, error: str, unit_name: str
) -> Iterator[Spread]:
    """One column over the fitted rows, for each kind of unit, the commonest first."""
    units = rows[unit_name].where(fitted)
    given = rows[value].to_numpy(float)
    given_errors = rows[error].to_numpy(float) if error else np.full(len(rows), np.nan)
    while not units.isna().to_numpy().all():
        common = str(units.mode().iloc[0])
        scales = {each: _scale(str(each), common) for each in units.dropna().unique()}
        scale = np.array([scales.get(each, np.nan) for each in units])
        values, errors = given * scale, given_errors * scale
        units = units.where(np.isnan(scale))
        away = np.abs(values - np.nanmedian(values))
        deviation = _NORMAL_DEVIATION * float(np.nanmedian(away))
        # What is within its own error is no outlier, however alike the others are.
        far = _OUTLYING * np.maximum(deviation, np.nan_to_num(errors))
        yield Spread(name, common, values, errors, away > far)


def _scale(written: str, common: str) -> float:
    """The factor from one unit to another, NaN where they measure different things.

    A power of a second that an order decides is left out of both: um/V*s^alpha counts as um/V.
    """
    if written == common:
        return 1.0
    try:
        scale = conversion(*(re.sub(r"\*s\^[^*/]+", "", each) for each in (written, common)))
    except InputError:
        return np.nan
    return np.nan if scale is None else scale


def at_bounds(rows: pd.DataFrame) -> list[list[str]]:
    """Per recording, the parameters whose fit ended on a bound."""
    names = parameters_in(rows)
    marks = rows[[f"{name}.at_bound" for name in names]].to_numpy(bool)
    return [[n for n, mark in zip(names, row, strict=True) if mark] for row in marks]


def over_noise(rows: pd.DataFrame) -> np.ndarray:
    """Per recording (R,), the residual's rms over the measured noise; NaN where none was measured.

    A noise that was read from the residual itself cannot judge it.
    """
    measured = (rows["noise_method"] != _FROM_RESIDUAL) & (rows["noise_sigma"] > 0)
    ratio = rows["rmse"] / rows["noise_sigma"].where(measured)
    return ratio.to_numpy(float)


def overview(rows: pd.DataFrame) -> dict[str, int]:
    """How many fitted recordings are suspect: at a bound, or far above the noise."""
    fitted = (rows["status"] == "fitted").to_numpy()
    on_bound = np.array([bool(names) for names in at_bounds(rows)], bool)
    far = np.nan_to_num(over_noise(rows)) > FAR_ABOVE_NOISE
    return {
        "at a bound": int(np.sum(fitted & on_bound)),
        "far above the noise": int(np.sum(fitted & far)),
        "of unknown noise": int(np.sum(fitted & np.isnan(over_noise(rows)))),
        "fitted in a stack": int(np.sum(fitted & rows["stacked"].to_numpy(bool))),
    }
