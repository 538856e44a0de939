"""The rounds of a diagnosis: detect, locate, shortlist, refit, adopt, and delete backwards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from .._blocks import EFFECTS, AbstractBlock, Effect
from .._fit import LIMIT, Preparation, Progress, Solved, fine_enough, residual_noise
from .._parameters import named_parameters, set_values
from ._evidence import delta_bic, spared
from ._held_out import Predict, Prediction, foretells_worse, gain, predict_stretches
from ._judgement import (
    DELTA_BIC,
    SIGNIFICANCE,
    WORTH_NAMING,
    Judged,
    best_of,
    excess_doubt,
    explained_fraction,
    freedom_of,
    is_exhausted,
    is_plausible,
    rivals_of,
    share_of_excess,
    unusual_loss,
)
from ._locate import locate
from ._refit import Refit, refit, sought_further, within_usual_ranges
from ._residual import residual_of
from ._result import Axis
from ._score import EffectScore, Residual, Scorer, confusability, family_wise_p
from ._stage import Stage

_SHORTLIST, _LONGEST_SHORTLIST = 4, 8
_LIKE = 0.9
_ROUNDS = 3
_MOST_JUDGED_AGAIN = 4
_CLEARLY_LESS = 0.03
_HALF, _NEARLY = 0.5, 0.9
_SMALL = 0.1
"""No score is changed by more than the numerical error, which counts little beside ten times that:
without what is missing the base may fit best where it is hard to compute.  The refits answer for
their own errors."""


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


@dataclass(frozen=True)
class Round:
    """One effect adopted, among all that were refitted beside it."""

    winner: Judged
    found: list[Judged]


@dataclass(frozen=True)
class Course:
    """How a diagnosis went: what the base left, and whether that `is_real` or may be no more than
    the simulation's own error; the rounds, the stage it ended on and what the last test found; and
    the effect that was too small to be named beside those adopted."""

    first: Detection
    is_real: bool
    last: Detection
    rounds: list[Round]
    judged: dict[str, Judged]
    stage: Stage
    too_small: str | None


def run(base: Stage, numerics: float, predict: Predict, seed: int, progress: Progress) -> Course:
    """Adopt one effect after another while the residual shows one, then drop what became idle."""
    stage, rounds, judged, too_small = base, [], {}, None
    first = detection = _detect(base, seed, progress)
    # A mismatch that the simulation's own error may have made is never given a name.
    is_real = numerics <= max(LIMIT, _SMALL * first.height)
    while is_real and detection.least < SIGNIFICANCE:
        found = _judge(base, stage, detection.scores, predict, seed, progress)
        judged = {**{j.name: j for j in found}, **judged}
        winner = best_of(found)
        if winner is None:
            break
        extended = stage.extended(winner.layer, winner.solved, winner.preparation)
        if not _is_worth_naming(base, stage, winner):
            # Too small to stand beside what was adopted, it may yet be what that stood in for.
            superfluous = _superfluous(extended, progress)
            if superfluous is None:
                too_small = winner.name
                break
            k, extended = superfluous
            rounds.pop(k)
        rounds.append(Round(winner, found))
        stage = extended
        detection = _detect(stage, seed, progress)
        if len(rounds) == _ROUNDS:
            break
    stage, rounds, dropped = _reconsidered(base, stage, rounds, predict, seed, progress)
    too_small = dropped or too_small
    if too_small in stage.adopted:
        too_small = None
    return Course(first, is_real, detection, rounds, judged, stage, too_small)


def _least_share(base: Stage, stage: Stage) -> float:
    """The share of the base's excess below which a further effect is not looked for.

    A remainder under the noise, and far smaller than what was explained, may be no more than the
    adopted effect's own law being another than ours.
    """
    imitated = any(not layer.effect.foreign for layer in stage.layers)
    return WORTH_NAMING if imitated and is_exhausted(base, stage) else 0.0


def _superfluous(stage: Stage, progress: Progress) -> tuple[int, Stage] | None:
    """Which of the effects before the last that one has made superfluous, and the stage without
    it."""
    for k in range(len(stage.layers) - 1):
        less, is_missed = _deleted(stage, k, progress)
        if not is_missed:
            return k, less
    return None


def _deleted(stage: Stage, k: int, progress: Progress) -> tuple[Stage, bool]:
    """The stage without one of its effects, and whether its fit is the worse for it."""
    progress(f"fitting without {stage.layers[k].effect.name}")
    less = stage.without(k)
    return less, delta_bic(less.solved, stage.solved) >= DELTA_BIC


def _is_worth_naming(base: Stage, stage: Stage, winner: Judged) -> bool:
    """Whether a further effect takes a share that counts, of the recordings or of data held out,
    where the base conceals less of it; or is none that another's law could imitate."""
    least = _least_share(base, stage)
    if winner.layer.effect.foreign or share_of_excess(base, stage, winner) >= least:
        return True
    held_out = gain(winner.predict(base.solved, base.preparation), winner.prediction)
    return winner.gain.fall >= least * held_out.fall


def with_noise_beyond_mismatch(base: Stage, course: Course) -> Preparation | None:
    """The base's recordings, their noise read from what the best of the refits leaves over.

    Where nothing but a fit tells the noise, what the base left over holds the mismatch too; seen
    against that, a mismatch looks small.  None where no refit leaves clearly less.
    """
    if not any(
        take.noise is not None and take.noise.is_leftover for take in base.preparation.takes
    ):
        return None
    refits = [j.solved for j in course.judged.values() if j.plausible]
    found = [_seen_past(base, solved) for solved in (*refits, course.stage.solved)]
    gain, clearer = max(found, key=lambda pair: pair[0])
    if gain < DELTA_BIC:
        return None
    # A name that was given already would not change for a little less noise.
    matters = not course.rounds or _quietened(base.preparation, clearer) > _CLEARLY_LESS
    return clearer if matters else None


def _quietened(before: Preparation, after: Preparation) -> float:
    """The largest share of its noise that a recording has lost."""
    pairs = zip(before.takes, after.takes, strict=True)
    return max(1 - a.noise.sigma / b.noise.sigma for b, a in pairs if a.noise and b.noise)


def _seen_past(base: Stage, solved: Solved) -> tuple[float, Preparation]:
    """What a refit gains in BIC where each noise is the one that it leaves itself, and the
    recordings with those noises."""
    gain, noises = (base.solved.free - solved.free) * float(np.log(solved.samples)), []
    for take, simulation in zip(base.preparation.takes, solved.simulations, strict=True):
        noise = take.noise
        assert noise is not None  # a diagnosis has one
        if noise.is_leftover:
            again = residual_noise(take.recording.response - simulation, take.used, take.recording)
            count = np.count_nonzero(take.used)
            gain += float(2 * count * np.log(noise.innovation / again.innovation))
            if again.sigma > noise.sigma:  # another colour, but no less of it
                return -np.inf, base.preparation
            noise = again
        noises.append(noise)
    return gain, base.preparation.with_noises(noises)


def _detect(stage: Stage, seed: int, progress: Progress) -> Detection:
    """Score every effect not yet adopted and every place; one p-value, Holm-adjusted."""
    progress(f"testing what {stage.name} leaves")
    problems = stage.preparation.problems()
    residual = residual_of(stage.solved, stage.preparation)
    scores = _scored(stage, stage.solved, residual)
    progress("locating the mismatch")
    freedom = freedom_of(stage.preparation, stage.solved.kurtosis)
    axes = locate(stage.preparation, problems, residual, freedom)
    tests = [family_wise_p(scores, freedom, seed), *(axis.p_value for axis in axes)]
    found = Detection(scores, axes, min(1.0, min(tests) * len(tests)))
    if found.p_value < SIGNIFICANCE or stage.layers or not stage.displaced:
        return found
    within = _scored_within(stage, progress)
    return replace(found, hidden=min(1.0, 2 * family_wise_p(within, freedom, seed)))


def _scored_within(stage: Stage, progress: Progress) -> list[EffectScore]:
    """Every effect not yet adopted, scored about the best fit within the usual ranges."""
    progress(f"testing what {stage.name} leaves within its usual ranges")
    kept = stage.undisplaced
    return _scored(stage, kept, residual_of(kept, stage.preparation))


def _scored(stage: Stage, solved: Solved, residual: Residual) -> list[EffectScore]:
    """Every effect not yet adopted, scored about a fit and what it leaves."""
    scorer = Scorer(solved.blocks, stage.preparation.problems(), residual)
    setting = stage.preparation.setting
    others = [effect for name, effect in EFFECTS.items() if name not in stage.adopted]
    return [scorer.score(effect, setting) for effect in others]


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
    more = _shortlist(_scored_within(stage, progress), least)
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
    """What a refit gains in χ² is about z²; where even twice that is less than `least`, none is
    made."""
    return [s for s in scores if 2 * float(np.max(s.z**2)) >= least]


def _judge(
    base: Stage,
    stage: Stage,
    scores: list[EffectScore],
    predict: Predict,
    seed: int,
    progress: Progress,
    hopeless: float = np.inf,
) -> list[Judged]:
    """Refit the shortlist and put every candidate to the naming rule's questions."""

    @cache
    def before(predict: Predict) -> Prediction:
        return predict(stage.solved, stage.preparation)

    found: list[tuple[_Question, Judged]] = []
    least = DELTA_BIC + np.log(stage.solved.samples)
    # What takes a small share may still be named if it takes all that is left.
    least = max(least, min(_least_share(base, stage) * base.excess, _HALF * stage.excess))
    candidates, blocks = _candidates(stage, scores, least, progress)
    waiting = list(candidates)
    while waiting:
        score = waiting.pop(0)
        progress(f"refitting with {score.effect.name}")
        # A rival that is not halfway to the best after its first steps will not overtake it, unless
        # its score promises as much: some valleys are long.
        promised = stage.solved.cost - float(np.max(score.z**2))
        attempt = refit(score, stage, blocks, seed, np.inf if promised <= hopeless else hopeless)
        if stage.solved.cost - attempt.solved.cost >= least and attempt.solved.cost <= hopeless:
            attempt = _kept_usual(attempt, stage)
        hopeless = min(hopeless, 0.5 * (stage.solved.cost + attempt.solved.cost))
        question = _Question(base, stage, attempt, before, predict)
        found.append((question, question.answered(attempt.solved, stage.preparation, 0.0)))
        if not waiting:
            answers = [judged for _, judged in found]
            waiting = _look_alikes_missed(answers, scores) or _passed_over(answers, scores, least)
    found = _sought_further(stage.solved, found, seed, progress)
    return _contenders_refined(stage.solved, found, seed, progress)


def _kept_usual(attempt: Refit, stage: Stage) -> Refit:
    """The refit within its usual ranges, where that costs little of what it gains."""
    fall = stage.solved.cost - attempt.solved.cost
    return within_usual_ranges(attempt, stage, unusual_loss(fall))


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
        and np.max(score.z**2) >= DELTA_BIC
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


@dataclass(frozen=True)
class _Question:
    """A refitted candidate, and what it is to be compared with."""

    base: Stage
    stage: Stage
    attempt: Refit
    before: Callable[[Predict], Prediction]
    predict: Predict

    def answered(self, solved: Solved, preparation: Preparation, numerics: float) -> Judged:
        """Everything the naming rule asks."""
        worse = False
        # A recording that does not show the effect can say nothing for it or against it.
        for predict in (self.predict, predict_stretches):
            before, prediction = self.before(predict), predict(solved, preparation)
            gained = gain(before, prediction)
            worse = worse or foretells_worse(predict, before, prediction)
            if predict is predict_stretches or not gained.is_open:
                break
        return Judged(
            refit=replace(self.attempt, solved=solved),
            preparation=preparation,
            delta_bic=delta_bic(self.stage.solved, solved),
            altogether=delta_bic(self.base.solved, solved),
            spared=spared(solved, preparation, self.attempt.layer),
            conceded=self.attempt.conceded / solved.left,
            explained=explained_fraction(self.base, solved),
            numerics=numerics,
            gain=gained,
            foretells_worse=worse,
            prediction=prediction,
            predict=predict,
            plausible=is_plausible(solved, self.attempt.layer),
        )


def _contenders_refined(
    before: Solved, found: list[tuple[_Question, Judged]], seed: int, progress: Progress
) -> list[Judged]:
    """The judged, their numerics checked where it matters: of the best, of its rivals and of what
    gains nearly as much, for of two modes that one would fall behind whose grid stays coarse.

    Where none is admissible, of those that gain at least half of what any does: on too coarse a
    grid a mode seems damped, and the number that makes up for it implausible.  Where a finer grid
    makes more of one, its look-alikes are sought on that grid too: on the coarse one they may have
    ended far off.
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
        if coarse.solved.cost - refined.solved.cost >= DELTA_BIC:
            alike = {
                k for k, j in enumerate(judged) if _look_alike(j.layer.effect, refined.layer.effect)
            }
            for i in sorted(alike - checked - sought):
                progress(f"refitting with {judged[i].name} on the grid of {refined.name}")
                found[i] = _sought_on(refined.preparation, found[i][0], seed)
                sought.add(i)


def _refined(question: _Question, judged: Judged, progress: Progress) -> Judged:
    """A candidate on a grid that is fine enough, in its usual ranges where that costs little."""
    solved, preparation, numerics = fine_enough(judged.solved, judged.preparation, progress)
    attempt = replace(question.attempt, solved=solved)
    kept = _kept_usual(attempt, replace(question.stage, preparation=preparation))
    if kept is not attempt:
        question = replace(question, attempt=kept)
        solved, preparation, numerics = fine_enough(kept.solved, preparation, progress)
    return question.answered(solved, preparation, numerics)


def _sought_on(
    preparation: Preparation, question: _Question, seed: int
) -> tuple[_Question, Judged]:
    """A candidate refitted anew on another grid."""
    stage = replace(question.stage, preparation=preparation)
    attempt = refit(question.attempt.score, stage, [stage.solved.block], seed, np.inf)
    question = replace(question, attempt=_kept_usual(attempt, stage))
    return question, question.answered(question.attempt.solved, preparation, 0.0)


def _sought_further(
    before: Solved, found: list[tuple[_Question, Judged]], seed: int, progress: Progress
) -> list[tuple[_Question, Judged]]:
    """Those that gain most, from more starts, where even the best leaves more than noise: that is
    another effect, a law unlike ours, or a basin that no start has left."""
    judged = [answer for _, answer in found]
    best = min(judged, key=lambda j: j.solved.cost, default=None)
    if best is None or best.solved.cost <= best.solved.samples * (
        1 + excess_doubt(best.preparation, best.solved)
    ):
        return found
    again = list(found)
    gaining = sorted(_gaining(before, judged, 0.0), key=lambda k: -judged[k].delta_bic)
    for k in gaining[:_SHORTLIST]:
        question, answer = found[k]
        progress(f"refitting with {answer.name} from more starts")
        attempt = sought_further(question.attempt, question.stage, seed)
        if attempt is not question.attempt:
            question = replace(question, attempt=_kept_usual(attempt, question.stage))
            solved, preparation = question.attempt.solved, question.stage.preparation
            again[k] = question, question.answered(solved, preparation, 0.0)
    return again


def _gaining(before: Solved, judged: list[Judged], share: float) -> set[int]:
    """Which of them gain on a fit at least a share of what any gains.

    In χ² undivided by what each leaves: what a grid too coarse for a mode leaves over would count
    against it twice, as gained by another and as noise.
    """
    gains = [before.bic - j.solved.bic for j in judged]
    most = max(gains, default=0.0)
    return {k for k, gained in enumerate(gains) if gained >= max(share * most, DELTA_BIC)}


def _reconsidered(
    base: Stage,
    stage: Stage,
    rounds: list[Round],
    predict: Predict,
    seed: int,
    progress: Progress,
) -> tuple[Stage, list[Round], str | None]:
    """Each effect but the last, judged again beside those that were adopted after it; and every
    other again, where one has given way to another.

    It is dropped where they have made it superfluous or too small to stand beside them, which is
    then told; and gives way where another now does better, unless that foretells a held-out
    recording worse: what was first to be adopted may have stood in for two.
    """
    waiting, too_small = rounds[:-1], None
    for _ in range(_MOST_JUDGED_AGAIN):
        if not waiting:
            break
        round_ = waiting.pop(0)
        k = rounds.index(round_)
        others = [*rounds[:k], *rounds[k + 1 :]]
        less, is_missed = _deleted(stage, k, progress)
        if not is_missed:
            stage, rounds = less, others
            continue
        scores = _scored(less, less.solved, residual_of(less.solved, less.preparation))
        halfway = 0.5 * (less.solved.cost + stage.solved.cost)
        found = _judge(base, less, scores, predict, seed, progress, halfway)
        winner = best_of(found)
        if winner is None:
            continue
        if winner.name == round_.winner.name:
            if others and not _is_worth_naming(base, less, winner):
                stage, rounds, too_small = less, others, winner.name
            else:
                rounds[k] = Round(winner, found)
            continue
        other = less.extended(winner.layer, winner.solved, winner.preparation)
        if _does_better(other, stage, predict):
            stage = other
            rounds, waiting = [*others, Round(winner, found)], others.copy()
    return stage, rounds, too_small


def _does_better(other: Stage, stage: Stage, predict: Predict) -> bool:
    """Whether a stage explains more than the one it is to replace, and foretells no worse."""
    if delta_bic(stage.solved, other.solved) <= 0:
        return False
    # Stretches never foretell worse, and each asks for a refit.
    if predict is predict_stretches:
        return True
    before, after = (predict(each.solved, each.preparation) for each in (stage, other))
    return not foretells_worse(predict, before, after)
