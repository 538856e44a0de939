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
from ._procedure import run, with_noise_profile, with_noise_without_mismatch
from ._result import (
    Diagnosis,
)
from ._stage import Stage

_STARTS = 8
"""Starts of the base fit; chosen by judgement."""
_MOST_READINGS = 2
"""How often the noise may be estimated anew, without the mismatch; chosen by judgement."""


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
    """State whether, where and why a model and recordings differ by more than the noise.

    Args:
        model: the base model, or the name of one.
        recordings: one recording or several, each with a drive (N,) and a response (N,) in its
            units.
        holdout: a recording that no fit uses; without one, and for effects that it does not show,
            stretches of the recordings are held out in turn.
        repeat: a recording with the same drive as one of `recordings`, or several, from which the
            noise floor is estimated.  A recording whose noise neither a repeat, nor periods, nor
            rests show, has the noise of another with the same sampling rate.
        noise: the sensor's specification, rms, a number in the response's unit or a text such as
            "0.07 um", used if no recording shows the noise.
        history: the prior history of the drive, such as "constant"; None if the data decide.
        settling: the start that is left out, a number of samples or a time such as "1 s"; None if
            the data decide.
        limits: of the drive in the next experiment, such as "0..100 V, 50 V/ms"; by default the
            recorded range and ten times its fastest change.
        mask: times [s] from the first sample, ends included, that are left out of every recording
            except `holdout` and `repeat`.
        seed: of the random starts, a whole number ≥ 0.
        progress: is called with a text at every step.

    Returns:
        The diagnosis; its results state their units.

    Raises:
        InputError: if the recordings have different units, or an option is unusable.
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
        progress("estimating the noise floor")
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
        remaining_readings, earlier = _MOST_READINGS, []
        while True:
            solved, numerics = refine_until_accurate(solved, progress)
            base = Stage(model.name, model.block, (), solved)
            unseen = None if holdout is None else held_out_take(base.preparation.takes[0], holdout)
            predict = (
                predict_stretches if unseen is None else partial(predict_recording, take=unseen)
            )
            course = run(
                base,
                numerics,
                predict,
                seed,
                progress,
                earlier,
                may_read_again=remaining_readings > 0,
            )
            clearer = with_noise_without_mismatch(base, course) if remaining_readings else None
            if clearer is None:
                break
            progress("estimating the noise again, without the mismatch")
            solved = solve_from([solved.block, model.block], clearer)
            remaining_readings, earlier = remaining_readings - 1, course.opening
        base, course = with_noise_profile(base, course, seed, progress) or (base, course)
        limits = limits or recorded_limits(listed)
        conclusion = Conclusion(model, base, numerics, unseen, predict, course)
        return conclusion.diagnosis(limits, progress)


def held_out_take(first: Take, holdout: Recording) -> Take:
    """The held-out recording, with the history and the noise of the first training recording."""
    require_units_of(first.recording, holdout)
    noise = measured_noise(holdout) or first.noise
    if first.history != "periodic":
        return take_of(holdout, noise, first.history, None)
    take = take_of(holdout, noise, None, None)
    return steady_of(take) or take
