"""Well-determined combinations of strongly correlated parameters: sums of like gains, and products.

With covariance C and errors σ_i = √C_ii, the eigenvectors v of the correlation matrix with
eigenvalues λ near 0 are combinations that are known far better than their members: Σ v_i θ_i/σ_i
has the variance λ ≪ 1.  Parameters that share such a vector form a group.  For like gains of a
group the best-determined sum is reported, for other pairs the product θ_i θ_j^p, p = ±1, whose
relative variance is to first order that of ln θ_i + p ln θ_j.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ._estimate import Estimate

_STRONG_CORRELATION = 0.995
"""One minus the largest eigenvalue of a group's vector; of two parameters it is their correlation.
Chosen by judgement."""
_LEAST_SHARE = 0.2
"""Least component of a parameter in a group's vector, and largest relative error of a product as a
share of its members'.  Chosen by judgement."""
_LEAST_CORRELATION = 0.3
"""Least correlation of two members of a group.  Chosen by judgement."""
_WIDEST = 2.0
"""Largest ratio of the error of a sum with rounded coefficients to the least.  Chosen by
judgement."""
_DECIMALS = 4
"""Coefficients are rounded to fewer decimals than this, if at all."""


@dataclass(frozen=True)
class Combination:
    """A sum Σ c_i θ_i or a product Π θ_i^c_i of parameters that is known better than its members.

    Attributes:
        text: the combination as a formula.
        value: its value, in `unit`.
        standard_error: its standard error, in `unit`.
        unit: that of the sum or the product.
        coefficients: the c_i by parameter, dimensionless; the parameters of a sum have one unit.
    """

    text: str
    value: float
    standard_error: float
    unit: str
    coefficients: dict[str, float]

    @property
    def percent(self) -> float:
        """The standard error in per cent of the value, dimensionless."""
        return 100 * self.standard_error / abs(self.value)

    def to_dict(self) -> dict:
        """The combination as plain data.

        Returns:
            Its attributes and `percent` by name.
        """
        return {
            "text": self.text,
            "value": self.value,
            "standard_error": self.standard_error,
            "percent": self.percent,
            "unit": self.unit,
            "coefficients": self.coefficients,
        }


def combinations_among(
    estimates: Sequence[Estimate], correlation: np.ndarray
) -> tuple[Combination, ...]:
    """The well-determined combinations of estimates with a correlation matrix (n, n)."""
    errors = np.array([e.standard_error for e in estimates])
    covariance = correlation * np.outer(errors, errors)
    values = np.array([e.value for e in estimates])
    units = [e.unit for e in estimates]
    return combinations_of([e.name for e in estimates], values, units, covariance)


def combinations_of(
    labels: Sequence[str], values: np.ndarray, units: Sequence[str], covariance: np.ndarray
) -> tuple[Combination, ...]:
    """The well-determined combinations of parameters (n,) that the data correlate strongly."""
    candidates = []
    for group in _groups(covariance):
        by_unit: dict[str, list[int]] = {}
        for i in group:
            by_unit.setdefault(_base(units[i]), []).append(i)
        for unit, members in by_unit.items():
            if len(members) > 1:
                block = np.ix_(members, members)
                names = [labels[i] for i in members]
                candidates.append(_sum(names, values[members], unit, covariance[block]))
        for i, j in combinations(group, 2):
            if _base(units[i]) != _base(units[j]):
                candidates.append(_product((i, j), labels, values, units, covariance))
    return tuple(c for c in candidates if c is not None)


def _base(unit: str) -> str:
    """A unit without the power of a second that an order decides: um/V*s^alpha becomes um/V."""
    return re.sub(r"\*s\^[^*/]+", "", unit)


def _groups(covariance: np.ndarray) -> list[list[int]]:
    """Indices of the parameters that are nearly degenerate with one another."""
    errors = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(errors, errors)
    eigenvalues, vectors = np.linalg.eigh(correlation)
    involved = np.abs(vectors[:, eigenvalues < 1 - _STRONG_CORRELATION]) > _LEAST_SHARE
    if not involved.any():
        return []
    from scipy.sparse.csgraph import connected_components  # most fits do without; it loads slowly

    connected = (involved.astype(int) @ involved.T.astype(int) > 0) & (
        np.abs(correlation) > _LEAST_CORRELATION
    )
    count, group_of = connected_components(connected, directed=False)
    groups = [np.flatnonzero(group_of == k).tolist() for k in range(count)]
    return [group for group in groups if len(group) > 1]


def _sum(
    labels: Sequence[str], values: np.ndarray, unit: str, covariance: np.ndarray
) -> Combination | None:
    """The best-determined sum of like quantities (n,), with coefficients as round as possible."""
    errors = np.sqrt(np.diag(covariance))
    vectors = np.linalg.eigh(covariance / np.outer(errors, errors))[1]
    best = vectors[:, 0] / errors
    best /= best[np.argmax(np.abs(best))]

    def error(coefficients: np.ndarray) -> float:
        """The standard error of a sum with these coefficients (n,)."""
        return float(np.sqrt(max(coefficients @ covariance @ coefficients, 0.0)))

    rounded = (np.round(best, decimals) for decimals in range(_DECIMALS))
    least_error = error(best)
    chosen = next((c for c in rounded if error(c) <= _WIDEST * least_error), best)
    value = float(chosen @ values)
    # Useless where one member alone is known as well, or where the sum may be 0.
    if np.count_nonzero(chosen) < 2 or abs(value) < error(chosen):
        return None
    coefficients = {n: float(c) for n, c in zip(labels, chosen, strict=True) if c != 0}
    return Combination(_as_text(coefficients), value, error(chosen), unit, coefficients)


def _as_text(coefficients: dict[str, float]) -> str:
    """A sum as a formula."""
    terms = []
    for name, c in coefficients.items():
        size = "" if abs(c) == 1 else f"{abs(c):.4g} "
        sign = ("-" if c < 0 else "") if not terms else ("- " if c < 0 else "+ ")
        terms.append(f"{sign}{size}{name}")
    return " ".join(terms)


def _product(
    pair: tuple[int, int],
    labels: Sequence[str],
    values: np.ndarray,
    units: Sequence[str],
    covariance: np.ndarray,
) -> Combination | None:
    """θ_i θ_j or θ_i/θ_j, whichever is known better, if its error is far less than either's."""
    # First the parameter that has a unit: k_h·alpha.
    i, j = sorted(pair, key=lambda at: units[at] == "1")
    if values[i] == 0 or values[j] == 0:
        return None
    relative = covariance / np.outer(values, values)
    of_logarithm = {
        power: relative[i, i] + 2 * power * relative[i, j] + relative[j, j] for power in (1, -1)
    }
    power = min(of_logarithm, key=of_logarithm.__getitem__)
    error = float(np.sqrt(max(of_logarithm[power], 0.0)))
    if error > _LEAST_SHARE * np.sqrt(min(relative[i, i], relative[j, j])):
        return None
    value = float(values[i] * values[j] ** power)
    unit, other, sign = _base(units[i]), _base(units[j]), "·" if power == 1 else "/"
    return Combination(
        f"{labels[i]}{sign}{labels[j]}",
        value,
        error * abs(value),
        unit if other == "1" else f"{unit}{'*' if power == 1 else '/'}({other})",
        {labels[i]: 1.0, labels[j]: float(power)},
    )
