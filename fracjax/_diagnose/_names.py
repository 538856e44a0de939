"""Which effects a posterior names, and between which of them it is split."""

from __future__ import annotations

from dataclasses import dataclass

from .._blocks import EFFECTS
from .._path import Posterior, family_of
from ._thresholds import ADEQUATE, SURE

_MOST_ALIKE = 4
"""Look-alikes that are listed at most."""


@dataclass(frozen=True)
class Name:
    """An effect, the effects that the posterior holds possible in its stead, the likeliest first,
    and its probability."""

    effect: str
    alike: tuple[str, ...]
    probability: float


def names_of(posterior: Posterior, excess: float = 0.0) -> tuple[Name, ...]:
    """The effects of the likeliest set of which each, or a look-alike, is present with probability
    `SURE`.

    Where more than noise is left, `excess` being κ - 1, it is not decided which of a family an
    effect is: what is left may be what one of them leaves of another.
    """
    best, names = posterior.best.names, []
    special = {EFFECTS[name].special_case for name in best}
    for name in best:
        rest = frozenset(best) - {name}
        presence = 1 - sum(p for names, p in posterior.sets.items() if names <= rest)
        if name not in special and presence >= SURE:
            own, instead = posterior.probability_of(name), _instead(posterior, name, rest)
            alike = [o for o, p in instead.items() if p > (1 - SURE) * own]
            alike.sort(key=lambda other: -instead[other])
            if excess > ADEQUATE - 1:
                alike += sorted(family_of(name) - {*alike, *best})
            names.append(Name(name, tuple(alike[:_MOST_ALIKE]), float(own)))
    return tuple(names)


def _instead(posterior: Posterior, name: str, rest: frozenset[str]) -> dict[str, float]:
    """The probability of each effect that is there where this one is not, beside the rest."""
    others: dict[str, float] = {}
    for names, probability in posterior.sets.items():
        if name not in names:
            for other in names - rest:
                others[other] = others.get(other, 0.0) + probability
    return others
