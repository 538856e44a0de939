"""What a stage leaves: every effect's score, every place's, and whether that is beyond noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .._blocks import EFFECTS
from .._computing import map_in_threads
from .._solve import Progress, Solved
from ._judgement import SIGNIFICANCE, freedom_of
from ._locate import locate
from ._residual import residual_of
from ._result import Axis
from ._score import EffectScore, Residual, Scorer, family_wise_p
from ._stage import Stage


@dataclass(frozen=True)
class Detection:
    """What the residual of a stage shows: every effect's score, every axis' map, one p-value.

    `hidden` is the p-value about the best fit within the usual ranges, where the fit has left them
    and shows nothing.
    """

    scores: list[EffectScore]
    axes: list[Axis]
    p_value: float
    hidden: float = 1.0

    @property
    def height(self) -> float:
        """The largest score of any effect, in noise units."""
        return max(score.height for score in self.scores)

    @property
    def least(self) -> float:
        """The lesser of both."""
        return min(self.p_value, self.hidden)


def detect(stage: Stage, seed: int, progress: Progress) -> Detection:
    """Score every effect not yet adopted and every place; one p-value, Holm-adjusted."""
    progress(f"testing what {stage.name} leaves")
    problems = stage.preparation.problems()
    residual = residual_of(stage.solved)
    scores = scored(stage, stage.solved, residual)
    progress("locating the mismatch")
    freedom = freedom_of(stage.preparation, stage.solved.kurtosis)
    axes = locate(stage.preparation, problems, residual, freedom)
    tests = [family_wise_p(scores, freedom, seed), *(axis.p_value for axis in axes)]
    found = Detection(scores, axes, min(1.0, min(tests) * len(tests)))
    if found.p_value < SIGNIFICANCE or stage.layers or not stage.displaced:
        return found
    within = scored_within(stage, progress)
    return replace(found, hidden=min(1.0, 2 * family_wise_p(within, freedom, seed)))


def scored_within(stage: Stage, progress: Progress) -> list[EffectScore]:
    """Every effect not yet adopted, scored about the best fit within the usual ranges."""
    progress(f"testing what {stage.name} leaves within its usual ranges")
    kept = stage.undisplaced
    return scored(stage, kept, residual_of(kept))


def scored(stage: Stage, solved: Solved, residual: Residual) -> list[EffectScore]:
    """Every effect not yet adopted, scored about a fit and what it leaves."""
    scorer = Scorer(solved.blocks, stage.preparation.problems(), residual)
    setting = stage.preparation.setting
    others = [effect for name, effect in EFFECTS.items() if name not in stage.adopted]
    return map_in_threads(lambda effect: scorer.score(effect, setting), others)
