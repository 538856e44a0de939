"""The course of a diagnosis: detect, adopt one effect after another, and delete backwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._prepare import Preparation, residual_noise, with_level_profile
from .._solve import LIMIT, Progress, Solved, refine_until_accurate, solve_from
from ._detect import Detection, detect, scored
from ._evidence import delta_bic
from ._held_out import Predict, gain, predict_stretches, predicts_worse
from ._judgement import (
    DELTA_BIC,
    PLACES_ALONE,
    SIGNIFICANCE,
    SMALL,
    Judged,
    best_of,
    least_share,
    residual_is_noise,
    share_of_excess,
)
from ._residual import residual_of
from ._round import judge
from ._stage import Stage

_ROUNDS = 3
"""Effects that are adopted at most; chosen by judgement."""
_MOST_JUDGED_AGAIN = 4
"""Adopted effects that are judged again at most; chosen by judgement."""
_CLEARLY_LESS = 0.03
"""Relative reduction of the noise that is worth another pass; chosen by judgement."""


@dataclass(frozen=True)
class Round:
    """One effect adopted, with all candidates of its round."""

    winner: Judged
    candidates: list[Judged]


@dataclass(frozen=True)
class Course:
    """The course of a diagnosis.

    `first` is the test of the base's residual, and `is_real` states whether that residual exceeds
    the simulation's own error; `opening` are the refits of the first round and `last` is the last
    test; `rounds` and `stage` are the adopted effects and the final stage; `judged` is every
    candidate by its name; `too_small` the effect that was too small to be named in addition to
    those adopted.
    """

    first: Detection
    is_real: bool
    opening: list[Judged]
    last: Detection
    rounds: list[Round]
    judged: dict[str, Judged]
    stage: Stage
    too_small: str | None

    @property
    def gains(self) -> bool:
        """Whether any effect would have been an improvement."""
        return any(j.delta_bic >= DELTA_BIC for j in self.judged.values())


def run(
    base: Stage,
    numerics: float,
    predict: Predict,
    seed: int,
    progress: Progress,
    earlier: Sequence[Judged] = (),
    *,
    may_read_again: bool = False,
) -> Course:
    """Adopt one effect after another while the residual is significant, then drop those that have
    become superfluous.

    `earlier` are refits of the same base under another noise, to start from.  If the noise may be
    estimated again, the search ends after the first round once that shows the noise to be clearly
    smaller; otherwise every later round would run twice.
    """
    before, stage, rounds, judged, too_small = base, base, [], {}, None
    opening: list[Judged] = []
    first = detection = detect(base, seed, progress)
    # A mismatch that the simulation's own error may have caused is never named.  That error changes
    # no score by more than itself; and without the missing effect the base may fit best where it is
    # hard to compute.  Each refit is checked for its own error.
    is_real = numerics <= max(LIMIT, SMALL * first.height)
    if is_real and first.least >= SIGNIFICANCE and _noise_is_from_fit(base):
        # The noise was estimated from the residual, so that a mismatch is hardly significant; only
        # a refit shows how much of the residual is noise.
        opening = judge(base, base, first.scores, predict, seed, progress, {}, least=0.0)
        judged = {j.name: j for j in opening}
    while is_real and detection.least < SIGNIFICANCE:
        started = {} if opening else {j.name: [j.solved.block] for j in earlier}
        candidates = judge(base, stage, detection.scores, predict, seed, progress, started)
        opening = opening or candidates
        judged = {**{j.name: j for j in candidates}, **judged}
        if may_read_again and opening is candidates:
            clearer = _with_noise_of_best(base, [j.solved for j in candidates if j.plausible])
            if clearer is not None and _noise_reduction(base.preparation, clearer) > _CLEARLY_LESS:
                break
        winner = best_of(candidates)
        if winner is None:
            break
        alone = _as_good_alone(rounds, winner)
        # If an effect has been dropped since the last round, that round is not revised.
        if alone is not None and len(before.layers) == len(rounds) - 1:
            # Two effects are not needed where one candidate of the last round fits as well.
            rounds[-1] = Round(alone, rounds[-1].candidates)
            stage = before.extended(alone.layer, alone.solved)
            detection = detect(stage, seed, progress)
            break
        extended = stage.extended(winner.layer, winner.solved)
        if not _is_worth_naming(base, stage, winner):
            # Too small in addition to what was adopted, but it may be the true cause instead of it.
            superfluous = _superfluous(extended, progress)
            if superfluous is None:
                too_small = winner.name
                break
            k, extended = superfluous
            rounds.pop(k)
        rounds.append(Round(winner, candidates))
        before, stage = stage, extended
        detection = detect(stage, seed, progress)
        if len(rounds) == _ROUNDS:
            break
    stage, rounds, dropped = _reconsidered(base, stage, rounds, predict, seed, progress)
    too_small = dropped or too_small
    if too_small in stage.adopted:
        too_small = None
    return Course(first, is_real, opening, detection, rounds, judged, stage, too_small)


def _as_good_alone(rounds: list[Round], winner: Judged) -> Judged | None:
    """A candidate of the round before that fits as well as the stage with this round's winner."""
    last = rounds[-1] if rounds else None
    others = [] if last is None else [j for j in last.candidates if j is not last.winner]
    good = [j for j in others if j.admissible and delta_bic(j.solved, winner.solved) < DELTA_BIC]
    return best_of(good)


def _superfluous(stage: Stage, progress: Progress) -> tuple[int, Stage] | None:
    """The index of an earlier effect that the last one has made superfluous, and the stage without
    it."""
    for k in range(len(stage.layers) - 1):
        less, is_missed = _deleted(stage, k, progress)
        if not is_missed:
            return k, less
    return None


def _deleted(stage: Stage, k: int, progress: Progress) -> tuple[Stage, bool]:
    """The stage without one of its effects, and whether its fit is significantly worse."""
    progress(f"fitting without {stage.layers[k].effect.name}")
    less = stage.without(k)
    return less, delta_bic(less.solved, stage.solved) >= DELTA_BIC


def _on_its_own_grid(base: Stage, stage: Stage, progress: Progress) -> Stage:
    """The stage on the coarsest grid that is accurate enough: the effect that needed a finer one
    may have been dropped."""
    coarse = stage.preparation.with_oversampling(base.preparation.oversampling)
    if coarse.oversampling == stage.preparation.oversampling:
        return stage
    solved, _ = refine_until_accurate(solve_from([stage.solved.block], coarse), progress, SMALL)
    return replace(stage, solved=solved)


def _is_worth_naming(base: Stage, stage: Stage, winner: Judged) -> bool:
    """Whether a further effect explains a large enough share of the excess, in the recordings or in
    held-out data, where the base may conceal less of it; or is of a kind that the difference
    between another effect and its model cannot imitate."""
    least = least_share(base, stage)
    if winner.layer.effect.foreign or share_of_excess(base, stage, winner) >= least:
        return True
    held_out = gain(winner.predict(base.solved), winner.prediction)
    return winner.gain.fall >= least * held_out.fall


def with_noise_without_mismatch(base: Stage, course: Course) -> Preparation | None:
    """The base's recordings with the noise estimated from the residual of the best refit.

    If the noise is estimated from a fit's residual, that of the base contains the mismatch too, and
    the mismatch appears small.  None if no refit has a clearly smaller residual.
    """
    refits = [j.solved for j in course.judged.values() if j.plausible]
    clearer = _with_noise_of_best(base, [*refits, course.stage.solved])
    if clearer is None:
        return None
    # An effect that is named already would stay named with slightly less noise.
    matters = not course.rounds or _noise_reduction(base.preparation, clearer) > _CLEARLY_LESS
    return clearer if matters else None


def _with_noise_of_best(base: Stage, refits: list[Solved]) -> Preparation | None:
    """The base's recordings with the noise of the refit that gains most by it, if any does."""
    if not refits or not _noise_is_from_fit(base):
        return None
    gain, clearer = max(
        (_with_noise_of(base, solved) for solved in refits), key=lambda pair: pair[0]
    )
    return clearer if gain >= DELTA_BIC else None


def with_noise_profile(
    base: Stage, course: Course, seed: int, progress: Progress
) -> tuple[Stage, Course] | None:
    """The base and a course with a noise level that has a profile over time, if the residual is not
    significant with that.

    It is tried if only places show a mismatch and no effect improves the fit, for noise that was
    estimated from rests, outside which it may have been larger, or from a fit's residual.
    """
    levels = [take.noise for take in base.preparation.takes if take.noise is not None]
    changing = [noise.method in ("static", "residual") for noise in levels]
    if course.first.least >= SIGNIFICANCE or course.gains or not any(changing):
        return None
    progress("estimating the profile of the noise along the recording")
    takes = zip(levels, changing, base.preparation.takes, base.solved.simulations, strict=True)
    noises = [
        with_level_profile(noise, take.recording.response - simulation, take.used)
        if changes
        else noise
        for noise, changes, take, simulation in takes
    ]
    preparation = base.preparation.with_noises(noises)
    solved = solve_from([base.solved.block, base.start()], preparation)
    again = replace(base, solved=solved)
    detection = detect(again, seed, progress)
    if detection.least < PLACES_ALONE:
        return None
    course = replace(course, first=detection, opening=[], last=detection, judged={}, stage=again)
    return again, course


def _noise_is_from_fit(stage: Stage) -> bool:
    """Whether the noise of a recording is estimated from a fit's residual."""
    noises = [take.noise for take in stage.preparation.takes]
    return any(noise is not None and noise.is_leftover for noise in noises)


def _noise_reduction(before: Preparation, after: Preparation) -> float:
    """The largest relative reduction of a recording's noise level."""
    pairs = zip(before.takes, after.takes, strict=True)
    return max(1 - a.noise.sigma / b.noise.sigma for b, a in pairs if a.noise and b.noise)


def _with_noise_of(base: Stage, solved: Solved) -> tuple[float, Preparation]:
    """The gain of a refit in BIC if each noise is estimated from its own residual, and the
    recordings with these noises."""
    gain, noises = (base.solved.free - solved.free) * float(np.log(solved.samples)), []
    takes = zip(base.preparation.takes, solved.simulations, base.solved.simulations, strict=True)
    for take, simulation, of_base in takes:
        noise, y = take.noise, take.recording.response
        assert noise is not None  # a diagnosis has one
        if noise.is_leftover:
            again = residual_noise(y - simulation, take.used, take.recording)
            before, after = noise, again
            if noise.method == "specification":
                before = residual_noise(y - of_base, take.used, take.recording)
                after = noise.coloured_as(again)
            count = np.count_nonzero(take.used)
            fall = 2 * np.log(before.innovation / again.innovation) + before.whitened_square
            gain += float(count * (fall - again.whitened_square))
            if again.sigma > before.sigma:  # another spectrum, but no smaller level
                return -np.inf, base.preparation
            noise = after
        noises.append(noise)
    if all(noise is take.noise for noise, take in zip(noises, base.preparation.takes, strict=True)):
        return -np.inf, base.preparation
    return gain, base.preparation.with_noises(noises)


def _reconsidered(
    base: Stage,
    stage: Stage,
    rounds: list[Round],
    predict: Predict,
    seed: int,
    progress: Progress,
) -> tuple[Stage, list[Round], str | None]:
    """Judge each effect but the last again, next to those that were adopted after it; and every
    other one again, if one has been replaced.

    It is dropped if they have made it superfluous, or too small to be named in addition to them,
    which is then reported.  It is replaced if another effect now explains more, unless that one
    predicts a held-out recording worse: the first effect adopted may have compensated for two.  If
    the residual exceeds the noise, no effect is named, and superfluous ones are only dropped.
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
        if not residual_is_noise(base, stage):
            continue
        less = _on_its_own_grid(base, less, progress)
        scores = scored(less, less.solved, residual_of(less.solved))
        halfway = 0.5 * (less.solved.cost + stage.solved.cost)
        candidates = judge(base, less, scores, predict, seed, progress, {}, halfway)
        winner = best_of(candidates)
        if winner is None:
            continue
        if winner.name == round_.winner.name:
            if others and not _is_worth_naming(base, less, winner):
                stage, rounds, too_small = less, others, winner.name
            else:
                rounds[k] = Round(winner, candidates)
            continue
        other = less.extended(winner.layer, winner.solved)
        if _does_better(other, stage, predict):
            stage = other
            rounds, waiting = [*others, Round(winner, candidates)], others.copy()
    return stage, rounds, too_small


def _does_better(other: Stage, stage: Stage, predict: Predict) -> bool:
    """Whether a stage explains more than the one that it would replace, and predicts no worse."""
    if delta_bic(stage.solved, other.solved) <= 0:
        return False
    # Stretches never count as predicted worse, and each may need a refit.
    if predict is predict_stretches:
        return True
    before, after = (predict(each.solved) for each in (stage, other))
    return not predicts_worse(predict, before, after)
