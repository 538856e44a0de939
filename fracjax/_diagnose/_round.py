"""One round: which effects are refitted, and how each of them answers the naming rule."""

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
from ._held_out import Predict, Prediction, foretells_worse, gain, predict_stretches
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
from ._refit import Refit, begun_from, refit, sought_further, within_usual_ranges
from ._score import EffectScore, confusability
from ._stage import Stage

_SHORTLIST, _LONGEST_SHORTLIST = 4, 8
_LIKE = 0.9
_HALF, _NEARLY, _MUCH = 0.5, 0.9, 0.05


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
    """Refit the shortlist, each also from where it `started`, if anywhere, and put every candidate
    to the naming rule's questions.

    `least` is what an effect must promise to gain in χ², by default what could be adopted.
    """

    @cache
    def before(predict: Predict) -> Prediction:
        return predict(stage.solved)

    found: list[tuple[_Question, Judged]] = []
    if least is None:
        # What takes a small share may still be named if it takes all that is left.
        share = min(least_share(base, stage) * base.excess, _HALF * stage.excess)
        least = max(DELTA_BIC + float(np.log(stage.solved.samples)), share)
    candidates, blocks = _candidates(stage, scores, least, progress)
    waiting = list(candidates)
    while waiting:
        score = waiting.pop(0)
        progress(f"refitting with {score.effect.name}")
        # A rival that is not halfway to the best after its first steps will not overtake it, unless
        # its score promises as much: some valleys are long.
        promised = stage.solved.cost - score.promised
        enough = np.inf if promised <= hopeless else hopeless
        attempt = refit(score, stage, blocks, seed, enough, started.get(score.effect.name, ()))
        if stage.solved.cost - attempt.solved.cost >= least and attempt.solved.cost <= hopeless:
            attempt = _kept_usual(attempt, stage)
        hopeless = min(hopeless, 0.5 * (stage.solved.cost + attempt.solved.cost))
        question = _Question(base, stage, attempt, before, predict)
        found.append((question, question.answered(attempt.solved, 0.0)))
        if not waiting:
            answers = [judged for _, judged in found]
            waiting = _look_alikes_missed(answers, scores) or _passed_over(answers, scores, least)
    if predict is not predict_stretches:
        found = _told_by_stretches(found)
    found = _sought_further(stage.solved, found, seed, progress)
    return _contenders_refined(stage.solved, found, seed, progress)


def _told_by_stretches(
    found: list[tuple[_Question, Judged]],
) -> list[tuple[_Question, Judged]]:
    """The judged, by stretches where none that explains the training foretells what was held out.

    Then the training leaves the base's own law so open that such a recording says nothing of what
    was added to it.
    """
    explaining = [j for _, j in found if j.explained >= EXPLAINED]
    if not explaining or any(j.gain.foretells(j.solved.excess_ratio) for j in explaining):
        return found
    told = [(replace(question, held_out_is_silent=True), judged) for question, judged in found]
    return [(q, q.answered(j.solved, j.numerics)) for q, j in told]


def _candidates(
    stage: Stage, scores: list[EffectScore], least: float, progress: Progress
) -> tuple[list[EffectScore], list[AbstractBlock]]:
    """The effects to refit, and the fits to start from.

    Where the fit has left its usual ranges, what is missing may be hidden by that: then the effects
    are scored about the best fit within them too.
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
    """The effects with the most evidence, those that look like them, and those that score nearly
    as much as any."""
    promising = _promising(scores, least)
    ranked = sorted(promising, key=lambda s: -s.log_evidence)
    # Far from the base a secant may even have the wrong sign: the largest score is tried too.
    largest = sorted(promising, key=lambda s: -s.height)[:1]
    top = ranked[:_SHORTLIST] + [s for s in largest if s not in ranked[:_SHORTLIST]]
    rest = [s for s in ranked if s not in top]
    alike = [s for s in rest if any(confusability(s, t) > _LIKE for t in top)]
    near = [s for s in rest if s not in alike and s.height > _LIKE * largest[0].height]
    return [*top, *alike, *near][:_LONGEST_SHORTLIST]


def _promising(scores: list[EffectScore], least: float) -> list[EffectScore]:
    """What a refit gains in χ² is about what the score promises; where even twice that is less than
    `least`, none is made."""
    return [s for s in scores if 2 * s.promised >= least]


def _look_alikes_missed(found: list[Judged], scores: list[EffectScore]) -> list[EffectScore]:
    """Effects that the catalogue knows as look-alikes of the best, and that were not refitted."""
    best = best_of(found)
    if best is None:
        return []
    refitted = {judged.name for judged in found}
    return [
        score
        for score in scores
        if score.effect.name not in refitted
        and _look_alike(score.effect, best.layer.effect)
        and score.promised >= DELTA_BIC
    ]


def _passed_over(found: list[Judged], scores: list[EffectScore], least: float) -> list[EffectScore]:
    """Every other promising effect, where none that may be named explains half of the mismatch:
    what the base has absorbed of a large effect leaves little evidence for it."""
    best = best_of(found)
    if best is not None and best.explained >= _HALF:
        return []
    refitted = {judged.name for judged in found}
    rest = [score for score in _promising(scores, least) if score.effect.name not in refitted]
    return sorted(rest, key=lambda s: -s.log_evidence)


def _look_alike(one: Effect, other: Effect) -> bool:
    """Whether the catalogue says how to tell the two apart."""
    return one.name in other.separated_by or other.name in one.separated_by


def _kept_usual(attempt: Refit, stage: Stage) -> Refit:
    """The refit within its usual ranges, where that costs little of what it gains."""
    fall = stage.solved.cost - attempt.solved.cost
    return within_usual_ranges(attempt, stage, unusual_loss(fall))


@dataclass(frozen=True)
class _Question:
    """A refitted candidate, what it is to be compared with, and whether the recording held out can
    say nothing of it."""

    base: Stage
    stage: Stage
    attempt: Refit
    before: Callable[[Predict], Prediction]
    predict: Predict
    held_out_is_silent: bool = False

    def answered(self, solved: Solved, numerics: float) -> Judged:
        """Everything the naming rule asks."""
        worse = False
        # A recording that does not show the effect can say nothing for it or against it.
        for predict in (self.predict, predict_stretches):
            before, prediction = self.before(predict), predict(solved)
            gained = gain(before, prediction)
            worse = worse or foretells_worse(predict, before, prediction)
            if predict is predict_stretches or not (gained.is_open or self.held_out_is_silent):
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
            foretells_worse=worse,
            prediction=prediction,
            predict=predict,
            plausible=is_plausible(self.stage.solved, solved, self.attempt.layer),
        )


def _sought_further(
    before: Solved, found: list[tuple[_Question, Judged]], seed: int, progress: Progress
) -> list[tuple[_Question, Judged]]:
    """Those from more starts on whose order the name depends, for a basin that no start has left
    may decide it: where even the best leaves more than noise, as do another effect and a law unlike
    ours too, those that gain most; else the best and its rivals."""
    if not found:
        return found
    judged = [answer for _, answer in found]
    fitting = min(judged, key=lambda j: j.solved.cost)
    doubt = excess_doubt(fitting.solved)
    if fitting.solved.cost > fitting.solved.samples * (1 + doubt):
        asked = sorted(_gaining(before, judged, 0.0), key=lambda k: -judged[k].delta_bic)
    else:
        best = best_of(judged)
        near = [] if best is None else [best, *rivals_of(best, judged)]
        asked = [judged.index(j) for j in near] if len(near) > 1 else []
    again = list(found)
    for k in asked[:_SHORTLIST]:
        question, answer = found[k]
        progress(f"refitting with {answer.name} from more starts")
        attempt = sought_further(question.attempt, question.stage, seed)
        if attempt is not question.attempt:
            question = replace(question, attempt=_kept_usual(attempt, question.stage))
            again[k] = question, question.answered(question.attempt.solved, 0.0)
    return again


def _contenders_refined(
    before: Solved, found: list[tuple[_Question, Judged]], seed: int, progress: Progress
) -> list[Judged]:
    """The judged, their numerics checked where it matters: of the best, of its rivals and of what
    gains nearly as much, for of two modes that one would fall behind whose grid stays coarse.

    Where none is admissible, of those that gain at least half of what any does: on too coarse a
    grid a mode seems damped, and the number that makes up for it implausible.  Where a finer grid
    makes more of one, its look-alikes begin there from where that ended, as those of the best do;
    where it makes much more, they are sought there anew: on the coarse one they may have ended far
    off.
    """
    found = list(found)
    share = _NEARLY if best_of([answer for _, answer in found]) else _HALF
    checked: set[int] = set()
    sought: set[int] = set()
    while True:
        judged = [answer for _, answer in found]
        best = best_of(judged)
        near = [] if best is None else [best, *rivals_of(best, judged)]
        asked = _gaining(before, judged, share) | {k for k, j in enumerate(judged) if j in near}
        todo = sorted(asked - checked)
        if not todo:
            return judged
        k = todo[0]
        question, coarse = found[k]
        refined = _refined(question, coarse, progress)
        found[k] = question, refined
        checked.add(k)
        gained = coarse.solved.cost - refined.solved.cost
        if gained >= DELTA_BIC or coarse is best:
            alike = {
                k for k, j in enumerate(judged) if _look_alike(j.layer.effect, refined.layer.effect)
            }
            for i in sorted(alike - sought):
                progress(f"refitting with {judged[i].name} from where {refined.name} ended")
                anew = gained >= max(DELTA_BIC, _MUCH * (before.bic - refined.solved.bic))
                beside = _sought_beside(refined, *found[i], seed, anew=anew)
                if beside is not None:
                    found[i] = beside
                    checked.discard(i)
                    sought.add(i)


def _refined(question: _Question, judged: Judged, progress: Progress) -> Judged:
    """A candidate on a grid that is fine enough, in its usual ranges where that costs little."""
    solved, numerics = refine_until_accurate(judged.solved, progress, SMALL)
    attempt = replace(question.attempt, solved=solved)
    kept = _kept_usual(attempt, question.stage.on(solved.preparation))
    if kept is not attempt:
        question = replace(question, attempt=kept)
        solved, numerics = refine_until_accurate(kept.solved, progress, SMALL)
    return question.answered(solved, numerics)


def _sought_beside(
    other: Judged, question: _Question, answer: Judged, seed: int, *, anew: bool
) -> tuple[_Question, Judged] | None:
    """A candidate refitted on another's grid from where that ended, and `anew` from every start;
    none where that finds nothing better."""
    stage = question.stage.on(other.preparation)
    score = question.attempt.score
    starts = begun_from(other.refit, score)
    if anew:
        attempt = refit(score, stage, [stage.solved.block], seed, np.inf, starts)
    else:
        attempt = Refit(score, solve_from(starts, stage.preparation, answer.solved.cost))
    if answer.solved.cost - attempt.solved.cost < DELTA_BIC:
        return None
    question = replace(question, attempt=_kept_usual(attempt, stage))
    return question, question.answered(question.attempt.solved, 0.0)


def _gaining(before: Solved, judged: list[Judged], share: float) -> set[int]:
    """Which of them gain on a fit at least a share of what any gains.

    In χ² undivided by what each leaves: what a grid too coarse for a mode leaves over would count
    against it twice, as gained by another and as noise.
    """
    gains = [before.bic - j.solved.bic for j in judged]
    most = max(gains, default=0.0)
    return {k for k, gained in enumerate(gains) if gained >= max(share * most, DELTA_BIC)}
