"""What could take the place of the named effects, each refitted.

A posterior in which some sets of effects are refitted and others are predicted by columns is not
fair to the latter: columns are of the first order about the model without effects.  So everything
that could be named instead is refitted too, and what is left is asked again about the refit.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from .._blocks import EFFECTS, AbstractBlock
from .._computing import Clock
from .._path import (
    EACH,
    MOST_EFFECTS,
    PathView,
    Posterior,
    evidence,
    log_likelihood,
    misfit,
    square_at,
)
from .._solve import Progress
from ._names import Name, names_of
from ._refits import Explanation, beside, explained_by, with_refits, without
from ._views import ModelView, model_view

_FAR = 20.0
"""How much less likely a refit is of which it does not matter by how much: what two effects fewer
may cost (`EACH` and the sizes of their columns), and as much again."""


def aim_of(view: ModelView, path: PathView, effects: int) -> float:
    """χ² of the model with effects, each refitted, below which it is likelier than path curves; its
    freedom is that of the model's own columns and of two for each effect."""
    count = view.law.count
    freedom = (2 * effects + view.fitted.tangent.shape[1]) * np.log(count)
    return square_at(evidence(path.law, path.posterior.best), float(freedom), count)


def compared(
    view: ModelView,
    path: PathView,
    refits: Sequence[Explanation],
    nominal: AbstractBlock,
    progress: Progress,
    clock: Clock,
) -> tuple[Posterior, list[Explanation]]:
    """The posterior once what it names is refitted, and so is all that could take its place, and
    what is found beside its refit; and the refits.  What is named may change by each of them."""
    refits, groups = list(refits), list[set[str]]()
    asked, lessened = set[frozenset[str]](), set[frozenset[str]]()
    preparation = view.fitted.preparation
    visible = {other for n in names_of(path.posterior) for other in (n.effect, *n.alike)}
    while True:
        posterior = with_refits(view, refits) if refits else view.posterior
        names = names_of(posterior)
        groups = _grouped(groups, names)
        chosen = frozenset(n.effect for n in names)
        refitted = {frozenset(e.names): e for e in refits}
        rivals = rivals_of([n.effect for n in names], groups, view.law.apart)
        sets = [each for each in rivals if frozenset(each) not in refitted]
        for each in sorted(sets, key=len):
            if clock.is_over:
                break
            progress(f"refitting with {' and '.join(each)}")
            aim = min(aim_of(view, path, len(each)), _within_reach(view, refits, each))
            parts = [e for e in refits if len(e.names) == len(each) - 1 and {*e.names} < {*each}]
            if parts:
                # From what the best of its parts has come to, on the grid that this has needed.
                best = min(parts, key=lambda e: e.fitted.solved.cost)
                (name,) = {*each} - {*best.names}
                refits.append(beside(best, name, view, aim))
            else:
                refits.append(explained_by(each, view, nominal, preparation, aim))
        if sets and not clock.is_over:
            continue
        if len(chosen) > 1 and chosen not in lessened and not clock.is_over:
            # An effect is needed only if the rest, from where all have come to, does not do.
            lessened.add(chosen)
            for name in sorted(chosen):
                progress(f"refitting without {name}")
                less = without(refitted[chosen], name)
                before = refitted.get(frozenset(less.names))
                if before is None or less.fitted.solved.cost < before.fitted.solved.cost:
                    refits = [e for e in refits if e is not before] + [less]
            continue
        if clock.is_over or not chosen or chosen in asked or len(chosen) == MOST_EFFECTS:
            return posterior, refits
        # Columns are of the model without the effects: what is small beside one of them shows
        # about its refit alone.
        asked.add(chosen)
        one, aim = refitted[chosen], aim_of(view, path, len(chosen) + 1)
        progress(f"asking what is left beside {' and '.join(sorted(chosen))}")
        about = model_view(one.fitted, view.law.unknown)
        if (1 + misfit(about.law, about.posterior.best)) * view.law.count > aim:
            return posterior, refits
        barred = chosen.union(*(view.law.apart.get(name, ()) for name in chosen))
        further = {*about.posterior.best.names} - barred
        if any(EFFECTS[name].rate_independent for name in chosen):
            # The loop's shape is in doubt: a second change of it is the form of the first, and
            # dynamics beside it are those that any law leaves.
            further &= visible
        groups = _grouped(groups, names_of(about.posterior))
        rest = {other for each in further for other in _in_place_of(each, groups)} - barred
        for name in sorted(rest):
            if chosen | {name} not in refitted:
                progress(f"refitting with {name} beside {' and '.join(sorted(chosen))}")
                least = min(aim, _within_reach(view, refits, [*chosen, name]))
                refits.append(beside(one, name, about, least))


def _within_reach(view: ModelView, refits: Sequence[Explanation], names: Collection[str]) -> float:
    """χ² above which a set of effects is of no use: far less likely than the best refit, however
    few effects it has, or not likelier than a part of it by what its further effects cost."""
    count, least = view.law.count, np.inf

    def likelihood(square: float) -> float:
        return float(log_likelihood(square, 0.0, count))

    parts = [(0, (1 + view.base_misfit) * count)]
    for one in refits:
        square = one.fitted.solved.cost
        least = min(least, square_at(likelihood(square) - _FAR, 0.0, count))
        if set(one.names) < set(names):
            parts.append((len(one.names), square))
    for size, square in parts:
        dearer = (size - len(set(names))) * np.log(EACH)
        least = min(least, square_at(likelihood(square) + dearer, 0.0, count))
    return least


def _grouped(groups: Sequence[set[str]], names: Sequence[Name]) -> list[set[str]]:
    """Groups of effects that look alike, with what names say of it."""
    groups = list(groups)
    for name in names:
        one = {name.effect, *name.alike}
        groups = [*(g for g in groups if not g & one), one.union(*(g for g in groups if g & one))]
    return groups


def _in_place_of(name: str, groups: Sequence[set[str]]) -> set[str]:
    """An effect, those that look like it, and the special case of it that may suffice."""
    special = EFFECTS[name].special_case
    alike = {other for group in groups if name in group for other in group}
    return {name, *alike, *([special] if special else [])}


def rivals_of(
    chosen: Sequence[str], groups: Sequence[set[str]], apart: Mapping[str, Collection[str]]
) -> list[list[str]]:
    """Effects, and the sets in their place: with a look-alike, of a group, instead of one, and
    without one of several, since what columns leave of one effect looks like another."""
    sets = [list(chosen)] if chosen else []
    for k, name in enumerate(chosen):
        rest = [*chosen[:k], *chosen[k + 1 :]]
        barred = {*chosen}.union(*(apart.get(other, ()) for other in rest))
        for other in sorted(_in_place_of(name, groups) - barred):
            sets.append([*chosen[:k], other, *chosen[k + 1 :]])
        if rest:
            sets.append(rest)
    return sets
