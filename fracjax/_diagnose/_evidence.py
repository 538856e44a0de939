r"""The evidence for an effect: its gain in BIC, the cost of its parameters by Laplace's evidence,
and how far its gains lie outside their usual ranges.

    2 ln Z = -χ² - ln det(1 + S F S) + const,     F = Dᵀ(1 - QQᵀ)D

D (L, k) are the derivatives of the whitened response with respect to the effect's own parameters, Q
is an orthonormal basis of those with respect to all others, and S holds the expected standard
deviation of each parameter.  If the data determine every parameter well, the cost tends to BIC's
k ln n.  For an effect near the noise they do not: parameters without influence cost nothing, and a
model is not excluded for having them.  If a parameter has no expected standard deviation, its own
size is used instead, and the expected contribution of noise to it is added to the cost: 1, the
expectation of χ².
Source: MacKay, Neural Computation 4 (1992) 415 (Occam factor); Kass & Raftery, J. Am. Stat. Assoc.
90 (1995) 773.
"""

from __future__ import annotations

import numpy as np

from .._parameters import Parameter
from .._solve import Solved
from ._stage import Layer


def delta_bic(before: Solved, after: Solved) -> float:
    """The gain in BIC of the later fit, with χ² divided by that fit's own excess over the noise, so
    that an unexplained residual does not make parameters cheaper."""
    parameters = after.free - before.free
    return (before.cost - after.cost) / after.excess_ratio - parameters * float(
        np.log(after.samples)
    )


def spared(solved: Solved, layer: Layer) -> float:
    """BIC's cost k ln n of the outermost effect's own parameters minus their cost by Laplace's
    evidence, with the unexplained residual counted as noise."""
    parameters, sensitivity = layer.own(solved.block), solved.sensitivity()
    derivative = sensitivity.whitened
    own = np.flatnonzero([number.name in parameters for number in sensitivity.parameters])
    expected = {name: np.ravel(_expected(p)) for name, p in parameters.items()}
    sizes = [
        expected[sensitivity.parameters[k].name][sensitivity.parameters[k].component] for k in own
    ]
    others = np.delete(derivative, own, axis=1)
    basis = np.linalg.qr(others / (np.linalg.norm(others, axis=0) + 1e-300))[0]
    scaled = derivative[:, own] * sizes
    independent = np.nan_to_num(scaled - basis @ (basis.T @ scaled))
    cost = np.linalg.slogdet(np.eye(own.size) + independent.T @ independent / solved.excess_ratio)[
        1
    ]
    unexpected = sum(int(np.sum(~np.isfinite(p.expected_sd))) for p in parameters.values())
    return float(own.size * np.log(solved.samples) - cost - unexpected)


def strain(solved: Solved, layer: Layer) -> float:
    """The rise of χ² if a gain of the outermost effect were fixed at the end of its usual range, to
    first order, for the gain with the largest rise: the square of its distance from there in
    standard errors."""
    parameters = layer.own(solved.block)
    shapes = layer.own_shapes(solved.block)
    beyond = {
        name: np.ravel(p.value - np.clip(p.value, *p.plausible))
        for name, p in parameters.items()
        if name not in shapes and not p.is_plausible
    }
    if not beyond:
        return 0.0
    sensitivity, rises = solved.sensitivity(), []
    columns = sensitivity.whitened
    scaled = columns / (np.linalg.norm(columns, axis=0) + 1e-300)
    for k, number in enumerate(sensitivity.parameters):
        if number.name in beyond:
            basis = np.linalg.qr(np.delete(scaled, k, axis=1))[0]
            change = beyond[number.name][number.component] * columns[:, k]
            rises.append(float(np.sum((change - basis @ (basis.T @ change)) ** 2)))
    return max(rises)


def _expected(parameter: Parameter) -> np.ndarray:
    """A parameter's expected standard deviation, or its own size if it has none, in its unit."""
    sd = parameter.expected_sd
    return np.where(np.isfinite(sd), sd, np.abs(parameter.value))
