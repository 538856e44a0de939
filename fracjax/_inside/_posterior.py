r"""Which effects inside a machine: one posterior over sets, to first order and after refits.

The whitened residual of a fit is normal about what its tangent absorbs, with the covariance

    σ² (1 + N_τ N_τᵀ + Σ_k s_k² D_k D_kᵀ)

with D_k the columns of one shape of an effect and N_τ what is no effect inside: static curves
before and after the machine and further linear dynamics, of a size τ over the response, 0 among
them.  σ² is the noise's variance or, above it, what the best fit leaves.  What is above the noise
is misfit, which is as large along a few tens of directions as along any other: n samples of which
m of the variance is misfit are worth n / (1 + (υ + m / DIRECTIONS) n), with υ what is never known.

Source: as in `fracjax/_path/_posterior.py`, whose search this is; Schwarz, Ann. Stat. 6 (1978) 461,
for the freedom of refitted parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from .._path import (
    DIRECTIONS,
    EACH,
    UNKNOWN,
    Hypothesis,
    Inner,
    Kind,
    Law,
    Posterior,
    log_likelihood,
    search,
)
from .._solve import orthonormal_basis
from ._columns import Column, Columns

SIZES = (0.0, 0.003, 0.03, 0.3)
"""Sizes τ of what is no effect inside, over the response's norm: those of fading memory."""


class Worth(NamedTuple):
    """What a residual is judged by.

    Attributes:
        variance: σ² over that of the whitened noise.
        samples: how many independent ones it is worth.
    """

    variance: float
    samples: float

    @classmethod
    def of(cls, least: float, samples: int, *, specified: bool) -> Worth:
        """From χ² of the best description, and whether the noise's level is specified."""
        variance = max(least / samples, 1.0) if specified else least / samples
        misfit = 1 - 1 / variance if specified else 1.0
        return cls(variance, samples / (1 + (UNKNOWN + misfit / DIRECTIONS) * samples))


@dataclass(frozen=True, eq=False)
class About:
    """Inner products about a fit, of what its tangent leaves.

    Attributes:
        inner: of the columns that are no effects, then of the effects'.
        others: (q,) to which of what is no effect each of the first belongs.
        kinds: of the effects' columns.
        shapes: the effects' shapes, one for each kind.
        samples: how many count.
        freedom: how many directions the tangent has.
    """

    inner: Inner
    others: tuple[str, ...]
    kinds: tuple[Kind, ...]
    shapes: tuple[Column, ...]
    samples: int
    freedom: int

    @classmethod
    def of(cls, columns: Columns, one_sided: frozenset[str]) -> About:
        """From the columns about a fit."""
        basis = orthonormal_basis(columns.tangent)

        def free(signals: np.ndarray) -> np.ndarray:
            return signals - basis @ (basis.T @ signals)

        others, parts = [], []
        for name, shapes in columns.others.items():
            for shape in shapes:
                parts.append(columns.size * shape.white / _norms(shape.white))
                others += [name] * shape.white.shape[1]
        kinds, owners, at = [], [], len(others)
        for name, shapes in columns.effects.items():
            for shape in shapes:
                width = shape.white.shape[1]
                kinds.append(Kind(name, at, at + width, name in one_sided))
                owners.append(shape)
                parts.append(np.nan_to_num(shape.white))
                at += width
        signals = free(np.column_stack([*parts, columns.residual]))
        gram = signals.T @ signals
        inner = Inner(gram[:-1, :-1], gram[:-1, -1], float(gram[-1, -1]), 0.0)
        samples = int(np.count_nonzero(columns.residual))
        return cls(inner, tuple(others), tuple(kinds), tuple(owners), samples, basis.shape[1])

    def _laws(self, worth: Worth) -> list[Law]:
        """The hypotheses about what is no effect inside."""
        scale = worth.samples / self.samples / worth.variance
        inner = Inner(
            self.inner.columns * scale, self.inner.along * scale, self.inner.square * scale, 0.0
        )
        every = np.arange(len(self.others))
        return [
            Law(
                str(size), self.kinds,
                inner.given(every, np.full(every.size, size)) if size else inner,
                worth.samples, 0.0, {},
            )
            for size in SIZES
        ]  # fmt: skip

    def posterior(self, worth: Worth) -> Posterior:
        """The posterior over sets of up to three effects beside the fit, to first order."""
        return Posterior.of([h for law in self._laws(worth) for h in search(law, 0.0).hypotheses])

    def evidence(self, worth: Worth, effects: int) -> tuple[float, float]:
        """The logarithm of a fit's posterior with so many effects, up to a constant, and the size
        of what is no effect beside it."""
        laws = self._laws(worth)
        values = [
            float(log_likelihood(law.inner.square, law.inner.log_determinant, worth.samples))
            for law in laws
        ]
        freedom = 0.5 * self.freedom * np.log1p(worth.samples)
        total = float(logsumexp(values) - np.log(len(values)) - freedom + effects * np.log(EACH))
        return total, SIZES[int(np.argmax(values))]

    def coefficients(self, hypothesis: Hypothesis, worth: Worth) -> list[np.ndarray]:
        """The most probable coefficients of each of a hypothesis' shapes."""
        law = next(law for law in self._laws(worth) if law.name == hypothesis.law)
        chosen, sizes = hypothesis.columns(self.kinds)
        own = law.inner.columns[chosen][:, chosen]
        solution = np.linalg.solve(np.diag(sizes**-2.0) + own, law.inner.along[chosen])
        widths = [self.kinds[k].stop - self.kinds[k].start for k in hypothesis.kinds]
        return np.split(solution, np.cumsum(widths)[:-1])

    def remainder(self, hypothesis: Hypothesis, worth: Worth) -> float:
        """χ² after the effects of a hypothesis, to first order."""
        law = next(law for law in self._laws(worth) if law.name == hypothesis.law)
        chosen, sizes = hypothesis.columns(self.kinds)
        inner = law.inner.given(chosen, sizes) if chosen.size else law.inner
        return inner.square * worth.variance * self.samples / worth.samples

    def outside(self, worth: Worth) -> str:
        """Which of what is no effect inside explains most of the residual alone."""
        names = np.array(self.others)
        chi_squares = {}
        for name in dict.fromkeys(self.others):
            own = np.flatnonzero(names == name)
            taken = self.inner.given(own, np.full(own.size, SIZES[-1]))
            chi_squares[name] = taken.square / worth.variance + taken.log_determinant
        return min(chi_squares, key=lambda name: chi_squares[name])


def _norms(columns: np.ndarray) -> np.ndarray:
    """The norms (d,) of columns (L, d), 1 for one that is 0."""
    norms = np.linalg.norm(columns, axis=0)
    return np.where(norms > 0, norms, 1.0)
