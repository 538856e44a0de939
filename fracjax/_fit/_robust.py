"""Robust losses by iteratively reweighted least squares.

The fit minimises Σ 2 s² ρ(e_i/s) over the whitened residual e, with s its robust scale, by least
squares with the weights w(z) = ρ'(z)/z of the previous fit:

    huber      2ρ = z² up to 1.345, 2·1.345 |z| - 1.345² beyond     w = min(1, 1.345/|z|)
    soft_l1    2ρ = 2 c² (√(1 + z²/c²) - 1), c = 1.345              w = 1/√(1 + z²/c²)
    student_t  2ρ = 5 ln(1 + z²/4), four degrees of freedom         w = 5/(4 + z²)

Standard errors of such an estimate are those of least squares times

    s √(mean ψ²)/mean ψ',      ψ(z) = z w(z)

so that the outliers themselves do not widen them.

Sources: Huber, Robust Statistics (1981) chapter 7; Lange, Little & Taylor, J. Am. Stat. Assoc. 84
    (1989) 881; Holland & Welsch, Commun. Stat. A 6 (1977) 813.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np

from .._recording import InputError
from .._solve import Solved, solve_from

Loss = Literal["least_squares", "huber", "soft_l1", "student_t"]
LOSSES: tuple[Loss, ...] = get_args(Loss)
_CORNER = 1.345
"""z at which a loss changes from quadratic to linear: 95 % efficient in normal noise."""
_DEGREES_OF_FREEDOM = 4.0
"""Of Student's distribution; the value of Lange, Little & Taylor."""
_NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a standard normal variable."""
_MOST_ROUNDS = 50
"""Most reweighted fits.  Chosen by judgement."""
_CONVERGED = 1e-6
"""Relative change of the cost at which reweighting ends."""


class Shape(NamedTuple):
    """A loss as functions of z ≥ 0, the whitened residual over its scale, dimensionless.

    Attributes:
        twice: 2ρ(z).
        weight: ψ(z)/z.
        slope: ψ'(z).
    """

    twice: Callable[[np.ndarray], np.ndarray]
    weight: Callable[[np.ndarray], np.ndarray]
    slope: Callable[[np.ndarray], np.ndarray]


_SHAPES = {
    "huber": Shape(
        lambda z: np.where(z <= _CORNER, z**2, 2 * _CORNER * z - _CORNER**2),
        lambda z: _CORNER / np.maximum(z, _CORNER),
        lambda z: (z <= _CORNER).astype(float),
    ),
    "soft_l1": Shape(
        lambda z: 2 * _CORNER**2 * (np.sqrt(1 + (z / _CORNER) ** 2) - 1),
        lambda z: 1 / np.sqrt(1 + (z / _CORNER) ** 2),
        lambda z: (1 + (z / _CORNER) ** 2) ** -1.5,
    ),
    "student_t": Shape(
        lambda z: (_DEGREES_OF_FREEDOM + 1) * np.log1p(z**2 / _DEGREES_OF_FREEDOM),
        lambda z: (_DEGREES_OF_FREEDOM + 1) / (_DEGREES_OF_FREEDOM + z**2),
        lambda z: (
            (_DEGREES_OF_FREEDOM + 1)
            * (_DEGREES_OF_FREEDOM - z**2)
            / (_DEGREES_OF_FREEDOM + z**2) ** 2
        ),
    ),
}


def shape_of(loss: str) -> Shape | None:
    """The functions of a loss, None for least squares.  Raises InputError for an unknown name."""
    if loss not in LOSSES:
        raise InputError.at("loss", f"one of {', '.join(LOSSES)}", f'"{loss}"', "correct it")
    return _SHAPES.get(loss)


@dataclass(frozen=True)
class Robust:
    """How a robust loss weighted the samples.

    Attributes:
        loss: the loss's name.
        scale: the whitened residual's robust scale, in units of the noise.
        weights: per recording (N,) of the squared residuals, 1 where the residual is 0.
        downweighted: the share of samples with a weight below 1/2.
        rounds: the number of reweighted fits.
    """

    loss: str
    scale: float
    weights: tuple[np.ndarray, ...]
    downweighted: float
    rounds: int

    def to_dict(self) -> dict:
        """The summary as plain data.

        Returns:
            Name of the loss, scale, share of samples downweighted and rounds.
        """
        return {"name": self.loss, "scale": self.scale, "downweighted": self.downweighted,
                "rounds": self.rounds}  # fmt: skip


class WeightedResidual(NamedTuple):
    """A residual under a robust loss.

    Attributes:
        scale: the residual's robust scale, in units of the noise.
        cost: Σ 2s²ρ.
        weights: per recording (L,).
        bounded: per recording (L,) the residuals times their weights.
        inflation: the ratio of standard errors to those of least squares in noise of unit variance.
        downweighted: the share of samples with a weight below half the largest.
    """

    scale: float
    cost: float
    weights: list[np.ndarray]
    bounded: list[np.ndarray]
    inflation: float
    downweighted: float


def weigh(
    shape: Shape, residuals: Sequence[np.ndarray], counted: Sequence[np.ndarray]
) -> WeightedResidual:
    """The counted samples of whitened residuals (L,) per recording under a loss."""
    used = np.concatenate([r[c] for r, c in zip(residuals, counted, strict=True)])
    scale = float(np.median(np.abs(used)) / _NORMAL_MEDIAN) + 1e-300
    z = np.abs(used) / scale
    weight = shape.weight(z)
    weights = [shape.weight(np.abs(r) / scale) for r in residuals]
    return WeightedResidual(
        scale=scale,
        cost=float(scale**2 * np.sum(shape.twice(z))),
        weights=weights,
        bounded=[w * r for w, r in zip(weights, residuals, strict=True)],
        inflation=float(scale * np.sqrt(np.mean((z * weight) ** 2)) / np.mean(shape.slope(z))),
        downweighted=float(np.mean(weight < 0.5 * shape.weight(np.zeros(1))[0])),
    )


def reweight(solved: Solved, loss: Loss) -> tuple[Solved, Robust, float]:
    """The optimum of a robust loss, starting from that of least squares.

    Returned are the fit, whose cost Σ 2s²ρ replaces χ², how the loss weighted the samples, and the
    inflation of the standard errors.
    """
    shape = shape_of(loss)
    assert shape is not None  # fit_of calls it for robust losses only
    preparation = solved.preparation
    counted = [np.asarray(p.weights) > 0 for p in preparation.problems()]
    sizes = [len(take.recording) for take in preparation.takes]
    roots = [np.ones(len(c)) for c in counted]
    cost, rounds = np.inf, 0
    while True:
        plain = [r / root for r, root in zip(solved.whitened, roots, strict=True)]
        weighted = weigh(shape, plain, counted)
        converged = abs(cost - weighted.cost) <= _CONVERGED * weighted.cost
        if converged or rounds == _MOST_ROUNDS:
            break
        cost, roots, rounds = weighted.cost, [np.sqrt(w) for w in weighted.weights], rounds + 1
        trust = [w[:size] for w, size in zip(weighted.weights, sizes, strict=True)]
        solved = solve_from([solved.block], preparation.with_trust(trust))
    largest_weight = shape.weight(np.zeros(1))[0]
    weights = tuple(
        w[:size] / largest_weight for w, size in zip(weighted.weights, sizes, strict=True)
    )
    robust = Robust(loss, weighted.scale, weights, weighted.downweighted, rounds)
    result = replace(
        solved.on(preparation),
        cost=weighted.cost,
        whitened=tuple(weighted.bounded),
        converged=solved.converged and converged,
    )
    return result, robust, weighted.inflation
