"""The diagnosis of a model against recordings, from the noise floor to the verdict."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from .._computing import computing
from .._fit import settle
from .._models import Model
from .._prepare import (
    HistoryOption,
    Mask,
    Take,
    measured_noise,
    model_of,
    prepare,
    recordings_of,
    require_recording,
    require_whole_number,
    steady_of,
    take_of,
)
from .._recording import Recording, require_units_of
from .._solve import Progress, refine_until_accurate, silent, solve_from
from ._conclusion import Conclusion
from ._held_out import (
    predict_recording,
    predict_stretches,
)
from ._next_experiment import Limits, parse_limits, recorded_limits
from ._procedure import explained_by_noise, run, with_noise_beyond_mismatch
from ._result import (
    Diagnosis,
)
from ._stage import Stage

_STARTS = 8
_MOST_READINGS = 2


def diagnose(
    model: Model | str,
    recordings: Recording | Sequence[Recording],
    *,
    holdout: Recording | None = None,
    repeat: Recording | Sequence[Recording] | None = None,
    noise: float | str | None = None,
    history: HistoryOption | None = None,
    settling: int | str | None = None,
    limits: Limits | str | None = None,
    mask: Mask = (),
    seed: int = 0,
    progress: Progress = silent,
) -> Diagnosis:
    """Say whether, where and why a model, or that of a name, and recordings differ beyond noise.

    `holdout` is a recording that no fit sees; without one, and for effects that it does not show,
    stretches are set aside in turn.
    `repeat` holds the drive of a recording a second time, for the noise floor, or several do those
    of several; what shows no noise of its own, in periods or rests, has that of another with the
    same rate.  `noise` is the sensor's specification, rms, a number in the response's unit or a
    text such as "0.07 um", used where nothing of this shows the noise.
    `limits` of the drive, "0..100 V, 50 V/ms", bound the next experiment; without them the range
    that was recorded and ten times its fastest change do.  `mask` leaves out times [s] from the
    first sample, ends included, of every recording but those two.
    Raises InputError where the recordings do not fit together.
    """
    listed = recordings_of(recordings)
    model = model_of(model, listed)
    if holdout is not None:
        require_recording(holdout, "holdout")
    repeats = [] if repeat is None else recordings_of(repeat, "repeat")
    for again in repeats:
        require_units_of(listed[0], again)
    if isinstance(limits, str):
        limits = parse_limits(limits, listed)
    seed = require_whole_number(seed, "seed", 0)
    with computing():
        progress("reading the noise floor")
        preparation = prepare(
            listed,
            repeats=repeats,
            specification=noise,
            history=history,
            settling=settling,
            mask=mask,
        )
        progress(f"fitting {model.name} from {_STARTS} starts")
        solved = settle(model.block, preparation, history=history, starts=_STARTS, seed=seed)
        readings_left, earlier = _MOST_READINGS, []
        while True:
            solved, numerics = refine_until_accurate(solved, progress)
            base = Stage(model.name, model.block, (), solved)
            unseen = None if holdout is None else held_out_take(base.preparation.takes[0], holdout)
            predict = (
                predict_stretches if unseen is None else partial(predict_recording, take=unseen)
            )
            course = run(
                base, numerics, predict, seed, progress, earlier, may_read_again=readings_left > 0
            )
            clearer = with_noise_beyond_mismatch(base, course) if readings_left else None
            if clearer is None:
                break
            progress("reading the noise again, without the mismatch")
            solved = solve_from([solved.block, model.block], clearer)
            readings_left, earlier = readings_left - 1, course.opening
        base, course = explained_by_noise(base, course, seed, progress) or (base, course)
        limits = limits or recorded_limits(listed)
        conclusion = Conclusion(model, base, numerics, unseen, predict, course)
        return conclusion.diagnosis(limits, progress)


def held_out_take(first: Take, holdout: Recording) -> Take:
    """The held-out recording under the assumptions of the first training recording."""
    require_units_of(first.recording, holdout)
    noise = measured_noise(holdout) or first.noise
    if first.history != "periodic":
        return take_of(holdout, noise, first.history, None)
    take = take_of(holdout, noise, None, None)
    return steady_of(take) or take
