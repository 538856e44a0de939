"""The options of a fit: one set of keywords for `fit`, `crosscheck` and `fit_batch`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict

import numpy as np

from .._blocks import AbstractBlock
from .._models import Model
from .._parameters import Parameter, replace_parameters
from .._recording import InputError, pair_of
from ._conditions import Conditions, Tied, conditions_of
from ._normal import Normal
from ._weights import Mask, Weights

Bounds = Mapping[str, tuple[float, float]]


class RangeOptions(TypedDict, total=False):
    """Options by parameter name: fixed values, and narrower bounds, in the parameters' units."""

    fixed: Mapping[str, float] | None
    bounds: Bounds | None


class ModelOptions(RangeOptions, total=False):
    """`RangeOptions`, and by name: priors, and ties to another parameter or a multiple of it."""

    priors: Mapping[str, Normal] | None
    tied: Tied | None


class ParameterOptions(ModelOptions, total=False):
    """`ModelOptions`, and the names of the parameters of which each recording has its own value."""

    own: Sequence[str]


class SampleOptions(TypedDict, total=False):
    """Weights (N,) of the squared residuals, per recording, and times [s] to leave out."""

    weights: Weights
    mask: Mask


class SearchOptions(RangeOptions, SampleOptions, total=False):
    """The options of every search."""


class FitOptions(ParameterOptions, SampleOptions, total=False):
    """The options of `fit`."""


def apply_options(
    model: Model,
    *,
    fixed: Mapping[str, float] | None = None,
    bounds: Bounds | None = None,
    priors: Mapping[str, Normal] | None = None,
    tied: Tied | None = None,
    own: Sequence[str] = (),
) -> tuple[AbstractBlock, Conditions]:
    """The model's block with the options applied, and the conditions.  Raises InputError."""
    changed = constrain_parameters(model.parameters, fixed or {}, bounds or {})
    block = replace_parameters(model.block, changed)
    return conditions_of(block, tied=tied, own=own, priors=priors)


def constrain_parameters(
    parameters: dict[str, Parameter],
    fixed: Mapping[str, float],
    bounds: Bounds,
) -> dict[str, Parameter]:
    """The parameters that a call fixes or bounds, changed accordingly.  Raises InputError."""
    for name in (*fixed, *bounds):
        if name not in parameters:
            raise InputError(
                f'parameter "{name}": expected one of {", ".join(parameters)}, found none of that '
                "name; correct it"
            )
    changed = {}
    for name in {*fixed, *bounds}:
        p = parameters[name]
        low, high = p.lower, p.upper
        if name in bounds:
            where = f'bounds of "{name}"'
            low, high = pair_of(bounds[name], where, "a lower and an upper one", "write (0.1, 0.2)")
        if name in bounds and not np.isfinite(np.subtract(high, low)):
            raise InputError(
                f'parameter "{name}": expected two finite bounds, found {low} and {high}; '
                "give the widest range that makes sense"
            )
        value = fixed[name] if name in fixed else np.clip(p.value, low, high)
        try:
            changed[name] = Parameter(
                value,
                p.unit,
                lower=low,
                upper=high,
                plausible=(np.clip(p.plausible[0], low, high), np.clip(p.plausible[1], low, high)),
                logarithmic=p.logarithmic,
                gain=p.gain and name not in bounds,
                fixed=name in fixed,
            )
        except ValueError as error:
            raise InputError(f'parameter "{name}": {error}.') from None
    return changed
