"""The residual of a stage: the score of every effect and every place, and its significance."""

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
    """The test of a stage's residual: the score of every effect, the map of every axis, and one
    p-value.

    `hidden` is the p-value of the best fit within the usual ranges, if the fit itself lies outside
    them and its residual is not significant.
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
        """The smaller of both p-values."""
        return min(self.p_value, self.hidden)


def detect(stage: Stage, seed: int, progress: Progress) -> Detection:
    """Score every effect not yet adopted and every place, with one p-value, adjusted for the number
    of tests."""
    progress(f"testing the residual of {stage.name}")
    problems = stage.preparation.problems()
    residual = residual_of(stage.solved)
    scores = scored(stage, stage.solved, residual)
    progress("locating the mismatch")
    freedom = freedom_of(stage.preparation, stage.solved.kurtosis)
    axes = locate(stage.preparation, problems, residual, freedom)
    tests = [family_wise_p(scores, freedom, seed), *(axis.p_value for axis in axes)]
    detection = Detection(scores, axes, min(1.0, min(tests) * len(tests)))
    if detection.p_value < SIGNIFICANCE or stage.layers or not stage.displaced:
        return detection
    within = scored_within(stage, progress)
    return replace(detection, hidden=min(1.0, 2 * family_wise_p(within, freedom, seed)))


def scored_within(stage: Stage, progress: Progress) -> list[EffectScore]:
    """The scores of every effect not yet adopted at the best fit within the usual ranges."""
    progress(f"testing the residual of {stage.name} within its usual ranges")
    kept = stage.undisplaced
    return scored(stage, kept, residual_of(kept))


def scored(stage: Stage, solved: Solved, residual: Residual) -> list[EffectScore]:
    """The scores of every effect not yet adopted, for a fit and its residual."""
    scorer = Scorer(solved.blocks, stage.preparation.problems(), residual)
    setting = stage.preparation.setting
    others = [effect for name, effect in EFFECTS.items() if name not in stage.adopted]
    return map_in_threads(lambda effect: scorer.score(effect, setting), others)
