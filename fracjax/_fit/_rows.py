"""Estimates as rows of a table, with significant digits only."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations as pairs_of

import numpy as np

from .._show import Table, figure, pretty_unit, rounded
from ._combinations import Combination
from ._estimate import Estimate

_LEAST_CORRELATION = 0.1
"""Smaller correlations are not listed, as in lmfit's report."""
_MOST_MEMBERS = 3
"""Parameters of a combination that tables list; fit.json has them all."""
_MOST_PAIRS = 12
"""Pairs that are listed at most."""


def estimate_row(estimate: Estimate) -> dict[str, str]:
    """Name, value, 95 % interval, unit and remark of a parameter, with significant digits only."""
    if not estimate.identified:
        value, doubt = f"about {estimate.value:.1g}", "not identified"
    else:
        value, doubt = rounded(estimate.value, estimate.standard_error), ""
    bound = "ended on its bound" if estimate.at_bound else ""
    remark = "; ".join(filter(None, (estimate.remark, doubt, bound)))
    low, high = (rounded(end, estimate.standard_error) for end in estimate.interval)
    return {
        "name": estimate.name,
        "value": value,
        "interval": f"{low} to {high}" if estimate.identified else "–",
        "unit": pretty_unit(estimate.unit),
        "remark": remark,
    }


def listed(combinations: Sequence[Combination]) -> list[Combination]:
    """The combinations of few parameters: others are no formula that anyone reads."""
    return [each for each in combinations if len(each.coefficients) <= _MOST_MEMBERS]


def combination_row(combination: Combination) -> dict[str, str]:
    """A combination of parameters as a row like that of `estimate_row`."""
    value, error = combination.value, combination.standard_error
    low, high = (rounded(value + side * 1.96 * error, error) for side in (-1, 1))
    return {
        "name": combination.text,
        "value": rounded(value, error),
        "interval": f"{low} to {high}",
        "unit": pretty_unit(combination.unit),
        "remark": f"combination, known to {combination.percent:.2g} %",
    }


def parameter_table(
    estimates: Sequence[Estimate], combinations: Sequence[Combination] = ()
) -> Table:
    """Parameters with standard errors and 95 % intervals, then their combinations."""
    headers = ["", "value", "± error", "95 % interval", "unit", "remark"]
    rows = []
    for row, error in [
        *((estimate_row(e), e.standard_error) for e in estimates),
        *((combination_row(c), c.standard_error) for c in listed(combinations)),
    ]:
        name, value, *others = row.values()
        rows.append([name, value, figure(error, 2), *others])
    return Table(headers, rows)


def correlation_table(names: Sequence[str], correlation: np.ndarray) -> Table:
    """The correlations (n, n) of at least 0.1, the strongest first."""
    listed = [
        (correlation[i, j], f"{names[i]}, {names[j]}")
        for i, j in pairs_of(range(len(correlation)), 2)
        if abs(correlation[i, j]) >= _LEAST_CORRELATION
    ]
    listed.sort(key=lambda pair: -abs(pair[0]))
    rows = [[pair, f"{value:+.4f}"] for value, pair in listed[:_MOST_PAIRS]]
    return Table(["correlation of", ""], rows, detail=True)
