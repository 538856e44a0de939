r"""What the data fix where they do not fix each parameter: sums of like gains, and products.

With covariance C and errors σ_i = √C_ii, the eigenvectors v of the correlation matrix whose
eigenvalues are nearly 0 are what is known far better than its members: Σ v_i θ_i/σ_i has the
variance λ ≪ 1.  Parameters that share such a vector form a group.  Of a group's like gains the
best-determined sum is told, of other pairs the product θ_i θ_j^p, p = ±1, whose variance is to
first order that of ln θ_i + p ln θ_j.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.sparse.csgraph import connected_components

_CLOSE = 0.995
_SHARE = 0.2
"""Least part that a parameter has in a group's vector, and most of its error that a product has."""
_RELATED = 0.3
_LOSS = 2.0
"""How much wider than the best a combination may be for the sake of rounder coefficients."""
_DECIMALS = 4


@dataclass(frozen=True)
class Combination:
    """A sum Σ c_i θ_i or a product Π θ_i^c_i of parameters, known better than they are.

    `text` names it; `coefficients` are the c_i by parameter, dimensionless: parameters of a sum
    have one unit.
    """

    text: str
    value: float
    standard_error: float
    unit: str
    coefficients: dict[str, float]

    @property
    def percent(self) -> float:
        """The standard error in per cent of the value."""
        return 100 * self.standard_error / abs(self.value)

    def to_dict(self) -> dict:
        """Plain data."""
        return {
            "text": self.text,
            "value": self.value,
            "standard_error": self.standard_error,
            "percent": self.percent,
            "unit": self.unit,
            "coefficients": self.coefficients,
        }


def combinations_of(
    labels: Sequence[str], values: np.ndarray, units: Sequence[str], covariance: np.ndarray
) -> tuple[Combination, ...]:
    """What is known of parameters (n,) that the data only know together."""
    found = []
    for group in _groups(covariance):
        kinds: dict[str, list[int]] = {}
        for i in group:
            kinds.setdefault(_base(units[i]), []).append(i)
        for unit, alike in kinds.items():
            if len(alike) > 1:
                inside = np.ix_(alike, alike)
                names = [labels[i] for i in alike]
                found.append(_sum(names, values[alike], unit, covariance[inside]))
        for i, j in combinations(group, 2):
            if _base(units[i]) != _base(units[j]):
                found.append(_product((i, j), labels, values, units, covariance))
    return tuple(c for c in found if c is not None)


def _base(unit: str) -> str:
    """A unit without the power of a second that an order decides: um/V*s^alpha is um/V."""
    return re.sub(r"\*s\^[^*/]+", "", unit)


def _groups(covariance: np.ndarray) -> list[list[int]]:
    """Indices of the parameters that are nearly degenerate with one another."""
    errors = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(errors, errors)
    eigenvalues, vectors = np.linalg.eigh(correlation)
    weak = np.abs(vectors[:, eigenvalues < 1 - _CLOSE]) > _SHARE
    together = (weak.astype(int) @ weak.T.astype(int) > 0) & (np.abs(correlation) > _RELATED)
    count, of = connected_components(together, directed=False)
    groups = [np.flatnonzero(of == k).tolist() for k in range(count)]
    return [group for group in groups if len(group) > 1]


def _sum(
    labels: Sequence[str], values: np.ndarray, unit: str, covariance: np.ndarray
) -> Combination | None:
    """The best-determined sum of like quantities, its coefficients as round as they may be."""
    errors = np.sqrt(np.diag(covariance))
    vectors = np.linalg.eigh(covariance / np.outer(errors, errors))[1]
    best = vectors[:, 0] / errors
    best /= best[np.argmax(np.abs(best))]

    def error(coefficients: np.ndarray) -> float:
        return float(np.sqrt(max(coefficients @ covariance @ coefficients, 0.0)))

    rounded = (np.round(best, decimals) for decimals in range(_DECIMALS))
    least = error(best)
    chosen = next((c for c in rounded if error(c) <= _LOSS * least), best)
    value = float(chosen @ values)
    # No news where a member is known as well by itself, or where the sum may be 0.
    if np.count_nonzero(chosen) < 2 or abs(value) < error(chosen):
        return None
    coefficients = {n: float(c) for n, c in zip(labels, chosen, strict=True) if c != 0}
    return Combination(_spelt(coefficients), value, error(chosen), unit, coefficients)


def _spelt(coefficients: dict[str, float]) -> str:
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
    # The one with a unit first: k_h·alpha.
    i, j = sorted(pair, key=lambda at: units[at] == "1")
    if values[i] == 0 or values[j] == 0:
        return None
    relative = covariance / np.outer(values, values)
    of_logarithm = {
        power: relative[i, i] + 2 * power * relative[i, j] + relative[j, j] for power in (1, -1)
    }
    power = min(of_logarithm, key=of_logarithm.__getitem__)
    error = float(np.sqrt(max(of_logarithm[power], 0.0)))
    if error > _SHARE * np.sqrt(min(relative[i, i], relative[j, j])):
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
