"""The options of a fit: one set of keywords for `fit`, `crosscheck` and `fit_batch`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict, TypeVar

import numpy as np

from .._blocks import AbstractBlock
from .._models import Model
from .._naming import path_of_name, shown_names, unknown_parameter
from .._parameters import Parameter, named_parameters, replace_parameters
from .._recording import InputError, pair_of
from ._conditions import Conditions, Tied, conditions_of
from ._normal import Normal
from ._weights import Mask, Weights

Bounds = Mapping[str, tuple[float, float]]
T = TypeVar("T")


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
    """The model's block with the options applied, and the conditions.  Raises InputError.

    The options name parameters by their blocks or by their places; the conditions by their places.
    """

    def placed(options: Mapping[str, T] | None) -> dict[str, T]:
        """An option by the places of the parameters."""
        return {path_of_name(n, model.block): value for n, value in (options or {}).items()}

    block = _constrain(model.block, placed(fixed), placed(bounds))
    return conditions_of(block, tied=tied, own=own, priors=priors)


def _constrain(block: AbstractBlock, fixed: Mapping[str, float], bounds: Bounds) -> AbstractBlock:
    """The block with the parameters that a call fixes or bounds changed.  Raises InputError."""
    parameters, shown = named_parameters(block), shown_names(block)
    for name in (*fixed, *bounds):
        if name not in parameters:
            raise unknown_parameter(name, shown.values())
    changed = {}
    for name in {*fixed, *bounds}:
        p, called = parameters[name], shown[name]
        low, high = p.lower, p.upper
        if name in bounds:
            where = f'bounds of "{called}"'
            low, high = pair_of(bounds[name], where, "a lower and an upper one", "write (0.1, 0.2)")
        if name in bounds and not np.isfinite(np.subtract(high, low)):
            raise InputError(
                f'parameter "{called}": expected two finite bounds, found {low} and {high}; '
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
            raise InputError(f'parameter "{called}": {error}.') from None
    return replace_parameters(block, changed)
