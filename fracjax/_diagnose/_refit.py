"""The nested refit: base and effect fitted together, from several starts."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._blocks import AbstractBlock
from .._parameters import named_parameters, replace_parameters, set_values
from .._prepare import Preparation, layout_of
from .._solve import Solved, solve_from
from ._evidence import delta_bic
from ._score import EffectScore, kind_of
from ._stage import Layer, Stage

_LEAST_APART = 3
"""Trials that a refit starts from at least; chosen by judgement."""
_DRAWS, _FURTHER_DRAWS = 4, 8
"""Starts drawn from the priors, in a refit and in a further one; chosen by judgement."""
_BETTER = 1.0
"""Reduction of χ² from which a further optimum is better; chosen by judgement."""
_RESEMBLES = 0.3
"""Score from which a trial is a possible start, over the largest score; chosen by judgement."""
_COARSER = 4
"""How many times coarser the grid of a first search is; chosen by judgement."""
_LONG = 16_000
"""Steps from which a first search on a coarser grid saves time; chosen by judgement."""


@dataclass(frozen=True)
class Refit:
    """An extended model at its optimum, with the score of its effect.

    `conceded` is the rise of χ² by keeping the effect's own parameters within their usual ranges.
    """

    score: EffectScore
    solved: Solved
    conceded: float = 0.0

    @property
    def name(self) -> str:
        return self.score.effect.name

    @property
    def layer(self) -> Layer:
        return Layer(self.score.effect, self.score.trials[self.score.best])


def refit(
    score: EffectScore,
    stage: Stage,
    fits: list[AbstractBlock],
    seed: int,
    hopeless: float,
    earlier: Sequence[AbstractBlock] = (),
) -> Refit:
    """Fit base and effect together from the fitted bases, the nominal parameters, draws from the
    priors, and `earlier` optima.

    Starting also from nominal parameters keeps a fit from staying at the local optimum where the
    base model has absorbed the effect.  A start whose χ² stays above `hopeless` is given up after a
    few steps.
    """
    kinds: dict[Hashable, list[int]] = {}
    for k, trial in enumerate(score.trials):
        kinds.setdefault(kind_of(trial), []).append(k)
    attempts: list[Refit] = []
    for alike in map(score.only, kinds.values()):
        block_type = type(alike.trials[0])
        larger = next((a for a in attempts if isinstance(a.layer.trial, block_type)), None)
        attempts.append(
            _of_one_kind(alike, stage, fits, seed, hopeless, earlier)
            if larger is None
            else _reduced(larger, alike, stage.preparation)
        )
    return max(attempts, key=lambda attempt: delta_bic(stage.solved, attempt.solved))


def _reduced(larger: Refit, score: EffectScore, preparation: Preparation) -> Refit:
    """The refit of the same block with another number of gains, from the optimum of `larger`."""
    inside = getattr(larger.solved.block, larger.layer.inside)
    start = score.effect.insert(inside, score.trials[score.best])
    return Refit(score, solve_from([start], preparation))


def starts_from(other: Refit, score: EffectScore) -> list[AbstractBlock]:
    """Starts from another refit: its base with the trial that the residual resembles most, with the
    parameters that both blocks share.

    If the other effect is a special case of this one, the further starts of `Effect.beyond` are
    added.  A refit then need not search again for a mode that another has found.
    """
    layer, trial = other.layer, score.trials[score.best]
    fitted = named_parameters(getattr(other.solved.block, layer.place))
    shared = {
        name: np.clip(fitted[name].value, parameter.lower, parameter.upper)
        for name, parameter in named_parameters(trial).items()
        if name in fitted and np.shape(fitted[name].value) == np.shape(parameter.value)
    }
    inside, start = getattr(other.solved.block, layer.inside), set_values(trial, shared)
    beyond = score.effect.beyond(start) if other.name == score.effect.special_case else ()
    return [score.effect.insert(inside, block) for block in (start, *beyond)]


def _of_one_kind(
    score: EffectScore,
    stage: Stage,
    fits: list[AbstractBlock],
    seed: int,
    hopeless: float,
    earlier: Sequence[AbstractBlock],
) -> Refit:
    """The refit with trials of one structure."""
    effect, nominal = score.effect, stage.start()
    generator = np.random.default_rng(seed)
    # The more shapes a block has, the more local optima.
    shapes = sum(size for _, size in layout_of(score.trials[score.best]).shapes)
    promising = [score.trials[k] for k in unlike(score, max(_LEAST_APART, shapes))]
    best = promising[0]

    starts = [
        *(effect.insert(fits[0], trial) for trial in promising),
        *(effect.insert(fitted, best) for fitted in fits[1:]),
        *(effect.insert(nominal, trial) for trial in promising),
        *(_drawn(effect.insert(nominal, best), generator) for _ in range(_DRAWS)),
    ]
    starts = [*(block for block in earlier if kind_of(block) == kind_of(starts[0])), *starts]
    return Refit(score, _solved(starts, stage.preparation, hopeless))


def _drawn(block: AbstractBlock, generator: np.random.Generator) -> AbstractBlock:
    """The block with its shapes drawn from the priors."""
    parameters = named_parameters(block)
    shapes = [name for name, _ in layout_of(block).shapes]
    return set_values(block, {n: parameters[n].draw(generator) for n in shapes})


def refit_further(attempt: Refit, stage: Stage, seed: int) -> Refit:
    """The refit from its optimum and from more draws; the same refit if that is no better."""
    generator = np.random.default_rng([seed, 1])
    nominal = attempt.layer.effect.insert(stage.start(), attempt.layer.trial)
    starts = [attempt.solved.block, *(_drawn(nominal, generator) for _ in range(_FURTHER_DRAWS))]
    solved = _solved(starts, stage.preparation, np.inf)
    better = attempt.solved.cost - solved.cost > _BETTER
    return Refit(attempt.score, solved) if better else attempt


def within_usual_ranges(attempt: Refit, stage: Stage, loss: float) -> Refit:
    """The fit with the effect's own shapes within their usual ranges, if χ² rises by no more than
    `loss`.

    An unusual value counts against an effect only if the data require it; an optimum may lie far
    out in a flat valley.
    """
    solved, layer = attempt.solved, attempt.layer
    if all(parameter.is_plausible for parameter in layer.own_shapes(solved.block).values()):
        return attempt

    def kept(block: AbstractBlock) -> AbstractBlock:
        own = layer.own_shapes(block).items()
        return replace_parameters(block, {name: p.kept_plausible() for name, p in own})

    starts = [kept(solved.block), kept(layer.effect.insert(stage.solved.block, layer.trial))]
    inside = solve_from(starts, stage.preparation, solved.cost + loss)
    if inside.cost > solved.cost + loss:
        return attempt
    return replace(attempt, solved=inside, conceded=max(0.0, inside.cost - solved.cost))


def _solved(starts: list[AbstractBlock], preparation: Preparation, hopeless: float) -> Solved:
    """The best optimum of the starts; if the grid is fine and long, the search begins on a coarser
    one."""
    steps = sum(len(take.recording) for take in preparation.takes) * preparation.oversampling
    if preparation.oversampling < _COARSER or steps < _LONG:
        return solve_from(starts, preparation, hopeless)
    coarse = preparation.with_oversampling(preparation.oversampling // _COARSER)
    return solve_from([solve_from(starts, coarse, hopeless).block], preparation, hopeless)


def unlike(score: EffectScore, most: int) -> list[int]:
    """The indices of up to `most` trials: the one that the residual resembles most, and others that
    it resembles, which are least similar to the former.

    Similar trials would lead to the same optimum, and trials that differ in gains alone are one
    start.
    """
    strength = np.zeros(score.z.size)
    for family in map(list, score.families):
        leading = family[int(np.argmax(np.abs(score.z[family])))]
        strength[leading] = abs(score.z[leading])
    chosen = [score.best]
    alike = np.abs(score.directions @ score.directions[score.best])
    for _ in range(most - 1):
        eligible = (strength > _RESEMBLES * strength.max()) & (alike < 1 - 1e-6)
        if not eligible.any():
            break
        chosen.append(int(np.argmin(np.where(eligible, alike, np.inf))))
        alike = np.maximum(alike, np.abs(score.directions @ score.directions[chosen[-1]]))
    return chosen
