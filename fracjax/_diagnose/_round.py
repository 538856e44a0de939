"""One round: which effects are refitted, and how each of them satisfies the naming rule."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from .._blocks import AbstractBlock, Effect
from .._parameters import named_parameters, set_values
from .._solve import Progress, Solved, refine_until_accurate, solve_from
from ._detect import scored_within
from ._evidence import delta_bic, spared
from ._held_out import Predict, Prediction, gain, predict_stretches, predicts_worse
from ._judgement import (
    DELTA_BIC,
    EXPLAINED,
    SMALL,
    Judged,
    best_of,
    excess_doubt,
    explained_fraction,
    is_plausible,
    least_share,
    rivals_of,
    unusual_loss,
)
from ._refit import Refit, refit, refit_further, starts_from, within_usual_ranges
from ._score import EffectScore, confusability
from ._stage import Stage

_SHORTLIST, _LONGEST_SHORTLIST = 4, 8
"""Effects that are refitted by rank, and with those similar to them; chosen by judgement."""
_LIKE = 0.9
"""|cos| between signatures, and ratio of scores, from which effects are similar; chosen by
judgement."""
_HALF, _NEARLY, _MUCH = 0.5, 0.9, 0.05
"""Shares of a gain that count as half, as nearly all and as much of it; chosen by judgement."""


def judge(
    base: Stage,
    stage: Stage,
    scores: list[EffectScore],
    predict: Predict,
    seed: int,
    progress: Progress,
    started: Mapping[str, Sequence[AbstractBlock]],
    hopeless: float = np.inf,
    least: float | None = None,
) -> list[Judged]:
    """Refit the shortlist, each effect also from the blocks in `started`, and compute every figure
    that the naming rule requires.

    `hopeless` is the χ² above which a refit may be given up; `least` is the gain in χ² that the
    score of an effect must promise, by default what could be adopted.
    """

    @cache
    def before(predict: Predict) -> Prediction:
        return predict(stage.solved)

    candidates: list[tuple[_Question, Judged]] = []
    if least is None:
        # An effect with a small share may still be named if it explains the whole residual.
        share = min(least_share(base, stage) * base.excess, _HALF * stage.excess)
        least = max(DELTA_BIC + float(np.log(stage.solved.samples)), share)
    shortlist, blocks = _candidates(stage, scores, least, progress)
    waiting = list(shortlist)
    while waiting:
        score = waiting.pop(0)
        progress(f"refitting with {score.effect.name}")
        # A rival that has not gained half as much as the best after its first steps will not
        # overtake it, unless its score promises as much: some valleys are long.
        promised = stage.solved.cost - score.promised
        enough = np.inf if promised <= hopeless else hopeless
        attempt = refit(score, stage, blocks, seed, enough, started.get(score.effect.name, ()))
        if stage.solved.cost - attempt.solved.cost >= least and attempt.solved.cost <= hopeless:
            attempt = _kept_usual(attempt, stage)
        hopeless = min(hopeless, 0.5 * (stage.solved.cost + attempt.solved.cost))
        question = _Question(base, stage, attempt, before, predict)
        candidates.append((question, question.answered(attempt.solved, 0.0)))
        if not waiting:
            answers = [judged for _, judged in candidates]
            waiting = _look_alikes_missed(answers, scores) or _passed_over(answers, scores, least)
    if predict is not predict_stretches:
        candidates = _judged_by_stretches(candidates)
    candidates = _refitted_further(stage.solved, candidates, seed, progress)
    return _contenders_refined(stage.solved, candidates, seed, progress)


def _judged_by_stretches(
    candidates: list[tuple[_Question, Judged]],
) -> list[tuple[_Question, Judged]]:
    """The candidates, judged by stretches if none that explains the training recordings predicts
    the held-out one.

    Then the training determines the base model so loosely that the held-out recording shows nothing
    about the effects.
    """
    explaining = [j for _, j in candidates if j.explained >= EXPLAINED]
    if not explaining or any(
        j.gain.agrees_with_training(j.solved.excess_ratio) for j in explaining
    ):
        return candidates
    by_stretches = [(replace(q, held_out_is_uninformative=True), j) for q, j in candidates]
    return [(q, q.answered(j.solved, j.numerics)) for q, j in by_stretches]


def _candidates(
    stage: Stage, scores: list[EffectScore], least: float, progress: Progress
) -> tuple[list[EffectScore], list[AbstractBlock]]:
    """The effects to refit, and the fits to start from.

    If the fit lies outside its usual ranges, that may hide a missing effect: the effects are then
    also scored at the best fit within them.
    """
    listed, blocks = _shortlist(scores, least), [stage.solved.block]
    if not stage.displaced:
        return listed, blocks
    more = _shortlist(scored_within(stage, progress), least)
    values = {name: p.value for name, p in named_parameters(stage.undisplaced.block).items()}
    blocks.append(set_values(stage.solved.block, values))
    together = [*listed[:_SHORTLIST], *more[:_SHORTLIST], *listed[_SHORTLIST:]]
    return list({score.effect.name: score for score in reversed(together)}.values())[::-1], blocks


def _shortlist(scores: list[EffectScore], least: float) -> list[EffectScore]:
    """The effects with the most evidence, those similar to them, and those whose score is nearly
    the largest."""
    promising = _promising(scores, least)
    ranked = sorted(promising, key=lambda s: -s.log_evidence)
    # Far from the base a score may even have the wrong sign: the largest one is tried too.
    largest = sorted(promising, key=lambda s: -s.height)[:1]
    top = ranked[:_SHORTLIST] + [s for s in largest if s not in ranked[:_SHORTLIST]]
    rest = [s for s in ranked if s not in top]
    alike = [s for s in rest if any(confusability(s, t) > _LIKE for t in top)]
    near = [s for s in rest if s not in alike and s.height > _LIKE * largest[0].height]
    return [*top, *alike, *near][:_LONGEST_SHORTLIST]


def _promising(scores: list[EffectScore], least: float) -> list[EffectScore]:
    """The effects worth a refit: its gain in χ² is about what the score promises, and twice that
    must reach `least`."""
    return [s for s in scores if 2 * s.promised >= least]


def _look_alikes_missed(candidates: list[Judged], scores: list[EffectScore]) -> list[EffectScore]:
    """Effects that the catalogue lists as look-alikes of the best, and that were not refitted."""
    best = best_of(candidates)
    if best is None:
        return []
    refitted = {judged.name for judged in candidates}
    return [
        score
        for score in scores
        if score.effect.name not in refitted
        and _look_alike(score.effect, best.layer.effect)
        and score.promised >= DELTA_BIC
    ]


def _passed_over(
    candidates: list[Judged], scores: list[EffectScore], least: float
) -> list[EffectScore]:
    """Every other promising effect, if none that may be named explains half of the mismatch: there
    is little evidence for a large effect that the base has mostly absorbed."""
    best = best_of(candidates)
    if best is not None and best.explained >= _HALF:
        return []
    refitted = {judged.name for judged in candidates}
    rest = [score for score in _promising(scores, least) if score.effect.name not in refitted]
    return sorted(rest, key=lambda s: -s.log_evidence)


def _look_alike(one: Effect, other: Effect) -> bool:
    """Whether the catalogue lists an experiment that distinguishes the two."""
    return one.name in other.separated_by or other.name in one.separated_by


def _kept_usual(attempt: Refit, stage: Stage) -> Refit:
    """The refit within its usual ranges, if that costs little of its gain."""
    fall = stage.solved.cost - attempt.solved.cost
    return within_usual_ranges(attempt, stage, unusual_loss(fall))


@dataclass(frozen=True)
class _Question:
    """A refitted candidate, the stages that it is compared with, and whether the held-out recording
    is uninformative about it."""

    base: Stage
    stage: Stage
    attempt: Refit
    before: Callable[[Predict], Prediction]
    predict: Predict
    held_out_is_uninformative: bool = False

    def answered(self, solved: Solved, numerics: float) -> Judged:
        """The candidate with every figure that the naming rule requires."""
        worse = False
        # A recording that does not show the effect is no evidence for it or against it.
        for predict in (self.predict, predict_stretches):
            before, prediction = self.before(predict), predict(solved)
            gained = gain(before, prediction)
            worse = worse or predicts_worse(predict, before, prediction)
            is_uninformative = gained.is_open or self.held_out_is_uninformative
            if predict is predict_stretches or not is_uninformative:
                break
        return Judged(
            refit=replace(self.attempt, solved=solved),
            delta_bic=delta_bic(self.stage.solved, solved),
            altogether=delta_bic(self.base.solved, solved),
            spared=spared(solved, self.attempt.layer),
            conceded=self.attempt.conceded / solved.excess_ratio,
            explained=explained_fraction(self.base, solved),
            numerics=numerics,
            gain=gained,
            predicts_worse=worse,
            prediction=prediction,
            predict=predict,
            plausible=is_plausible(self.stage.solved, solved, self.attempt.layer),
        )


def _refitted_further(
    before: Solved, candidates: list[tuple[_Question, Judged]], seed: int, progress: Progress
) -> list[tuple[_Question, Judged]]:
    """The candidates, with those that decide the name refitted from more starts, since an optimum
    that is only local may decide it.

    These are the best and its rivals.  If even the best residual exceeds the noise, because another
    effect is missing or its model is inexact, they are those with the largest gains.
    """
    if not candidates:
        return candidates
    judged = [answer for _, answer in candidates]
    fitting = min(judged, key=lambda j: j.solved.cost)
    doubt = excess_doubt(fitting.solved)
    if fitting.solved.cost > fitting.solved.samples * (1 + doubt):
        deciding = sorted(_gaining(before, judged, 0.0), key=lambda k: -judged[k].delta_bic)
    else:
        best = best_of(judged)
        near = [] if best is None else [best, *rivals_of(best, judged)]
        deciding = [judged.index(j) for j in near] if len(near) > 1 else []
    again = list(candidates)
    for k in deciding[:_SHORTLIST]:
        question, answer = candidates[k]
        progress(f"refitting with {answer.name} from more starts")
        attempt = refit_further(question.attempt, question.stage, seed)
        if attempt is not question.attempt:
            question = replace(question, attempt=_kept_usual(attempt, question.stage))
            again[k] = question, question.answered(question.attempt.solved, 0.0)
    return again


def _contenders_refined(
    before: Solved, candidates: list[tuple[_Question, Judged]], seed: int, progress: Progress
) -> list[Judged]:
    """The candidates, with the discretisation of those refined that matter: the best, its rivals,
    and those that gain nearly as much, since of two modes the one on a coarse grid would fall
    behind.

    If none is admissible, those that gain at least half of the largest gain are refined: on too
    coarse a grid a mode seems damped, and the parameter that compensates for it implausible.  If a
    finer grid improves one, or it is the best, its look-alikes are refitted on that grid from its
    optimum.  If the grid improves it much, they are refitted from all starts, since on the coarse
    grid they may have ended at a distant optimum.
    """
    candidates = list(candidates)
    share = _NEARLY if best_of([answer for _, answer in candidates]) else _HALF
    checked: set[int] = set()
    refitted: set[int] = set()
    while True:
        judged = [answer for _, answer in candidates]
        best = best_of(judged)
        near = [] if best is None else [best, *rivals_of(best, judged)]
        gaining = _gaining(before, judged, share)
        deciding = gaining | {k for k, j in enumerate(judged) if j in near}
        todo = sorted(deciding - checked)
        if not todo:
            return judged
        k = todo[0]
        question, coarse = candidates[k]
        refined = _refined(question, coarse, progress)
        candidates[k] = question, refined
        checked.add(k)
        gained = coarse.solved.cost - refined.solved.cost
        if gained >= DELTA_BIC or coarse is best:
            alike = {
                k for k, j in enumerate(judged) if _look_alike(j.layer.effect, refined.layer.effect)
            }
            for i in sorted(alike - refitted):
                progress(f"refitting with {judged[i].name} from the optimum of {refined.name}")
                anew = gained >= max(DELTA_BIC, _MUCH * (before.bic - refined.solved.bic))
                better = _refitted_from_other(refined, *candidates[i], seed, anew=anew)
                if better is not None:
                    candidates[i] = better
                    checked.discard(i)
                    refitted.add(i)


def _refined(question: _Question, judged: Judged, progress: Progress) -> Judged:
    """A candidate on a grid that is fine enough, within its usual ranges if that costs little."""
    solved, numerics = refine_until_accurate(judged.solved, progress, SMALL)
    attempt = replace(question.attempt, solved=solved)
    kept = _kept_usual(attempt, question.stage.on(solved.preparation))
    if kept is not attempt:
        question = replace(question, attempt=kept)
        solved, numerics = refine_until_accurate(kept.solved, progress, SMALL)
    return question.answered(solved, numerics)


def _refitted_from_other(
    other: Judged, question: _Question, answer: Judged, seed: int, *, anew: bool
) -> tuple[_Question, Judged] | None:
    """A candidate refitted on another's grid from that one's optimum, and with `anew` from every
    start; None if that is no better."""
    stage = question.stage.on(other.preparation)
    score = question.attempt.score
    starts = starts_from(other.refit, score)
    if anew:
        attempt = refit(score, stage, [stage.solved.block], seed, np.inf, starts)
    else:
        attempt = Refit(score, solve_from(starts, stage.preparation, answer.solved.cost))
    if answer.solved.cost - attempt.solved.cost < DELTA_BIC:
        return None
    question = replace(question, attempt=_kept_usual(attempt, stage))
    return question, question.answered(question.attempt.solved, 0.0)


def _gaining(before: Solved, judged: list[Judged], share: float) -> set[int]:
    """The indices of candidates that gain at least a share of the largest gain over a fit.

    The gains are in BIC with χ² not divided by the excess of each fit: the residual of a mode on a
    grid that is too coarse would otherwise count against it twice.
    """
    gains = [before.bic - j.solved.bic for j in judged]
    most = max(gains, default=0.0)
    return {k for k, gained in enumerate(gains) if gained >= max(share * most, DELTA_BIC)}
