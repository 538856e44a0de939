r"""Which effects: one posterior over sets of effects, under every law.

Under a law the whitened response is normal with the covariance

    κ (C + Σ_k s_k² D_k D_kᵀ)

with C that of the law, D_k the columns of one shape of an effect and s_k its size over the typical
one.  The posterior averages over shapes and sizes; κ ≥ 1, at its most likely value, is the misfit
that no column explains, which counts as noise.  An effect that has only one sign has a half-normal
prior.

Source: George & McCulloch, J. Am. Stat. Assoc. 88 (1993) 881 (spike and slab); Zellner (1986) for
priors that scale with the noise.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr, logsumexp

from ._prior import Inner, log_likelihood

SIZES = np.array([0.03, 0.1, 0.3, 1.0, 3.0])
"""Sizes of an effect, over the typical one: creep of a fifth of the stroke in a decade is none."""
EACH = 0.02
"""Prior odds of each effect: of some twenty, one in three recordings has one."""
DIRECTIONS = 50
"""Along how many directions a misfit is spread evenly; chosen by judgement."""
_BEAM = (1, 6, 3)
"""Hypotheses of no, one and two effects that are extended by a further one, for each law."""
MOST_EFFECTS = len(_BEAM)
"""The most effects of a hypothesis."""
_HOPELESS = 60.0
"""Logarithm of the odds against a hypothesis from which it is not extended."""


class Kind(NamedTuple):
    """One shape of an effect: its columns, and whether they have only one sign."""

    name: str
    start: int
    stop: int
    one_sided: bool


@dataclass(frozen=True)
class Law:
    """A hypothesis about the hysteresis: inner products of the effects' columns under it.

    Attributes:
        name: of the law.
        kinds: of the columns.
        inner: inner products under the law's covariance.
        count: how many samples count.
        unknown: the variance along any direction that the law itself does not know, over the
            noise's and a sample.
        apart: for an effect those that are not combined with it.
    """

    name: str
    kinds: Sequence[Kind]
    inner: Inner
    count: float
    unknown: float
    apart: Mapping[str, Collection[str]]

    def tempered(self, misfit: float) -> Law:
        """The same with what the law does not know, and a misfit κ - 1 that remains, as further
        variance along every direction.

        A misfit is as large along a few tens of directions as along any other, so that of κ - 1 for
        each of n samples a `DIRECTIONS`th lies along a column.
        """
        share = 1 / (1 + (self.unknown + max(misfit, 0.0) / DIRECTIONS) * self.count)
        inner = self.inner
        thinned = Inner(
            inner.columns * share,
            inner.along * share,
            inner.square * share,
            inner.log_determinant * share,
        )
        return replace(self, inner=thinned, count=self.count * share)


class Hypothesis(NamedTuple):
    """Effects under a law, and their most likely shapes and sizes.

    `log_posterior` is up to a constant; `log_prior` is the part of it that is not the likelihood of
    these shapes and sizes.
    """

    log_posterior: float
    log_prior: float
    law: str
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

    @classmethod
    def of(cls, hypotheses: Sequence[Hypothesis]) -> Posterior:
        """The posterior of hypotheses in any order."""
        return cls(tuple(sorted(hypotheses, key=lambda h: -h.log_posterior)))

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
        """The probability of each set of effects, summed over laws."""
        sets: dict[frozenset[str], float] = {}
        for hypothesis, weight in zip(self.hypotheses, self._weights, strict=True):
            key = frozenset(hypothesis.names)
            sets[key] = sets.get(key, 0.0) + float(weight)
        return sets

    @property
    def nothing(self) -> float:
        """The probability that no effect is present."""
        return self.sets.get(frozenset(), 0.0)

    def probability_of(self, name: str) -> float:
        """The probability that an effect is present."""
        return sum(p for names, p in self.sets.items() if name in names)


def select(law: Law) -> Posterior:
    """The posterior over sets of up to three effects under a law, tempered by the misfit that the
    best of them leaves."""
    posterior = search(law, 0.0)
    for _ in range(2):
        posterior = search(law, misfit(law, posterior.best))
    return posterior


def search(law: Law, excess: float) -> Posterior:
    """The same, tempered by a misfit κ - 1, by a beam search."""
    return Posterior.of(_searched(law.tempered(excess)))


def of_effects(law: Law, names: Sequence[str], excess: float) -> Hypothesis:
    """The hypothesis of given effects, each of the likeliest shape beside those before it, tempered
    by a misfit κ - 1."""
    law = law.tempered(excess)
    layout, one = _Layout(law), _without_effects(law)
    for name in names:
        inner = law.inner.given(*one.columns(law.kinds)) if one.names else law.inner
        one = next(h for h in layout.added(one, inner) if h.names[-1] == name)
    return one


def misfit(law: Law, hypothesis: Hypothesis) -> float:
    """κ - 1, the excess of χ² per sample after a hypothesis."""
    chosen, sizes = hypothesis.columns(law.kinds)
    inner = law.inner.given(chosen, sizes) if chosen.size else law.inner
    return inner.square / law.count - 1


def evidence(law: Law, hypothesis: Hypothesis) -> float:
    """The log evidence of a law with the effects of a hypothesis, of their most likely shapes, with
    every sample counted: how well it describes the recordings, and with how much freedom."""
    chosen, sizes = hypothesis.columns(law.kinds)
    inner = law.inner.given(chosen, sizes) if chosen.size else law.inner
    return float(log_likelihood(inner.square, inner.log_determinant, law.count))


def _searched(law: Law) -> list[Hypothesis]:
    """The hypotheses of up to three effects under a law, by a beam search."""
    layout, leading = _Layout(law), [_without_effects(law)]
    hypotheses: dict[frozenset[str], Hypothesis] = {frozenset(): leading[0]}
    for width in _BEAM:
        best = max(h.log_posterior for h in hypotheses.values())
        larger: dict[frozenset[str], Hypothesis] = {}
        hopeful = [h for h in leading if not h.names or h.log_posterior > best - _HOPELESS]
        for before in hopeful[:width]:
            inner = law.inner.given(*before.columns(law.kinds)) if before.names else law.inner
            for one in layout.added(before, inner):
                key = frozenset(one.names)
                if key not in larger or larger[key].log_posterior < one.log_posterior:
                    larger[key] = one
        hypotheses |= larger
        leading = sorted(larger.values(), key=lambda h: -h.log_posterior)
    return list(hypotheses.values())


def _without_effects(law: Law) -> Hypothesis:
    """The hypothesis of a law alone."""
    likelihood = log_likelihood(law.inner.square, law.inner.log_determinant, law.count)
    return Hypothesis(float(likelihood), 0.0, law.name, (), (), ())


class _Layout:
    """A law's kinds, by effect and by their number of columns."""

    def __init__(self, law: Law):
        self._law = law
        kinds = law.kinds
        widths = np.array([kind.stop - kind.start for kind in kinds], dtype=int)
        self._by_width = {int(w): np.flatnonzero(widths == w) for w in np.unique(widths)}
        self._of_name = {
            name: np.array([k for k, kind in enumerate(kinds) if kind.name == name])
            for name in dict.fromkeys(kind.name for kind in kinds)
        }
        self._one_sided = np.array([kind.one_sided for kind in kinds])

    def added(self, before: Hypothesis, inner: Inner) -> list[Hypothesis]:
        """The hypothesis with each further effect."""
        evidence = np.zeros((len(self._law.kinds), SIZES.size))
        for width, which in self._by_width.items():
            evidence[which] = self._evidence(which, width, inner)
        larger = []
        prior = before.log_prior + float(np.log(EACH))
        barred = {*before.names, *(n for b in before.names for n in self._law.apart.get(b, ()))}
        for name, own in self._of_name.items():
            if name in barred:
                continue
            values = evidence[own]
            k, s = np.unravel_index(np.argmax(values), values.shape)
            average = float(logsumexp(values) - np.log(values.size))
            larger.append(
                Hypothesis(
                    prior + average,
                    prior + average - float(values[k, s]),
                    before.law,
                    (*before.names, name),
                    (*before.kinds, int(own[k])),
                    (*before.sizes, float(SIZES[s])),
                )
            )
        return larger

    def _evidence(self, which: np.ndarray, width: int, inner: Inner) -> np.ndarray:
        """Log likelihoods (kinds, sizes) of the kinds `which`, of `width` columns each."""
        starts = np.array([self._law.kinds[k].start for k in which])
        at = starts[:, None] + np.arange(width)
        values, turned = np.linalg.eigh(inner.columns[at[:, :, None], at[:, None, :]])
        values = np.maximum(values, 0.0)[:, None, :]
        along = np.einsum("kij,ki->kj", turned, inner.along[at])[:, None, :]
        variance = SIZES[None, :, None] ** 2
        taken = (along**2 * variance / (1 + variance * values)).sum(axis=2)
        determinant = np.log1p(variance * values).sum(axis=2)
        square = inner.square - taken
        count = self._law.count
        likelihood = log_likelihood(square, inner.log_determinant + determinant, count)
        if width == 1:
            score = along[:, :, 0] * np.sqrt(variance / (1 + variance * values))[:, :, 0]
            score = score / np.sqrt(np.maximum(1.0, square / count))
            halved = np.log(2) + log_ndtr(score)
            likelihood = likelihood + np.where(self._one_sided[which, None], halved, 0.0)
        return likelihood
