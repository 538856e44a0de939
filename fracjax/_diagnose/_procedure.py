"""The course of a diagnosis: detect, adopt one effect after another, and delete backwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._prepare import Preparation, residual_noise, with_level_profile
from .._solve import LIMIT, Progress, Solved, refine_until_accurate, solve_from
from ._detect import Detection, detect, scored
from ._evidence import delta_bic
from ._held_out import Predict, foretells_worse, gain, predict_stretches
from ._judgement import (
    DELTA_BIC,
    PLACES_ALONE,
    SIGNIFICANCE,
    SMALL,
    Judged,
    best_of,
    is_exhausted,
    least_share,
    share_of_excess,
)
from ._residual import residual_of
from ._round import judge
from ._stage import Stage

_ROUNDS = 3
_MOST_JUDGED_AGAIN = 4
_CLEARLY_LESS = 0.03


@dataclass(frozen=True)
class Round:
    """One effect adopted, among all that were refitted beside it."""

    winner: Judged
    found: list[Judged]


@dataclass(frozen=True)
class Course:
    """How a diagnosis went: what the base left, and whether that `is_real` or may be no more than
    the simulation's own error; the refits beside the `opening` base; the rounds, the stage it ended
    on and what the last test found; and the effect that was too small to be named beside those
    adopted."""

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
    """Adopt one effect after another while the residual shows one, then drop what became idle.

    `earlier`: the refits beside the same base, seen against another noise, to start from.  Where
    the noise may be read again it ends with the opening, once that shows the noise to be clearly
    less: every later round would be gone through twice.
    """
    before, stage, rounds, judged, too_small = base, base, [], {}, None
    opening: list[Judged] = []
    first = detection = detect(base, seed, progress)
    # A mismatch that the simulation's own error may have made is never given a name.  No score is
    # changed by more than that error; and without what is missing the base may fit best where it is
    # hard to compute.  The refits answer for their own errors.
    is_real = numerics <= max(LIMIT, SMALL * first.height)
    if is_real and first.least >= SIGNIFICANCE and _guesses_noise(base):
        # Seen against itself a mismatch shows little; only a refit tells how much of it is noise.
        opening = judge(base, base, first.scores, predict, seed, progress, {}, least=0.0)
        judged = {j.name: j for j in opening}
    while is_real and detection.least < SIGNIFICANCE:
        started = {} if opening else {j.name: [j.solved.block] for j in earlier}
        found = judge(base, stage, detection.scores, predict, seed, progress, started)
        opening = opening or found
        judged = {**{j.name: j for j in found}, **judged}
        if may_read_again and opening is found:
            clearer = _read_past(base, [j.solved for j in found if j.plausible])
            if clearer is not None and _quietened(base.preparation, clearer) > _CLEARLY_LESS:
                break
        winner = best_of(found)
        if winner is None:
            break
        alone = _as_good_alone(rounds, winner)
        # Of a round whose stage held what has been found superfluous since, nothing is taken back.
        if alone is not None and len(before.layers) == len(rounds) - 1:
            # Nothing speaks for two effects where one of those that fitted before does as well.
            rounds[-1] = Round(alone, rounds[-1].found)
            stage = before.extended(alone.layer, alone.solved)
            detection = detect(stage, seed, progress)
            break
        extended = stage.extended(winner.layer, winner.solved)
        if not _is_worth_naming(base, stage, winner):
            # Too small to stand beside what was adopted, it may yet be what that stood in for.
            superfluous = _superfluous(extended, progress)
            if superfluous is None:
                too_small = winner.name
                break
            k, extended = superfluous
            rounds.pop(k)
        rounds.append(Round(winner, found))
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
    """What the round before could have adopted and then needed no winner of this one."""
    others = [] if not rounds else [j for j in rounds[-1].found if j is not rounds[-1].winner]
    good = [j for j in others if j.admissible and delta_bic(j.solved, winner.solved) < DELTA_BIC]
    return best_of(good)


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


def _on_its_own_grid(base: Stage, stage: Stage, progress: Progress) -> Stage:
    """The stage on the coarsest grid that it needs: what asked for a finer one may be gone."""
    coarse = stage.preparation.with_oversampling(base.preparation.oversampling)
    if coarse.oversampling == stage.preparation.oversampling:
        return stage
    solved, _ = refine_until_accurate(solve_from([stage.solved.block], coarse), progress, SMALL)
    return replace(stage, solved=solved)


def _is_worth_naming(base: Stage, stage: Stage, winner: Judged) -> bool:
    """Whether a further effect takes a share that counts, of the recordings or of data held out,
    where the base conceals less of it; or is none that another's law could imitate."""
    least = least_share(base, stage)
    if winner.layer.effect.foreign or share_of_excess(base, stage, winner) >= least:
        return True
    held_out = gain(winner.predict(base.solved), winner.prediction)
    return winner.gain.fall >= least * held_out.fall


def with_noise_beyond_mismatch(base: Stage, course: Course) -> Preparation | None:
    """The base's recordings, their noise read from what the best of the refits leaves over.

    Where nothing but a fit tells the noise, what the base left over holds the mismatch too; seen
    against that, a mismatch looks small.  None where no refit leaves clearly less.
    """
    refits = [j.solved for j in course.judged.values() if j.plausible]
    clearer = _read_past(base, [*refits, course.stage.solved])
    if clearer is None:
        return None
    # A name that was given already would not change for a little less noise.
    matters = not course.rounds or _quietened(base.preparation, clearer) > _CLEARLY_LESS
    return clearer if matters else None


def _read_past(base: Stage, refits: list[Solved]) -> Preparation | None:
    """The base's recordings, their noise that of the refit that gains most by it, if any does."""
    if not refits or not _guesses_noise(base):
        return None
    gain, clearer = max((_seen_past(base, solved) for solved in refits), key=lambda pair: pair[0])
    return clearer if gain >= DELTA_BIC else None


def explained_by_noise(
    base: Stage, course: Course, seed: int, progress: Progress
) -> tuple[Stage, Course] | None:
    """The base and a course beside a noise whose size is followed all along the recordings, where
    what shows against that is not sure.

    It is asked where places alone speak for a mismatch and no effect gains anything, of noise that
    rests told, outside which it may have been larger, or that a fit left over.
    """
    told = [take.noise for take in base.preparation.takes if take.noise is not None]
    changing = [noise.method in ("static", "residual") for noise in told]
    if course.first.least >= SIGNIFICANCE or course.gains or not any(changing):
        return None
    progress("following the noise along the recording")
    takes = zip(told, changing, base.preparation.takes, base.solved.simulations, strict=True)
    noises = [
        with_level_profile(noise, take.recording.response - simulation, take.used)
        if changes
        else noise
        for noise, changes, take, simulation in takes
    ]
    preparation = base.preparation.with_noises(noises)
    solved = solve_from([base.solved.block, base.start()], preparation)
    again = replace(base, solved=solved)
    seen = detect(again, seed, progress)
    if seen.least < PLACES_ALONE:
        return None
    return again, replace(course, first=seen, opening=[], last=seen, judged={}, stage=again)


def _guesses_noise(stage: Stage) -> bool:
    """Whether nothing but a fit tells the noise of a recording."""
    noises = [take.noise for take in stage.preparation.takes]
    return any(noise is not None and noise.is_leftover for noise in noises)


def _quietened(before: Preparation, after: Preparation) -> float:
    """The largest share of its noise that a recording has lost."""
    pairs = zip(before.takes, after.takes, strict=True)
    return max(1 - a.noise.sigma / b.noise.sigma for b, a in pairs if a.noise and b.noise)


def _seen_past(base: Stage, solved: Solved) -> tuple[float, Preparation]:
    """What a refit gains in BIC where each noise is the one that it leaves itself, and the
    recordings with those noises."""
    gain, noises = (base.solved.free - solved.free) * float(np.log(solved.samples)), []
    takes = zip(base.preparation.takes, solved.simulations, base.solved.simulations, strict=True)
    for take, simulation, of_base in takes:
        noise, y = take.noise, take.recording.response
        assert noise is not None  # a diagnosis has one
        if noise.is_leftover:
            again = residual_noise(y - simulation, take.used, take.recording)
            before, seen = noise, again
            if noise.method == "specification":
                before = residual_noise(y - of_base, take.used, take.recording)
                seen = noise.coloured_as(again)
            count = np.count_nonzero(take.used)
            fall = 2 * np.log(before.innovation / again.innovation) + before.whitened_square
            gain += float(count * (fall - again.whitened_square))
            if again.sigma > before.sigma:  # another colour, but no less of it
                return -np.inf, base.preparation
            noise = seen
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
    """Each effect but the last, judged again beside those that were adopted after it; and every
    other again, where one has given way to another.

    It is dropped where they have made it superfluous or too small to stand beside them, which is
    then told; and gives way where another now does better, unless that foretells a held-out
    recording worse: what was first to be adopted may have stood in for two.  Where more than noise
    is left no effect gets a name, and what is superfluous is only dropped.
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
        if not is_exhausted(base, stage):
            continue
        less = _on_its_own_grid(base, less, progress)
        scores = scored(less, less.solved, residual_of(less.solved))
        halfway = 0.5 * (less.solved.cost + stage.solved.cost)
        found = judge(base, less, scores, predict, seed, progress, {}, halfway)
        winner = best_of(found)
        if winner is None:
            continue
        if winner.name == round_.winner.name:
            if others and not _is_worth_naming(base, less, winner):
                stage, rounds, too_small = less, others, winner.name
            else:
                rounds[k] = Round(winner, found)
            continue
        other = less.extended(winner.layer, winner.solved)
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
    before, after = (predict(each.solved) for each in (stage, other))
    return not foretells_worse(predict, before, after)
