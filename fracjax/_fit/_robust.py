r"""Robust losses by iteratively reweighted least squares.

Minimised is Σ 2 s² ρ(e_i/s) over the whitened residual e, s its robust scale, by least squares with
the weights w(z) = ρ'(z)/z of the fit before:

    huber      2ρ = z² up to 1.345, 2·1.345 |z| - 1.345² beyond     w = min(1, 1.345/|z|)
    soft_l1    2ρ = 2 c² (√(1 + z²/c²) - 1), c = 1.345              w = 1/√(1 + z²/c²)
    student_t  2ρ = 5 ln(1 + z²/4), four degrees of freedom         w = 5/(4 + z²)

Standard errors of such an estimate are those of least squares times
s √(mean ψ²)/mean ψ', ψ(z) = z w(z): what the outliers themselves are worth no longer counts.
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
_C = 1.345  # 95 % efficient in normal noise
_FREEDOM = 4.0
_NORMAL = 0.6745  # of a standard normal number's size the median
ROUNDS = 50
SETTLED = 1e-6


class Shape(NamedTuple):
    """A loss at z ≥ 0: 2ρ(z), the weight ψ(z)/z, and ψ'(z)."""

    twice: Callable[[np.ndarray], np.ndarray]
    weight: Callable[[np.ndarray], np.ndarray]
    slope: Callable[[np.ndarray], np.ndarray]


_SHAPES = {
    "huber": Shape(
        lambda z: np.where(z <= _C, z**2, 2 * _C * z - _C**2),
        lambda z: _C / np.maximum(z, _C),
        lambda z: (z <= _C).astype(float),
    ),
    "soft_l1": Shape(
        lambda z: 2 * _C**2 * (np.sqrt(1 + (z / _C) ** 2) - 1),
        lambda z: 1 / np.sqrt(1 + (z / _C) ** 2),
        lambda z: (1 + (z / _C) ** 2) ** -1.5,
    ),
    "student_t": Shape(
        lambda z: (_FREEDOM + 1) * np.log1p(z**2 / _FREEDOM),
        lambda z: (_FREEDOM + 1) / (_FREEDOM + z**2),
        lambda z: (_FREEDOM + 1) * (_FREEDOM - z**2) / (_FREEDOM + z**2) ** 2,
    ),
}


def shape_of(loss: str) -> Shape | None:
    """The shape of a loss, None of least squares.  Raises InputError for names unknown."""
    if loss not in LOSSES:
        raise InputError.at("loss", f"one of {', '.join(LOSSES)}", f'"{loss}"', "correct it")
    return _SHAPES.get(loss)


@dataclass(frozen=True)
class Robust:
    """How a robust loss weighed the samples.

    `scale`: the whitened residual's, in units of the noise; `weights` (N,) per recording, 1 where
    the residual is 0; `downweighted`: the share of samples with a weight below 1/2; `rounds`: fits
    that it took.
    """

    loss: str
    scale: float
    weights: tuple[np.ndarray, ...]
    downweighted: float
    rounds: int

    def to_dict(self) -> dict:
        """Plain data."""
        return {"name": self.loss, "scale": self.scale, "downweighted": self.downweighted,
                "rounds": self.rounds}  # fmt: skip


class Weighed(NamedTuple):
    """A residual seen through a loss: its cost Σ 2s²ρ, weights (L,) per recording, the residuals
    with those weights, and the ratio of errors to those of least squares in unit noise."""

    scale: float
    cost: float
    weights: list[np.ndarray]
    bounded: list[np.ndarray]
    inflation: float
    downweighted: float


def weigh(shape: Shape, residuals: Sequence[np.ndarray], counted: Sequence[np.ndarray]) -> Weighed:
    """Whitened residuals (L,) per recording, where `counted` (L,), through a loss."""
    used = np.concatenate([r[c] for r, c in zip(residuals, counted, strict=True)])
    scale = float(np.median(np.abs(used)) / _NORMAL) + 1e-300
    z = np.abs(used) / scale
    weight = shape.weight(z)
    weights = [shape.weight(np.abs(r) / scale) for r in residuals]
    return Weighed(
        scale=scale,
        cost=float(scale**2 * np.sum(shape.twice(z))),
        weights=weights,
        bounded=[w * r for w, r in zip(weights, residuals, strict=True)],
        inflation=float(scale * np.sqrt(np.mean((z * weight) ** 2)) / np.mean(shape.slope(z))),
        downweighted=float(np.mean(weight < 0.5 * shape.weight(np.zeros(1))[0])),
    )


def reweighted(solved: Solved, loss: Loss) -> tuple[Solved, Robust, float]:
    """The optimum of a robust loss, from that of least squares; what it made of the samples, and
    the inflation of its standard errors.  Its cost Σ 2s²ρ takes the place of χ²."""
    shape = shape_of(loss)
    assert shape is not None  # of least squares nothing is to be done
    preparation = solved.preparation
    counted = [np.asarray(p.weights) > 0 for p in preparation.problems()]
    sizes = [len(take.recording) for take in preparation.takes]
    roots = [np.ones(len(c)) for c in counted]
    cost, rounds = np.inf, 0
    while True:
        plain = [r / root for r, root in zip(solved.whitened, roots, strict=True)]
        seen = weigh(shape, plain, counted)
        settled = abs(cost - seen.cost) <= SETTLED * seen.cost
        if settled or rounds == ROUNDS:
            break
        cost, roots, rounds = seen.cost, [np.sqrt(w) for w in seen.weights], rounds + 1
        trust = [w[:size] for w, size in zip(seen.weights, sizes, strict=True)]
        solved = solve_from([solved.block], preparation.with_trust(trust))
    one = shape.weight(np.zeros(1))[0]
    weights = tuple(w[:size] / one for w, size in zip(seen.weights, sizes, strict=True))
    robust = Robust(loss, seen.scale, weights, seen.downweighted, rounds)
    found = replace(
        solved.on(preparation),
        cost=seen.cost,
        whitened=tuple(seen.bounded),
        converged=solved.converged and settled,
    )
    return found, robust, seen.inflation
