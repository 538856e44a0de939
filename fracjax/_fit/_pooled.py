"""The weights of plays as a table shows them: each with its radius, neighbours that the data do not
tell apart as their sum.

A grid of radii is finer than what a recording tells: the response fixes the slope s_j = w_0 + … +
w_j after a turn, and its differences w_j share the error of both ends.  A weight of the other sign
beside a large one is then no finding.  From the smallest radius on, weights are summed until the
sum has the sign of them all by two standard errors, and what remains is added to the last.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .._blocks import AbstractBlock
from .._parameters import Parameter, named_parameters
from .._show import figure, pretty_unit
from ._estimate import Estimate, physical_unit

_DETERMINED = 2.0
"""Standard errors from zero of a sum that is determined, about 95 %."""
_FAMILIES = ("weights", "shares")
"""Parameters that a block with `radii` has one of for each radius."""


def pooled(
    estimates: Sequence[Estimate],
    correlation: np.ndarray,
    block: AbstractBlock,
    units: tuple[str, str],
) -> tuple[Estimate, ...]:
    """The estimates, weights of plays pooled, in which the remark names the radii.

    `correlation`: (n, n) of the estimates; `units`: of drive and response.
    """
    unit = pretty_unit(physical_unit("drive", units))
    radii = {
        f"{path}[{k}]": f"{figure(radius)} {unit}".strip()
        for path in named_parameters(block)
        for k, radius in enumerate(_radii_beside(path, block))
    }
    shown: list[Estimate] = []
    at = 0
    while at < len(estimates):
        first = estimates[at]
        if first.path not in radii:
            shown.append(first)
            at += 1
            continue
        family = first.path.rpartition("[")[0]
        stop = at
        while stop < len(estimates) and estimates[stop].path.rpartition("[")[0] == family:
            stop += 1
        part = slice(at, stop)
        shown += _sums(estimates[part], correlation[part, part], radii)
        at = stop
    return tuple(shown)


def _radii_beside(path: str, block: AbstractBlock) -> list[float]:
    """The radii [drive] of a family of weights; none of other parameters."""
    *home, name = path.split(".")
    own: Any = block
    for part in home:
        # Effects inside a machine are numbered.
        own = own[int(part)] if part.isdecimal() else getattr(own, part)
    if name not in _FAMILIES or not hasattr(own, "radii"):
        return []
    radii = own.radii
    return np.atleast_1d(radii.value if isinstance(radii, Parameter) else radii).tolist()


def _sums(
    weights: Sequence[Estimate], correlation: np.ndarray, radii: Mapping[str, str]
) -> list[Estimate]:
    """Sums of successive weights (n,), each determined."""
    errors = np.array([weight.standard_error for weight in weights])
    covariance = correlation * np.outer(errors, errors)
    values = np.array([weight.value for weight in weights])
    sign = -1.0 if values.sum() < 0 else 1.0

    def total(start: int, stop: int) -> tuple[float, float]:
        part = slice(start, stop)
        return float(values[part].sum()), float(np.sqrt(max(covariance[part, part].sum(), 0.0)))

    starts = [0]
    for stop in range(1, len(weights)):
        value, error = total(starts[-1], stop)
        if sign * value > _DETERMINED * error:
            starts.append(stop)
    while len(starts) > 1:
        value, error = total(starts[-1], len(weights))
        if sign * value > _DETERMINED * error:
            break
        starts.pop()
    sums = []
    for start, stop in zip(starts, [*starts[1:], len(weights)], strict=True):
        value, error = total(start, stop)
        first, last = weights[start], weights[stop - 1]
        single = stop - start == 1
        places = radii[first.path] if single else f"{radii[first.path]} to {radii[last.path]}"
        sums.append(
            replace(
                first,
                name=first.name if single else f"{first.name[:-1]}…{stop - 1}]",
                path=first.path if single else f"{first.path[:-1]}…{stop - 1}]",
                value=value,
                standard_error=error,
                identified=first.identified if single else sign * value > _DETERMINED * error,
                ends=first.ends if single else None,
                remark=f"radius {places}",
            )
        )
    return sums
