"""The nonlinear refit of effects with the model, and the posterior after it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._blocks import EFFECTS, AbstractBlock, Setting
from .._path import DIRECTIONS, Hypothesis, Posterior, log_likelihood, misfit, of_effects, search
from .._prepare import Preparation, layout_of
from .._solve import starts_of
from ._fitted import Fitted, fitted
from ._layers import Layer, parts_of, wrapped
from ._views import ModelView

_TRIALS, _STARTS_AGAIN = 2, 4
"""Trials of an effect's block from which a refit starts, and starts of a second attempt; chosen by
judgement."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """Effects fitted together with a model, the first innermost."""

    layers: tuple[Layer, ...]
    fitted: Fitted

    @property
    def names(self) -> tuple[str, ...]:
        """The effects' names, the first innermost."""
        return tuple(layer.effect.name for layer in self.layers)

    @property
    def excess(self) -> float:
        """κ - 1, the excess of χ² per sample."""
        return self.fitted.solved.cost / self.fitted.solved.samples - 1


def explained_by(
    names: Sequence[str],
    view: ModelView,
    nominal: AbstractBlock,
    preparation: Preparation,
    aim: float = np.inf,
    further: Sequence[AbstractBlock] = (),
) -> Explanation:
    """The model fitted together with effects, from the trials that explain most of the residual,
    with the model's parameters as fitted and nominal, and from draws where that ends above a χ² of
    `aim` that the columns predict; no fit goes on that does not come down to it.  `further` are
    trials of the first effect that come before."""
    base = view.fitted.solved.block
    trials = [_trials(name, view) for name in names]
    trials[0] = [*further, *trials[0]]
    best = tuple(Layer(EFFECTS[n], own[0]) for n, own in zip(names, trials, strict=True))
    starts = [wrapped(base, best), wrapped(nominal, best)]
    for k, own in enumerate(trials):
        for trial in own[1:]:
            starts.append(
                wrapped(base, [*best[:k], Layer(EFFECTS[names[k]], trial), *best[k + 1 :]])
            )
    first = Explanation(best, fitted(starts, preparation, aim))
    cost, predicted = first.fitted.solved.cost, _predicted(view, names)
    if first.excess <= max(predicted, 0.0) + 0.02 or (1 + predicted) * view.law.count > aim:
        return first
    layers = parts_of(first.fitted.solved.block, first.layers)[1]
    draws = [wrapped(block, layers) for block in starts_of(nominal, _STARTS_AGAIN, seed=0)]
    again = fitted(draws, preparation, aim)
    return replace(first, fitted=again) if again.solved.cost < cost else first


def beside(explanation: Explanation, name: str, about: ModelView, aim: float) -> Explanation:
    """A refit with one more effect, from its trials that explain most of what is `about` it, on the
    grid that it has needed without."""
    block, layers = explanation.fitted.solved.block, explanation.layers
    further = [Layer(EFFECTS[name], trial) for trial in _trials(name, about)]
    starts = [wrapped(block, [one]) for one in further]
    return Explanation((*layers, further[0]), fitted(starts, explanation.fitted.preparation, aim))


def without(explanation: Explanation, name: str) -> Explanation:
    """A refit with one effect less, from where it has come to with it."""
    block, layers = parts_of(explanation.fitted.solved.block, explanation.layers)
    rest = tuple(layer for layer in layers if layer.effect.name != name)
    return Explanation(rest, fitted([wrapped(block, rest)], explanation.fitted.preparation))


def _predicted(view: ModelView, names: Sequence[str]) -> float:
    """κ - 1 that the columns of effects predict of their refit."""
    own = [h for h in view.posterior.hypotheses if set(h.names) == set(names)]
    return misfit(view.law, own[0]) if own else np.inf


def _trials(name: str, view: ModelView) -> list[AbstractBlock]:
    """An effect's trials that explain most of the residual alone."""
    falls, inner = [], view.law.inner
    for kind, group in zip(view.law.kinds, view.groups, strict=True):
        if kind.name == name:
            at = np.arange(kind.start, kind.stop)
            lengths = np.sqrt(np.diag(inner.columns)[at] + 1e-300)
            scores = np.abs(inner.along[at]) / lengths
            falls.append((float(scores.max()), group.trials[int(np.argmax(scores))]))
    falls.sort(key=lambda pair: -pair[0])
    return [trial for _, trial in falls[:_TRIALS]]


def _further_shapes(layer: Layer, setting: Setting) -> int:
    """How many shapes an effect has more than its special case."""
    if not layer.effect.special_case:
        return 0
    special = EFFECTS[layer.effect.special_case].trials(setting)[0]
    return len(layout_of(layer.trial).shapes) - len(layout_of(special).shapes)


def with_refits(view: ModelView, refits: Sequence[Explanation]) -> Posterior:
    """The posterior with the χ² of refits in place of what columns predicted of them."""
    best = misfit(view.law, view.posterior.best)
    least = min([best, *(e.excess for e in refits)])
    # Of the form of an effect no more can be wrong than its refit leaves.
    law = replace(view.law, unknown=min(view.law.unknown, max(least, 0.0) / DIRECTIONS))
    tempered = law.tempered(least)
    share = tempered.count / law.count
    by_names = {frozenset(e.names): e for e in refits}

    def gain(hypothesis: Hypothesis) -> float:
        """What the refit of a hypothesis is more likely than its columns."""
        chosen, sizes = hypothesis.columns(law.kinds)
        linear = tempered.inner.given(chosen, sizes).square
        square = by_names[frozenset(hypothesis.names)].fitted.solved.cost * share
        gained = log_likelihood(square, 0.0, tempered.count) - log_likelihood(
            linear, 0.0, tempered.count
        )
        # Of two effects of which one is the other's special case the columns are alike: what the
        # larger has more of shapes costs by Schwarz's criterion, Ann. Stat. 6 (1978) 461.
        layers = by_names[frozenset(hypothesis.names)].layers
        more = sum(_further_shapes(layer, view.fitted.preparation.setting) for layer in layers)
        return float(gained) - 0.5 * more * float(np.log(tempered.count))

    listed = list(search(law, least).hypotheses)
    met = {frozenset(h.names) for h in listed}
    listed += [of_effects(law, e.names, least) for e in refits if frozenset(e.names) not in met]
    gains = {frozenset(h.names): gain(h) for h in listed if frozenset(h.names) in by_names}

    def again(hypothesis: Hypothesis) -> Hypothesis:
        """With the χ² of its refit; without one, with what the refits of its parts have lost."""
        names = frozenset(hypothesis.names)
        lost = min([0.0, *(value for part, value in gains.items() if part < names)])
        return hypothesis._replace(log_posterior=hypothesis.log_posterior + gains.get(names, lost))

    return Posterior.of([again(h) for h in listed])
