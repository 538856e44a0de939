r"""The evidence for an effect: what it gains in BIC, and what its numbers cost by Laplace's
evidence, as far as the data know them; and how far its gains lie beyond their usual ranges.

    2 ln Z = -χ² - ln det(1 + S F S) + const,     F = Dᵀ(1 - QQᵀ)D

D (L, k) the derivatives of the whitened response by the effect's own numbers, Q an orthonormal
basis of those by all others, S the sd that was expected of each number.  BIC's k ln n is what this
tends to where the data know every number well.  Of an effect near the noise they do not: numbers
that change nothing cost nothing, and a law is not excluded for having them.  Where no size was
expected of a number its own is taken, and what the noise makes of that is counted against it: 1,
the expectation of χ².
Source: MacKay, Neural Computation 4 (1992) 415 (Occam factor); Kass & Raftery, J. Am. Stat. Assoc.
90 (1995) 773.
"""

from __future__ import annotations

import numpy as np

from .._parameters import Parameter
from .._solve import Solved
from ._stage import Layer


def delta_bic(before: Solved, after: Solved) -> float:
    """What the later fit gains in BIC, χ² in units of what it leaves, where that exceeds the noise:
    a number costs no less for all that is left unexplained."""
    numbers = after.free - before.free
    return (before.cost - after.cost) / after.excess_ratio - numbers * float(np.log(after.samples))


def spared(solved: Solved, layer: Layer) -> float:
    """How much less than BIC's k ln n the outermost effect's own numbers cost, where what is left
    unexplained counts as noise."""
    parameters, known = layer.own(solved.block), solved.sensitivity()
    derivative = known.whitened
    own = np.flatnonzero([number.name in parameters for number in known.parameters])
    expected = {name: np.ravel(_expected(p)) for name, p in parameters.items()}
    sizes = [expected[known.parameters[k].name][known.parameters[k].component] for k in own]
    others = np.delete(derivative, own, axis=1)
    basis = np.linalg.qr(others / (np.linalg.norm(others, axis=0) + 1e-300))[0]
    moved = derivative[:, own] * sizes
    beside = np.nan_to_num(moved - basis @ (basis.T @ moved))
    cost = np.linalg.slogdet(np.eye(own.size) + beside.T @ beside / solved.excess_ratio)[1]
    read_off = sum(int(np.sum(~np.isfinite(p.expected_sd))) for p in parameters.values())
    return float(own.size * np.log(solved.samples) - cost - read_off)


def strain(solved: Solved, layer: Layer) -> float:
    """What χ² would rise by, were that gain of the outermost effect held at the end of its usual
    range which lies furthest beyond it: the square of how many standard errors it does."""
    parameters = layer.own(solved.block)
    shapes = layer.own_shapes(solved.block)
    beyond = {
        name: np.ravel(p.value - np.clip(p.value, *p.plausible))
        for name, p in parameters.items()
        if name not in shapes and not p.is_plausible
    }
    if not beyond:
        return 0.0
    known, rises = solved.sensitivity(), []
    scaled = known.whitened / (np.linalg.norm(known.whitened, axis=0) + 1e-300)
    for k, number in enumerate(known.parameters):
        if number.name in beyond:
            basis = np.linalg.qr(np.delete(scaled, k, axis=1))[0]
            moved = beyond[number.name][number.component] * known.whitened[:, k]
            rises.append(float(np.sum((moved - basis @ (basis.T @ moved)) ** 2)))
    return max(rises)


def _expected(parameter: Parameter) -> np.ndarray:
    """The sd that was expected of a number; where none was, its own size."""
    sd = parameter.expected_sd
    return np.where(np.isfinite(sd), sd, np.abs(parameter.value))
