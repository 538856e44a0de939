"""Which effects a view names, and which of them it cannot distinguish."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial

import numpy as np

from .._blocks import EFFECTS
from ._folds import Folds
from ._gram import Inner
from ._selection import Hypothesis, occam_factor
from ._thresholds import ALIKE, APART, DOUBT, SECOND, SHARE, SURE
from ._view import View

_RIDGE = 1e-9
"""Added to a Gram matrix of unit columns, for stability."""
_MOST_ALIKE = 4
"""Look-alikes that are listed at most; chosen by judgement."""


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
    misfit as a part of it; loop shapes up to `small` count as none."""

    def __init__(self, first: View, seen: View, small: float):
        self.first, self.seen = first, seen
        best = seen.posterior.best
        self.is_inexact = best.tau > small
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
        """The named effects: of the likeliest set those that explain a sufficient share, on
        held-out stretches too, and are present, or a look-alike is, with probability `SURE`."""
        likeliest = self.seen.posterior.best.names
        special = {EFFECTS[name].special_case for name in likeliest}
        kept = [name for name in likeliest if name not in special]
        while kept:
            reach = {name: self._reach(name, kept) for name in kept}
            least = min(reach, key=lambda name: reach[name])
            if reach[least] >= 1:
                break
            kept.remove(least)
        names = [self._name_of(name, kept) for name in kept]
        return tuple(name for name in names if name.probability >= SURE)

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

    def _name_of(self, name: str, kept: list[str]) -> Name:
        """One name of the kept effects."""
        rest = [other for other in kept if other != name]
        posterior = self.seen.posterior
        nothing = sum(p for names, p in posterior.sets.items() if names <= frozenset(rest))
        return Name(name, self._alike(name, rest), 1 - nothing, self._share(name, kept))

    def _reach(self, name: str, kept: list[str]) -> float:
        """The share that an effect explains, over the share that a name requires.

        If the loop has the model's shape, it is the share of the whole excess, beside others.
        Otherwise it is the share of what the other effects and the loop's shape do not explain, in
        training and on held-out stretches, the smaller of the two.
        """
        if not self.is_inexact:
            return self._share(name, kept) / SECOND if len(kept) > 1 else np.inf
        rest = [other for other in kept if other != name]
        without, beside = self.fall(tuple(rest)), self.fall(tuple(kept))
        trained = (beside - without) / self._beyond(self.inner.square - without)
        before, after = (float(self._folds.squares(self._columns(n)).sum()) for n in (rest, kept))
        return min(trained, (before - after) / self._beyond(before)) / SHARE

    def _beyond(self, square: float) -> float:
        """χ² minus that of the noise, but no less than the uncertainty of the noise level."""
        return max(square - self.first.gram.count, self._doubt * self.first.gram.count, 1.0)

    @cached_property
    def _folds(self) -> Folds:
        """Held-out stretches beside the loop's shape."""
        return self.first.folds(self._tau)

    def _columns(self, names: list[str]) -> np.ndarray:
        """The whitened columns (ΣL, k) of effects as in the likeliest set, of unit prior sd."""
        best = self.seen.posterior.best
        chosen = [k for k, name in enumerate(best.names) if name in names]
        part = best._replace(
            names=tuple(names),
            kinds=tuple(best.kinds[k] for k in chosen),
            sizes=tuple(best.sizes[k] for k in chosen),
        )
        at, sizes = part.columns(self.first.kinds)
        return self.first.white[1][:, at] * sizes

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
        """The reduction of χ² by effects together, each of the kind that reduces it most after
        those before it."""
        chosen, taken = np.zeros(0, dtype=int), 0.0
        for name in names:
            options = [k for k in self.first.kinds if k.name == name]
            falls = []
            for kind in options:
                columns = np.concatenate([chosen, np.arange(kind.start, kind.stop)])
                falls.append((_taken(inner, columns), columns))
            taken, chosen = max(falls, key=lambda pair: pair[0])
        return taken

    def taken(self, columns: np.ndarray) -> float:
        """The reduction of χ² by columns with free gains."""
        return _taken(self.inner, columns)


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
