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

_LEAST_APART, _DRAWS, _FURTHER_DRAWS = 3, 4, 8
_BETTER = 1.0
_RESEMBLES = 0.3
_COARSER = 4
_LONG = 16_000


@dataclass(frozen=True)
class Refit:
    """An extended model at its optimum, and the effect's own parameters within it.

    `conceded` is what it lost in χ² by keeping these within their usual ranges.
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
    found: Sequence[AbstractBlock] = (),
) -> Refit:
    """Fit base and effect together from the fitted bases, the nominal point and prior draws; and
    from what was `found` before.

    Starting also from nominal values keeps a fit from staying in the basin where the base model
    has absorbed the effect.  No more than a few steps are spent above `hopeless` in χ².
    """
    kinds: dict[Hashable, list[int]] = {}
    for k, trial in enumerate(score.trials):
        kinds.setdefault(kind_of(trial), []).append(k)
    attempts: list[Refit] = []
    for alike in map(score.only, kinds.values()):
        law = type(alike.trials[0])
        larger = next((a for a in attempts if isinstance(a.layer.trial, law)), None)
        attempts.append(
            _of_one_kind(alike, stage, fits, seed, hopeless, found)
            if larger is None
            else _reduced(larger, alike, stage.preparation)
        )
    return max(attempts, key=lambda attempt: delta_bic(stage.solved, attempt.solved))


def _reduced(larger: Refit, score: EffectScore, preparation: Preparation) -> Refit:
    """The refit of the same law with another number of gains, from where that ended."""
    inside = getattr(larger.solved.block, larger.layer.inside)
    start = score.effect.insert(inside, score.trials[score.best])
    return Refit(score, solve_from([start], preparation))


def begun_from(other: Refit, score: EffectScore) -> list[AbstractBlock]:
    """The trial that the residual resembles most, round the base of another refit and with the
    numbers that the two laws share, and what lies beyond where the other is its special case: what
    one has found of a mode, one that it contains, or that contains it, need not look for."""
    layer, trial = other.layer, score.trials[score.best]
    found = named_parameters(getattr(other.solved.block, layer.place))
    shared = {
        name: np.clip(found[name].value, parameter.lower, parameter.upper)
        for name, parameter in named_parameters(trial).items()
        if name in found and np.shape(found[name].value) == np.shape(parameter.value)
    }
    inside, begun = getattr(other.solved.block, layer.inside), set_values(trial, shared)
    beyond = score.effect.beyond(begun) if other.name == score.effect.special_case else ()
    return [score.effect.insert(inside, block) for block in (begun, *beyond)]


def _of_one_kind(
    score: EffectScore,
    stage: Stage,
    fits: list[AbstractBlock],
    seed: int,
    hopeless: float,
    found: Sequence[AbstractBlock],
) -> Refit:
    """The refit with trials of one structure."""
    effect, nominal = score.effect, stage.start()
    generator = np.random.default_rng(seed)
    # The more shapes a law has, the more basins.
    shapes = sum(size for _, size in layout_of(score.trials[score.best]).shapes)
    promising = [score.trials[k] for k in unlike(score, max(_LEAST_APART, shapes))]
    best = promising[0]

    starts = [
        *(effect.insert(fits[0], trial) for trial in promising),
        *(effect.insert(fitted, best) for fitted in fits[1:]),
        *(effect.insert(nominal, trial) for trial in promising),
        *(_drawn(effect.insert(nominal, best), generator) for _ in range(_DRAWS)),
    ]
    starts = [*(block for block in found if kind_of(block) == kind_of(starts[0])), *starts]
    return Refit(score, _searched(starts, stage.preparation, hopeless))


def _drawn(block: AbstractBlock, generator: np.random.Generator) -> AbstractBlock:
    """The block with its shapes drawn from the priors."""
    parameters = named_parameters(block)
    shapes = [name for name, _ in layout_of(block).shapes]
    return set_values(block, {n: parameters[n].draw(generator) for n in shapes})


def sought_further(attempt: Refit, stage: Stage, seed: int) -> Refit:
    """The refit again from where it stands and from more draws; the same where they find nothing
    better."""
    generator = np.random.default_rng([seed, 1])
    nominal = attempt.layer.effect.insert(stage.start(), attempt.layer.trial)
    starts = [attempt.solved.block, *(_drawn(nominal, generator) for _ in range(_FURTHER_DRAWS))]
    solved = _searched(starts, stage.preparation, np.inf)
    better = attempt.solved.cost - solved.cost > _BETTER
    return Refit(attempt.score, solved) if better else attempt


def within_usual_ranges(attempt: Refit, stage: Stage, loss: float) -> Refit:
    """The fit with the effect's own shapes in their usual ranges, where it loses no more in χ².

    Only data that need an unusual value speak against an effect; an optimum may lie far out in a
    flat valley.
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


def _searched(starts: list[AbstractBlock], preparation: Preparation, hopeless: float) -> Solved:
    """The best of the starts, found on a coarse grid where the recordings' own is fine and long,
    and finished on that."""
    steps = sum(len(take.recording) for take in preparation.takes) * preparation.oversampling
    if preparation.oversampling < _COARSER or steps < _LONG:
        return solve_from(starts, preparation, hopeless)
    coarse = preparation.with_oversampling(preparation.oversampling // _COARSER)
    return solve_from([solve_from(starts, coarse, hopeless).block], preparation, hopeless)


def unlike(score: EffectScore, most: int) -> list[int]:
    """Up to `most` trials: the one that the residual resembles most, and of those that it resembles
    too the ones least like that, for neighbours would lead into the same basin, and trials that
    differ in gains alone are one start."""
    strength = np.zeros(score.z.size)
    for family in map(list, score.families):
        leading = family[int(np.argmax(np.abs(score.z[family])))]
        strength[leading] = abs(score.z[leading])
    chosen = [score.best]
    alike = np.abs(score.directions @ score.directions[score.best])
    for _ in range(most - 1):
        open_ = (strength > _RESEMBLES * strength.max()) & (alike < 1 - 1e-6)
        if not open_.any():
            break
        chosen.append(int(np.argmin(np.where(open_, alike, np.inf))))
        alike = np.maximum(alike, np.abs(score.directions @ score.directions[chosen[-1]]))
    return chosen
