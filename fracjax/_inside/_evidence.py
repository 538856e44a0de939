"""The evidence of hypotheses about a residual: one posterior over effects and their shapes.

    log B = ½ (ν - d) log(1 + g) - ½ ν log(1 + g (1 - R²)),    g = n,   ν = n - 1

is the Bayes factor of d columns that explain the share R² of n independent samples, against none of
them, with an unknown noise level and coefficients as uncertain as one sample leaves them.  A
coloured residual holds fewer independent samples than it has.

Source: Liang, Paulo, Molina, Clyde & Berger, J. Am. Stat. Assoc. 103 (2008) 410, g priors;
Bartlett, J. R. Stat. Soc. 98 (1935) 536, correlation between series that are coloured.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.fft
from scipy.special import logsumexp

from .._solve import orthonormal_basis
from ._columns import Column, Columns

_DEPENDENT = 1e-6
"""The norm that the fit leaves of a column, over its own, below which it is part of the fit."""


class Weighed(NamedTuple):
    """One hypothesis about a residual.

    Attributes:
        name: of the effect, or of what is not inside.
        share: R² of its best shape, of what the fit leaves.
        log_evidence: log B over all its shapes.
        probability: in the posterior over all hypotheses and none.
        best: its best shape.
        coefficients: (d,) of the best shape's columns.
    """

    name: str
    share: float
    log_evidence: float
    probability: float
    best: Column
    coefficients: np.ndarray


def independent_samples(residual: np.ndarray, counted: np.ndarray) -> float:
    """How many independent samples a residual (N,) is worth, N / Σ_k ρ_k², of those counted."""
    values = residual[counted]
    n, length = values.size, scipy.fft.next_fast_len(2 * values.size)
    power = np.abs(np.asarray(scipy.fft.rfft(values - values.mean(), length))) ** 2
    products = np.asarray(scipy.fft.irfft(power, length))[:n]
    rho = products / (products[0] or 1.0)
    # Correlations of chance, of variance (n - k)/n² times the same worth, add half of it.
    worth = np.sum(rho[1:] ** 2) + 0.5
    return float(max(n / max(worth, 1.0), 2.0))


def log_bayes_factor(share: float, samples: float, columns: int) -> float:
    """log B of so many columns that explain a share of so many independent samples."""
    freedom = samples - 1
    rest = max(1.0 - share, 1e-15)
    return 0.5 * (freedom - columns) * np.log1p(samples) - 0.5 * freedom * np.log1p(samples * rest)


def weigh(columns: Columns, one_sided: frozenset[str] = frozenset()) -> list[Weighed]:
    """Every hypothesis about the residual, the most probable first.

    Effects of `one_sided` count only with the sign of their trials.
    """
    basis = orthonormal_basis(columns.tangent)

    def free(signals: np.ndarray) -> np.ndarray:
        return signals - basis @ (basis.T @ signals)

    residual = free(columns.residual)
    samples = independent_samples(residual, columns.residual != 0)
    scored = []
    for name, shapes in (columns.effects | columns.others).items():
        scores = [_explained(free(s.white), s.white, residual) for s in shapes]
        usable = [
            (share if name not in one_sided or np.all(c > 0) else 0.0, c, shape)
            for (share, c), shape in zip(scores, shapes, strict=True)
        ]
        factors = [log_bayes_factor(s, samples, shape.white.shape[1]) for s, _, shape in usable]
        share, coefficients, best = max(usable, key=lambda each: each[0])
        # One model in as many shapes: their mean.
        evidence = float(logsumexp(factors) - np.log(len(factors)))
        scored.append((name, share, evidence, best, coefficients))
    total = logsumexp([0.0, *(evidence for _, _, evidence, _, _ in scored)])
    weighed = [
        Weighed(name, float(share), evidence, float(np.exp(evidence - total)), best, coefficients)
        for name, share, evidence, best, coefficients in scored
    ]
    return sorted(weighed, key=lambda each: -each.log_evidence)


def _explained(
    columns: np.ndarray, whole: np.ndarray, residual: np.ndarray
) -> tuple[float, np.ndarray]:
    """The share of a residual (L,) that columns (L, d) explain, and their coefficients."""
    norms, before = np.linalg.norm(columns, axis=0), np.linalg.norm(whole, axis=0)
    usable = np.isfinite(norms) & (norms > _DEPENDENT * before) & (before > 0)
    coefficients = np.zeros(norms.size)
    if not usable.any():
        return 0.0, coefficients
    scaled = columns[:, usable] / norms[usable]
    solution, *_ = np.linalg.lstsq(scaled, residual, rcond=1e-9)
    coefficients[usable] = solution / norms[usable]
    rest = residual - scaled @ solution
    return 1 - float(rest @ rest) / float(residual @ residual), coefficients
