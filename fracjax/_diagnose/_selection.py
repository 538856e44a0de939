r"""Which effects: one posterior over none, shape, each effect and several of them.

Under a hypothesis the whitened residual is normal about 0 with the covariance

    κ (1 + τ² N Nᵀ + Σ_k s_k² D_k D_kᵀ)

D_k the columns of an effect's shape, s_k its size in units of the typical one, N the loop shapes
and τ their size.  τ, the shape and s_k are averaged over; κ ≥ 1, at its likeliest, is how far the
noise is exceeded by what no column follows: that misfit counts as noise.  An effect that has one
sign only is given the half of its prior.
Source: George & McCulloch, J. Am. Stat. Assoc. 88 (1993) 881 (spike and slab); Zellner (1986) for
priors that scale with the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from ._gram import Gram, Inner

TAUS = np.array([0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 0.3, 1.0])
SIZES = np.array([0.03, 0.1, 0.3, 1.0, 3.0])
_EXACT = 0.5
_EACH = 0.02
_BEAM = (1, 6, 3)
_HOPELESS = 60.0


class Kind(NamedTuple):
    """A shape of an effect: which columns are its own, and whether they have one sign only."""

    name: str
    start: int
    stop: int
    one_sided: bool
    is_shape: bool


class Hypothesis(NamedTuple):
    """Effects, the kinds they are likeliest of, with their sizes, and the shapes' τ; its
    logarithmic posterior, up to a constant, and what of it is prior: of the effects, and of the
    likeliest kind and size among all."""

    log_posterior: float
    log_prior: float
    tau: float
    names: tuple[str, ...]
    kinds: tuple[int, ...]
    sizes: tuple[float, ...]

    def columns(self, kinds: Sequence[Kind]) -> tuple[np.ndarray, np.ndarray]:
        """Its columns (k,), and the sizes of each."""
        own = [np.arange(kinds[k].start, kinds[k].stop) for k in self.kinds]
        sizes = [np.full(o.size, s) for o, s in zip(own, self.sizes, strict=True)]
        nothing = np.zeros(0)
        return np.concatenate([nothing.astype(int), *own]), np.concatenate([nothing, *sizes])


@dataclass(frozen=True)
class Posterior:
    """All hypotheses, the likeliest first."""

    hypotheses: tuple[Hypothesis, ...]

    @property
    def best(self) -> Hypothesis:
        return self.hypotheses[0]

    @cached_property
    def _weights(self) -> np.ndarray:
        logs = np.array([h.log_posterior for h in self.hypotheses])
        return np.exp(logs - logsumexp(logs))

    @cached_property
    def sets(self) -> dict[frozenset[str], float]:
        """The probability of each set of effects, whatever the loop's shape."""
        found: dict[frozenset[str], float] = {}
        for hypothesis, weight in zip(self.hypotheses, self._weights, strict=True):
            key = frozenset(hypothesis.names)
            found[key] = found.get(key, 0.0) + float(weight)
        return found

    def probability_of(self, name: str) -> float:
        """That an effect is there."""
        return sum(p for names, p in self.sets.items() if name in names)

    @property
    def nothing(self) -> float:
        """The probability that neither an effect is there nor another shape of the loop."""
        pairs = zip(self.hypotheses, self._weights, strict=True)
        return float(sum(weight for h, weight in pairs if h.tau == 0 and not h.names))

    @property
    def shape(self) -> float:
        """The probability that the loop's shape is not the model's."""
        pairs = zip(self.hypotheses, self._weights, strict=True)
        return float(sum(weight for h, weight in pairs if h.tau > 0))


def select(
    gram: Gram, kinds: Sequence[Kind], small: float, share: float = 1.0, most: int = 3
) -> Posterior:
    """The posterior over sets of up to `most` effects; `share`: how many of the samples count, the
    neighbours of a misfit being alike."""
    found: dict[tuple[float, frozenset[str]], Hypothesis] = {}
    layout, count = _Layout(kinds), gram.count * share
    inners, leading = {}, {}
    for tau in TAUS.tolist():
        inners[tau] = inner = _thinned(gram.under(tau), gram, tau, share)
        prior = float(np.log(_EXACT if tau == 0 else (1 - _EXACT) / (TAUS.size - 1)))
        likelihood = float(_log_likelihood(inner.square, inner.log_determinant, count))
        leading[tau] = [Hypothesis(prior + likelihood, prior, tau, (), (), ())]
        found[tau, frozenset()] = leading[tau][0]
    for width in _BEAM[:most]:
        best = max(h.log_posterior for h in found.values())
        for tau, inner in inners.items():
            larger: dict[frozenset[str], Hypothesis] = {}
            # The first effect is tried under every size of the shapes, which it may change.
            hopeful = [h for h in leading[tau] if not h.names or h.log_posterior > best - _HOPELESS]
            for before in hopeful[:width]:
                conditioned = inner.given(*before.columns(kinds)) if before.names else inner
                for one in layout.added(before, conditioned, count, tau <= small):
                    key = frozenset(one.names)
                    if key not in larger or larger[key].log_posterior < one.log_posterior:
                        larger[key] = one
            found |= {(tau, names): one for names, one in larger.items()}
            leading[tau] = sorted(larger.values(), key=lambda h: -h.log_posterior)
    ranked = sorted(found.values(), key=lambda h: -h.log_posterior)
    return Posterior(tuple(ranked))


def _thinned(inner: Inner, gram: Gram, tau: float, share: float) -> Inner:
    """Inner products over a share of the samples."""
    if share == 1:
        return inner
    determinant = float(np.log1p(share * tau**2 * gram.values).sum())
    return Inner(inner.columns * share, inner.along * share, inner.square * share, determinant)


def log_posterior_of(names: int, square: float, price: float, count: float) -> float:
    """That of so many effects, refitted without loop shapes to this χ², by the scale of `select`;
    `price` is what they cost by Occam's factor."""
    prior = float(np.log(_EXACT) + names * np.log(_EACH))
    return prior + float(_log_likelihood(square, price, count))


def _log_likelihood(square, log_determinant, count: float):
    """Up to a constant, the noise κ ≥ 1 times as large as it was told, whatever fits best."""
    excess = np.maximum(1.0, square / count)
    return -0.5 * (count * np.log(excess) + square / excess + log_determinant)


def occam_factor(kinds: Sequence[Kind], inner: Inner, scale: float) -> float:
    """Twice the logarithm by which the evidence of some kinds, the mean over them and their sizes,
    is below what the best of them takes from χ²; the noise is `scale` times what it was taken for.
    """
    taken, evidence = [], []
    for kind in kinds:
        own = slice(kind.start, kind.stop)
        gram, along = inner.columns[own, own] / scale, inner.along[own] / scale
        for size in SIZES:
            whole = np.eye(along.size) + size**2 * gram
            taken.append(size**2 * float(along @ np.linalg.solve(whole, along)))
            evidence.append(taken[-1] - np.linalg.slogdet(whole)[1])
    mean = logsumexp(np.array(evidence) / 2) - np.log(len(evidence))
    return max(taken) - 2 * float(mean)


class _Layout:
    """The kinds, by how many columns they have."""

    def __init__(self, kinds: Sequence[Kind]):
        self.kinds = kinds
        self.names = list(dict.fromkeys(kind.name for kind in kinds))
        widths = np.array([kind.stop - kind.start for kind in kinds])
        self.by_width = {int(w): np.flatnonzero(widths == w) for w in np.unique(widths)}
        self.of_name = {
            name: np.array([k for k, kind in enumerate(kinds) if kind.name == name])
            for name in self.names
        }
        self.one_sided = np.array([kind.one_sided for kind in kinds])

    def added(
        self, before: Hypothesis, inner: Inner, count: float, shapes: bool
    ) -> list[Hypothesis]:
        """A hypothesis with each further effect."""
        evidence = np.zeros((len(self.kinds), SIZES.size))
        for width, which in self.by_width.items():
            evidence[which] = self._evidence(which, width, inner, count)
        found = []
        prior = before.log_prior + float(np.log(_EACH))
        for name in self.names:
            own = self.of_name[name]
            if name in before.names or (self.kinds[own[0]].is_shape and not shapes):
                continue
            values = evidence[own]
            k, s = np.unravel_index(np.argmax(values), values.shape)
            average = float(logsumexp(values) - np.log(values.size))
            found.append(
                Hypothesis(
                    prior + average,
                    prior + average - float(values[k, s]),
                    before.tau,
                    (*before.names, name),
                    (*before.kinds, int(own[k])),
                    (*before.sizes, float(SIZES[s])),
                )
            )
        return found

    def _evidence(self, which: np.ndarray, width: int, inner: Inner, count: float) -> np.ndarray:
        """Log likelihoods (kinds, sizes) of the kinds `which` of so many columns."""
        starts = np.array([self.kinds[k].start for k in which])
        at = starts[:, None] + np.arange(width)
        values, turned = np.linalg.eigh(inner.columns[at[:, :, None], at[:, None, :]])
        values = np.maximum(values, 0.0)[:, None, :]
        along = np.einsum("kij,ki->kj", turned, inner.along[at])[:, None, :]
        variance = SIZES[None, :, None] ** 2
        taken = (along**2 * variance / (1 + variance * values)).sum(axis=2)
        determinant = np.log1p(variance * values).sum(axis=2)
        square = inner.square - taken
        likelihood = _log_likelihood(square, inner.log_determinant + determinant, count)
        if width == 1:
            score = along[:, :, 0] * np.sqrt(variance / (1 + variance * values))[:, :, 0]
            score = score / np.sqrt(np.maximum(1.0, square / count))
            halved = np.log(2) + norm.logcdf(score)
            likelihood = likelihood + np.where(self.one_sided[which, None], halved, 0.0)
        return likelihood
