r"""Which effects: one posterior over sets of effects, with and without another loop shape.

Under a hypothesis the whitened residual is normal about 0 with the covariance

    κ (1 + τ² N Nᵀ + Σ_k s_k² D_k D_kᵀ)

with D_k the columns of an effect's kind, s_k its size over the typical one, N the loop shapes and τ
their size.  The posterior averages over τ, the kind and s_k; κ ≥ 1, at its most likely value, is
the misfit that no column explains, which counts as noise.  An effect that has only one sign has a
half-normal prior.
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

# Priors and widths are chosen by judgement.
TAUS = np.array([0.0, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 0.3, 1.0])
"""Sizes τ of loop shapes, over the response's span; 0 is the model's own shape."""
SIZES = np.array([0.03, 0.1, 0.3, 1.0, 3.0])
"""Sizes of an effect, over the typical one."""
_EXACT = 0.5
"""Prior probability that the loop has the model's shape."""
_EACH = 0.02
"""Prior odds of each effect."""
_BEAM = (1, 6, 3)
"""Hypotheses of no, one and two effects that are extended by a further one, for each τ."""
_HOPELESS = 60.0
"""Logarithm of the odds against a hypothesis from which it is not extended."""


class Kind(NamedTuple):
    """One kind of an effect: its columns, whether they have only one sign, and whether it is
    rate-independent, as loop shapes are."""

    name: str
    start: int
    stop: int
    one_sided: bool
    is_shape: bool


class Hypothesis(NamedTuple):
    """Effects, their most likely kinds and sizes, and the loop shapes' τ.

    `log_posterior` is up to a constant; `log_prior` is the part of it that is not the likelihood of
    these kinds and sizes.
    """

    log_posterior: float
    log_prior: float
    tau: float
    names: tuple[str, ...]
    kinds: tuple[int, ...]
    sizes: tuple[float, ...]

    def columns(self, kinds: Sequence[Kind]) -> tuple[np.ndarray, np.ndarray]:
        """The indices of its columns (k,), and the size of each."""
        own = [np.arange(kinds[k].start, kinds[k].stop) for k in self.kinds]
        sizes = [np.full(o.size, s) for o, s in zip(own, self.sizes, strict=True)]
        nothing = np.zeros(0)
        return np.concatenate([nothing.astype(int), *own]), np.concatenate([nothing, *sizes])


@dataclass(frozen=True)
class Posterior:
    """All hypotheses, the most likely first."""

    hypotheses: tuple[Hypothesis, ...]

    @property
    def best(self) -> Hypothesis:
        """The most likely hypothesis."""
        return self.hypotheses[0]

    @cached_property
    def _weights(self) -> np.ndarray:
        """The probability of each hypothesis."""
        logs = np.array([h.log_posterior for h in self.hypotheses])
        return np.exp(logs - logsumexp(logs))

    @cached_property
    def sets(self) -> dict[frozenset[str], float]:
        """The probability of each set of effects, summed over loop shapes."""
        sets: dict[frozenset[str], float] = {}
        for hypothesis, weight in zip(self.hypotheses, self._weights, strict=True):
            key = frozenset(hypothesis.names)
            sets[key] = sets.get(key, 0.0) + float(weight)
        return sets

    def probability_of(self, name: str) -> float:
        """The probability that an effect is present."""
        return sum(p for names, p in self.sets.items() if name in names)

    @property
    def nothing(self) -> float:
        """The probability that no effect is present and the loop has the model's shape."""
        pairs = zip(self.hypotheses, self._weights, strict=True)
        return float(sum(weight for h, weight in pairs if h.tau == 0 and not h.names))

    @property
    def shape(self) -> float:
        """The probability that the loop has another shape than the model's."""
        pairs = zip(self.hypotheses, self._weights, strict=True)
        return float(sum(weight for h, weight in pairs if h.tau > 0))


def select(gram: Gram, kinds: Sequence[Kind], small: float, share: float = 1.0) -> Posterior:
    """The posterior over sets of up to three effects, by a beam search.

    Rate-independent effects are only combined with loop shapes up to `small`.  `share` of the
    samples count as independent.
    """
    hypotheses: dict[tuple[float, frozenset[str]], Hypothesis] = {}
    layout, count = _Layout(kinds), gram.count * share
    inners, leading = {}, {}
    for tau in TAUS.tolist():
        inners[tau] = inner = _thinned(gram.under(tau), gram, tau, share)
        prior = float(np.log(_EXACT if tau == 0 else (1 - _EXACT) / (TAUS.size - 1)))
        likelihood = float(_log_likelihood(inner.square, inner.log_determinant, count))
        leading[tau] = [Hypothesis(prior + likelihood, prior, tau, (), (), ())]
        hypotheses[tau, frozenset()] = leading[tau][0]
    for width in _BEAM:
        best = max(h.log_posterior for h in hypotheses.values())
        for tau, inner in inners.items():
            larger: dict[frozenset[str], Hypothesis] = {}
            # The first effect is tried with every τ, since it may change the likely one.
            hopeful = [h for h in leading[tau] if not h.names or h.log_posterior > best - _HOPELESS]
            for before in hopeful[:width]:
                conditioned = inner.given(*before.columns(kinds)) if before.names else inner
                for one in layout.added(before, conditioned, count, tau <= small):
                    key = frozenset(one.names)
                    if key not in larger or larger[key].log_posterior < one.log_posterior:
                        larger[key] = one
            hypotheses |= {(tau, names): one for names, one in larger.items()}
            leading[tau] = sorted(larger.values(), key=lambda h: -h.log_posterior)
    ranked = sorted(hypotheses.values(), key=lambda h: -h.log_posterior)
    return Posterior(tuple(ranked))


def _thinned(inner: Inner, gram: Gram, tau: float, share: float) -> Inner:
    """Inner products if a share of the samples counts as independent."""
    if share == 1:
        return inner
    determinant = float(np.log1p(share * tau**2 * gram.values).sum())
    return Inner(inner.columns * share, inner.along * share, inner.square * share, determinant)


def log_posterior_of(names: int, square: float, price: float, count: float) -> float:
    """The log posterior of a number of effects after a refit without loop shapes, on the scale of
    `select`, from χ² (`square`) and Occam's factor (`price`)."""
    prior = float(np.log(_EXACT) + names * np.log(_EACH))
    return prior + float(_log_likelihood(square, price, count))


def _log_likelihood(square, log_determinant, count: float):
    """The log likelihood up to a constant, with κ ≥ 1 at its most likely value."""
    excess = np.maximum(1.0, square / count)
    return -0.5 * (count * np.log(excess) + square / excess + log_determinant)


def occam_factor(kinds: Sequence[Kind], inner: Inner, scale: float) -> float:
    """The largest reduction of χ² by one of some kinds, minus twice the log of the evidence, the
    mean over kinds and sizes; the noise variance is `scale` times the measured one."""
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
    """The kinds, by effect and by their number of columns."""

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
        """The hypothesis with each further effect; rate-independent ones only with `shapes`."""
        evidence = np.zeros((len(self.kinds), SIZES.size))
        for width, which in self.by_width.items():
            evidence[which] = self._evidence(which, width, inner, count)
        larger = []
        prior = before.log_prior + float(np.log(_EACH))
        for name in self.names:
            own = self.of_name[name]
            if name in before.names or (self.kinds[own[0]].is_shape and not shapes):
                continue
            values = evidence[own]
            k, s = np.unravel_index(np.argmax(values), values.shape)
            average = float(logsumexp(values) - np.log(values.size))
            larger.append(
                Hypothesis(
                    prior + average,
                    prior + average - float(values[k, s]),
                    before.tau,
                    (*before.names, name),
                    (*before.kinds, int(own[k])),
                    (*before.sizes, float(SIZES[s])),
                )
            )
        return larger

    def _evidence(self, which: np.ndarray, width: int, inner: Inner, count: float) -> np.ndarray:
        """Log likelihoods (kinds, sizes) of the kinds `which`, of `width` columns each."""
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
