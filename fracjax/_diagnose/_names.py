"""Which effects a view names, and which of them it cannot distinguish."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial

import numpy as np

from .._blocks import EFFECTS
from ._folds import Folds, Gain
from ._gram import Inner
from ._selection import SIZES, Hypothesis, occam_factor
from ._thresholds import ALIKE, APART, CHANCE, DOUBT, SECOND, SHARE, SURE
from ._view import View

_RIDGE = 1e-9
"""Added to a Gram matrix of unit columns, for stability."""
_MOST_ALIKE, _MOST = 4, 3
"""Look-alikes that are listed at most, and effects that are named; chosen by judgement."""


@dataclass(frozen=True)
class Name:
    """An effect, its look-alikes, the probability that it or one like it is present, and the share
    of the excess that it explains."""

    effect: str
    alike: tuple[str, ...]
    probability: float
    share: float


class Judge:
    """Names from the posterior about a fit: `first` has the noise as it was measured, `seen` the
    misfit as a part of it; loop shapes up to `small` count as none.  A model whose loop is exact
    leaves noise: if it `misfits`, its loop is taken to be another."""

    def __init__(self, first: View, seen: View, small: float, *, misfits: bool = False):
        self.first, self.seen = first, seen
        best = seen.posterior.best
        self.is_inexact = best.tau > small or misfits
        alone = [h for h in first.posterior.hypotheses if not h.names]
        self.alone: Hypothesis = alone[0]
        self._tau = self.alone.tau if self.is_inexact else 0.0
        self.inner, self._coloured = first.gram.under(self._tau), seen.gram.under(self._tau)
        self._doubt = DOUBT if self.is_inexact else 0.0
        self.excess = self._beyond(self.inner.square)
        self.fall = cache(partial(self._fall, self.inner))
        self._coloured_fall = cache(partial(self._fall, self._coloured))

    def without_shapes(self) -> Judge:
        """The same for a loop that has the model's shape."""
        return Judge(self.first, self.first, np.inf)

    def price(self, name: str) -> float:
        """The price of an effect: the reduction of χ² above which its evidence rises, by Occam's
        factor."""
        own = [kind for kind in self.seen.kinds if kind.name == name]
        remaining = self._coloured.square - self._coloured_fall((name,))
        return occam_factor(own, self._coloured, max(1.0, remaining / self.seen.gram.count))

    def promised(self, names: Sequence[str]) -> float:
        """The χ² of a refit with effects that their columns predict."""
        return self._coloured.square - self._coloured_fall(tuple(names))

    def leading(self, count: int) -> list[str]:
        """The effects that reduce χ² most, each alone, and at least half as much as the first."""
        names = dict.fromkeys(kind.name for kind in self.first.kinds)
        ranked = sorted(names, key=lambda name: -self.fall((name,)))[:count]
        return [name for name in ranked if self.fall((name,)) >= 0.5 * self.fall((ranked[0],))]

    def names(self) -> tuple[Name, ...]:
        """The named effects, each of which is present, or a look-alike is, with probability
        `SURE`: of a loop of the model's shape the likeliest, of another those that predict."""
        return self._predicting() if self.is_inexact else self._likeliest()

    def _likeliest(self) -> tuple[Name, ...]:
        """The effects of the likeliest set that explain a sufficient share of the excess."""
        likeliest, posterior = self.seen.posterior.best.names, self.seen.posterior
        special = {EFFECTS[name].special_case for name in likeliest}
        kept = [name for name in likeliest if name not in special]
        while len(kept) > 1:
            least = min(kept, key=lambda name: self._share(name, kept))
            if self._share(least, kept) >= SECOND:
                break
            kept.remove(least)
        names = []
        for name in kept:
            rest = [other for other in kept if other != name]
            nothing = sum(p for names, p in posterior.sets.items() if names <= frozenset(rest))
            names.append(Name(name, self._alike(name, rest), 1 - nothing, self._share(name, kept)))
        return tuple(name for name in names if name.probability >= SURE)

    def _predicting(self) -> tuple[Name, ...]:
        """The effects that explain a sufficient share of what the loop's shape and the effects
        before them do not explain, in training and in held-out parts of the recording."""
        chosen: dict[str, float] = {}
        rivals: dict[str, list[str]] = {}
        while len(chosen) < _MOST:
            gains: dict[str, Gain] = {}
            before = self._folds.squares(self._columns(chosen))
            for name in self._candidates(chosen):
                trained = self._trained(name, tuple(chosen))
                if trained >= SHARE:
                    gain = self._folds.gain(before, self._columns([*chosen, name]))
                    gains[name] = Gain(min(trained, gain.share), gain.p_value)
            best = max(gains, key=lambda name: gains[name].share, default="")
            predicting = [n for n, g in gains.items() if _is_sure(g)]
            if best not in predicting:
                break
            rivals[best] = predicting
            chosen[best] = 1 - gains[best].p_value
        names = []
        for name, probability in chosen.items():
            alike = self._alike(name, [other for other in chosen if other != name])
            alike = tuple(other for other in alike if other in rivals[name])
            names.append(Name(name, alike, probability, self._share(name, list(chosen))))
        return tuple(names)

    def _candidates(self, chosen: Iterable[str]) -> list[str]:
        """The effects that may be added to those chosen."""
        related = {EFFECTS[name].special_case for name in chosen}
        related |= {e.name for e in EFFECTS.values() if e.special_case in set(chosen)}
        names = dict.fromkeys(kind.name for kind in self.first.kinds)
        taken = related.union(chosen)
        return [name for name in names if name not in taken and not self._is_barred(name)]

    def most_like(self, named: Iterable[str]) -> str | None:
        """The effect that explains most of the remaining residual without being named; None if
        that is too little."""
        named = tuple(named)
        remaining = self.inner.square - self.first.gram.count - self.fall(named)
        if remaining < DOUBT * self.first.gram.count:
            return None
        others = {kind.name for kind in self.first.kinds if not self._is_barred(kind.name)}
        gains = {n: self.fall((*named, n)) - self.fall(named) for n in others - set(named)}
        best = max(gains, key=lambda name: gains[name], default=None)
        least = max(APART, 0.5 * SHARE * self.excess)
        return best if best is not None and gains[best] > least else None

    def _trained(self, name: str, rest: tuple[str, ...]) -> float:
        """The share of what other effects and the loop's shape do not explain that an effect
        explains."""
        without = self.fall(rest)
        return (self.fall((*rest, name)) - without) / self._beyond(self.inner.square - without)

    def _beyond(self, square: float) -> float:
        """χ² minus that of the noise, but no less than the uncertainty of the noise level."""
        return max(square - self.first.gram.count, self._doubt * self.first.gram.count, 1.0)

    @cached_property
    def _folds(self) -> Folds:
        """Held-out stretches beside the loop's shape."""
        return self.first.folds(self._tau)

    def _columns(self, names: Iterable[str]) -> np.ndarray:
        """The whitened columns (ΣL, k) of effects, each of the kind that reduces χ² most, of unit
        prior sd."""
        return SIZES[-1] * self.first.white[1][:, self._best(self.inner, tuple(names))[1]]

    def _share(self, name: str, kept: list[str]) -> float:
        """The share of the excess that an effect explains beside others."""
        rest = tuple(other for other in kept if other != name)
        return (self.fall(tuple(kept)) - self.fall(rest)) / self.excess

    def _alike(self, name: str, rest: list[str]) -> tuple[str, ...]:
        """The effects that reduce χ² nearly as much in its place; without another loop shape they
        must also be likely by the posterior."""
        posterior = self.seen.posterior
        whole, without = self.fall((*rest, name)), self.fall(tuple(rest))
        margin = max(APART, ALIKE * (whole - without)) if self.is_inexact else APART
        own = posterior.probability_of(name)
        look_alikes = []
        for other in dict.fromkeys(kind.name for kind in self.first.kinds):
            if other == name or other in rest or self._is_barred(other):
                continue
            behind = whole - self.fall((*rest, other))
            instead = sum(
                p for names, p in posterior.sets.items() if other in names and name not in names
            )
            if behind < margin and (self.is_inexact or instead > (1 - SURE) * own):
                look_alikes.append((behind, other))
        return tuple(other for _, other in sorted(look_alikes)[:_MOST_ALIKE])

    def _is_barred(self, name: str) -> bool:
        """Whether an effect is rate-independent and the loop has not the model's shape."""
        kinds = [kind for kind in self.first.kinds if kind.name == name]
        return self.is_inexact and kinds[0].is_shape

    def _fall(self, inner: Inner, names: tuple[str, ...]) -> float:
        """The reduction of χ² by effects together."""
        return self._best(inner, names)[0]

    def _best(self, inner: Inner, names: tuple[str, ...]) -> tuple[float, np.ndarray]:
        """The reduction of χ² by effects together, each of the kind that reduces it most after
        those before it, and the indices of their columns (k,)."""
        taken, chosen = 0.0, np.zeros(0, dtype=int)
        for name in names:
            options = [k for k in self.first.kinds if k.name == name]
            falls = []
            for kind in options:
                columns = np.concatenate([chosen, np.arange(kind.start, kind.stop)])
                falls.append((_taken(inner, columns), columns))
            taken, chosen = max(falls, key=lambda pair: pair[0])
        return taken, chosen

    def taken(self, columns: np.ndarray) -> float:
        """The reduction of χ² by columns with free gains."""
        return _taken(self.inner, columns)


def _is_sure(gain: Gain) -> bool:
    """Whether an effect explains a sufficient share of held-out parts, and not by chance."""
    return gain.share >= SHARE and gain.p_value <= CHANCE * min(gain.share, 1.0) ** 2


def _taken(inner: Inner, columns: np.ndarray) -> float:
    """The reduction of χ² by columns with free gains."""
    gram = inner.columns[np.ix_(columns, columns)]
    sizes = np.sqrt(np.diag(gram))
    seen = sizes > 0
    if not seen.any():
        return 0.0
    scaled = gram[np.ix_(seen, seen)] / np.outer(sizes[seen], sizes[seen])
    along = inner.along[columns][seen] / sizes[seen]
    return float(along @ np.linalg.solve(scaled + _RIDGE * np.eye(along.size), along))
