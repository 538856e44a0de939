"""The nonlinear refit of named effects and of their look-alikes."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._blocks import EFFECTS, AbstractBlock, Effect
from .._parameters import named_parameters, set_values
from .._prepare import Preparation, Problem
from .._solve import starts_of
from ._columns import kind_of
from ._fitted import Fitted, fitted
from ._layers import Layer, wrapped
from ._names import Judge
from ._thresholds import APART
from ._view import View

_CLEAR = 0.1
"""The size of a direction of loop shapes, over the noise, below which it is left out; chosen by
judgement."""
_TRIALS, _FORMS, _STARTS_AGAIN = 2, 2, 4
"""Trials of each form of an effect's block, forms, and starts of a second attempt; chosen by
judgement."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """Effects fitted together with the model, the first innermost; `price` is Occam's factor for
    them, on the scale of χ²."""

    layers: tuple[Layer, ...]
    fitted: Fitted
    price: float

    @property
    def names(self) -> tuple[str, ...]:
        """The effects' names, the first innermost."""
        return tuple(layer.effect.name for layer in self.layers)

    @property
    def cost(self) -> float:
        """χ² plus the price: minus twice the log evidence, up to a constant."""
        return self.fitted.solved.cost + self.price

    @property
    def standing(self) -> float:
        """Its cost among rivals, more by `APART` if a parameter ended on a physical bound."""
        return self.cost + (0.0 if self.is_within_bounds() else APART)

    @property
    def explains_all(self) -> bool:
        """Whether χ² is that of noise alone, within three standard errors."""
        samples = self.fitted.solved.samples
        return self.fitted.solved.cost < samples + 3 * np.sqrt(2 * samples)

    def is_within_bounds(self) -> bool:
        """Whether no parameter of an effect ended on its physical bound."""
        block = self.fitted.solved.block
        for layer in reversed(self.layers):
            for parameter in layer.own(block).values():
                share = np.asarray(parameter.to_share(parameter.value))
                if parameter.bounded and np.any((share < 1e-6) | (share > 1 - 1e-6)):
                    return False
            block = getattr(block, layer.inside)
        return True


def explained_by(
    names: Sequence[str],
    judge: Judge,
    nominal: AbstractBlock,
    preparation: Preparation,
    tau: float,
    hopeless: float = np.inf,
) -> Explanation:
    """The model fitted together with effects, with loop shapes of size τ in the noise.

    It starts from the trials that explain most of the residual, with the model's parameters as
    fitted and nominal; of a single effect each form of its block is tried.  If χ² exceeds what the
    columns predict, further starts follow, unless it is above `hopeless`.
    """
    view, options = judge.first, [_trials(name, judge) for name in names]
    base, price = view.fitted.solved.block, sum(map(judge.price, names))
    shapes = directions(view, preparation, tau) if tau > 0 else ()
    if len(names) == 1:
        forms = [[trials] for trials in options[0]]
    else:
        forms = [[of_effect[0] for of_effect in options]]
    fits = []
    for form in forms:
        best = tuple(Layer(EFFECTS[n], trials[0]) for n, trials in zip(names, form, strict=True))
        starts = [wrapped(base, best), wrapped(nominal, best)]
        for k, trials in enumerate(form):
            for trial in trials[1:]:
                layers = [*best[:k], Layer(EFFECTS[names[k]], trial), *best[k + 1 :]]
                starts.append(wrapped(base, layers))
        fits.append(Explanation(best, fitted(starts, preparation, shapes, hopeless), price))
    best = min(fits, key=lambda e: e.cost)
    cost = best.fitted.solved.cost
    if cost > hopeless or cost < judge.promised(names) + APART:
        return best
    return elsewhere(best, nominal, preparation)


def elsewhere(
    explanation: Explanation, nominal: AbstractBlock, preparation: Preparation
) -> Explanation:
    """An explanation refitted from draws of the model's parameters, if that is better: those that
    it has may be in a poor basin, which they reached without the effects."""
    draws, layers = starts_of(nominal, _STARTS_AGAIN, seed=0), _parts(explanation)[1]
    return _again(explanation, [wrapped(block, layers) for block in draws], preparation)


def beside(other: Explanation, of: Explanation, preparation: Preparation) -> Explanation:
    """An explanation refitted from the model's parameters of another, if that is better, so that
    both are compared in the same basin."""
    return _again(other, [wrapped(_parts(of)[0], _parts(other)[1])], preparation)


def enlarged(
    explanation: Explanation, name: str, judge: Judge, preparation: Preparation
) -> tuple[Explanation, Explanation]:
    """An explanation of which one effect is a special case of another, `name`: itself, and that
    with the other in its place.  Each is refitted from the optimum of the other."""
    (inside, layers), special = _parts(explanation), EFFECTS[name].special_case
    k = explanation.names.index(special)

    def around(effect: Effect, block: AbstractBlock) -> AbstractBlock:
        return wrapped(inside, [*layers[:k], Layer(effect, block), *layers[k + 1 :]])

    effect, trials = EFFECTS[name], _trials(name, judge)[0]
    trial, own = trials[0], _with_values_of(trials[0], layers[k].trial)
    starts = [around(effect, block) for block in (own, *trials, *effect.beyond(own))]
    parts = [*explanation.layers[:k], Layer(effect, trial), *explanation.layers[k + 1 :]]
    price = explanation.price + judge.price(name) - judge.price(special)
    shapes = explanation.fitted.preparation.shapes
    larger = Explanation(tuple(parts), fitted(starts, preparation, shapes), price)
    inside, layers = _parts(larger)
    back = _with_values_of(explanation.layers[k].trial, layers[k].trial)
    return _again(explanation, [around(EFFECTS[special], back)], preparation), larger


def _with_values_of(block: AbstractBlock, other: AbstractBlock) -> AbstractBlock:
    """A block with the values of another for the parameters that both have."""
    values = named_parameters(other)
    shared = named_parameters(block).keys() & values.keys()
    return set_values(block, {name: values[name].value for name in shared})


def _parts(explanation: Explanation) -> tuple[AbstractBlock, list[Layer]]:
    """The fitted model, and the fitted effects around it, the first innermost."""
    block, layers = explanation.fitted.solved.block, []
    for layer in reversed(explanation.layers):
        layers.append(Layer(layer.effect, getattr(block, layer.place)))
        block = getattr(block, layer.inside)
    return block, layers[::-1]


def _again(
    explanation: Explanation, starts: Sequence[AbstractBlock], preparation: Preparation
) -> Explanation:
    """An explanation refitted from further starts, if that is better."""
    again = fitted(starts, preparation, explanation.fitted.preparation.shapes)
    better = again.solved.cost < explanation.fitted.solved.cost
    return replace(explanation, fitted=again) if better else explanation


def _trials(name: str, judge: Judge) -> list[list[AbstractBlock]]:
    """An effect's trials that explain most of the residual, by form, the best form first."""
    view, inner = judge.first, judge.inner
    falls = []
    for kind, group in zip(view.kinds, view.columns.groups, strict=True):
        if kind.name == name:
            columns = np.arange(kind.start, kind.stop)
            along = inner.along[columns] / np.sqrt(np.diag(inner.columns)[columns] + 1e-300)
            strongest = int(np.argmax(np.abs(along)))
            falls.append((judge.taken(columns), group.trials[strongest]))
    falls.sort(key=lambda pair: -pair[0])
    forms: dict[Hashable, list[AbstractBlock]] = {}
    for _, trial in falls:
        forms.setdefault(kind_of(trial), []).append(trial)
    return [trials[:_TRIALS] for trials in forms.values()][:_FORMS]


def directions(
    view: View, preparation: Preparation, tau: float
) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Each recording's orthonormal directions (L, k) of whitened loop shapes of size τ, and the
    factors (k,) of a `Shaped` problem."""
    factors, at = [], 0
    for problem in preparation.problems():
        length = len(problem.response)
        white = Problem.whiten(problem, tau * view.columns.shapes[at : at + length])
        at += length
        basis, sizes, _ = np.linalg.svd(white, full_matrices=False)
        clear = sizes > _CLEAR
        factors.append((basis[:, clear], 1 / np.sqrt(1 + sizes[clear] ** 2)))
    return tuple(factors)
