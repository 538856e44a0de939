"""The diagnosis of a model against recordings, from the noise floor to the verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from .._blocks import AbstractMachine, BoucWen, Gain, PrandtlIshlinskii, Within
from .._computing import Clock, computing, within
from .._fit import settle
from .._models import Model
from .._path import PathView, Visible, can_show
from .._prepare import (
    HistoryOption,
    Mask,
    Preparation,
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
from .._protocol import Limits, completed, parse_limits, recorded_limits
from .._recording import InputError, Recording, require_units_of
from .._solve import Progress, discretisation_warnings, silent
from ._drive import parted, thinned, unrounded, without_spikes, wrong_way
from ._extension import ANY_LOOP, extended_by, extended_inside
from ._findings import Findings
from ._fitted import Fitted, fitted
from ._held_out import predict_recording, predict_stretches
from ._inquiry import Inquiry, inquire, inquired_inside
from ._names import names_of
from ._next_experiment import propose
from ._result import Diagnosis, NextExperiment
from ._sentence import (
    afterwards,
    completed_sentence,
    is_incomplete,
    next_experiment,
    sentence_of,
    where_of,
)
from ._views import (
    ModelView,
    misfit_of,
    model_view,
    path_view,
    signals_of,
    with_all_as_noise,
    with_residual_as_noise,
)

_SO_FAR = (
    " This is the verdict so far: the time was over, or it was interrupted, before all fits had "
    "ended."
)
_STARTS, _OF_ANY_LOOP = 8, 1
"""Starts of the base fit, chosen by judgement, and of that of a sum of plays, which ends alike from
any start: of 17 recordings, four starts of each, none ended lower than its first."""
_MAX_TIME = 120.0
"""The default time limit [s]; chosen by judgement."""


def diagnose(
    model: Model | str | None,
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
    max_time: float = _MAX_TIME,
) -> Diagnosis:
    """State whether, where and why a model and recordings differ by more than the noise.

    Args:
        model: the base model, or the name of one: the question is then what it leaves out.  None
            asks which dynamics the recordings show, whatever their law of hysteresis; a sum of
            plays stands for the law where a model is needed.
        recordings: one recording or several, each with a drive (N,) and a response (N,) in its
            units.
        holdout: a recording that no fit uses; without one, stretches of the recordings are held
            out in turn.
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
        max_time: after this time [s], or an interruption, fits end where they are, none starts, and
            the diagnosis is marked as not `complete`.

    Returns:
        The diagnosis; its results state their units.

    Raises:
        InputError: if the recordings have different units, or an option is unusable.
    """
    listed = recordings_of(recordings)
    law = model_of(ANY_LOOP if model is None else model, listed)
    if holdout is not None:
        require_recording(holdout, "holdout")
    repeats = [] if repeat is None else recordings_of(repeat, "repeat")
    for again in repeats:
        require_units_of(listed[0], again)
    if isinstance(limits, str):
        limits = parse_limits(limits, listed)
    seed = require_whole_number(seed, "seed", 0)
    if not max_time > 0:
        raise InputError.at("max_time", "seconds above 0", f"{max_time}", "give more")
    clock = Clock(max_time)
    corrected: list[str] = []
    fewer = not mask and settling is None
    for correct in (without_spikes, unrounded, *([thinned] if fewer else [])):
        pairs = [correct(recording) for recording in listed]
        listed = [recording for recording, _ in pairs]
        corrected += [warning for _, warning in pairs if warning]
    if fewer:
        lists = [parted(recording) for recording in listed]
        listed = [part for parts, _ in lists for part in parts]
        corrected += [warning for _, warning in lists if warning]
    with computing(), within(clock):
        progress("estimating the noise floor")
        preparation = prepare(
            listed,
            repeats=repeats,
            specification=noise,
            history=history,
            settling=settling,
            mask=mask,
        )
        starts = _OF_ANY_LOOP if model is None else _STARTS
        fit = partial(_fitted, law, history=history, starts=starts, seed=seed, progress=progress)
        is_machine = isinstance(law.block, AbstractMachine | Within)
        path, view = None, None
        if model is None:
            path, base = _without_model(preparation, fit, progress)
        else:
            path, base, view = _with_model(preparation, fit, progress, has_path=not is_machine)
        preparation = base.preparation
        unseen = None if holdout is None else held_out_take(preparation.takes[0], holdout)
        predict = predict_stretches if unseen is None else partial(predict_recording, take=unseen)
        # A model with rates of its own may lead its drive; a gain never does, and a loop without
        # rates with odd parameters alone.
        has_none = isinstance(law.block, BoucWen | PrandtlIshlinskii) and base.displaced
        follows = not (has_none or isinstance(law.block, Gain))
        doubts = [t for t in (wrong_way(r, law.block, follows=follows) for r in listed) if t]
        # The misfit of a fit that had to end early is not that of its model; path curves have none.
        may_name = not doubts and (model is None or not clock.is_over)
        inquiry = Inquiry.of(base, path, view)
        extension = None
        machine = base.solved.block
        if may_name and isinstance(machine, AbstractMachine | Within):
            from .._inside import inquire_inside  # machines alone need it

            inside = inquire_inside(machine, preparation, progress=progress)
            inquiry = inquired_inside(inquiry, inside)
            extension = extended_inside(law, inside, preparation)
        elif may_name:
            inquiry = inquire(inquiry, law.block, progress, clock)
            extension = extended_by(inquiry, law, predict, progress, clock)
            is_silent = not (model is None or inquiry.names or inquiry.jumps or extension)
            if is_silent and (own := with_all_as_noise(base)) is not None:
                inquiry = Inquiry.of(own, None, model_view(own))
        findings = Findings(law, inquiry, unseen, predict, tuple(doubts), extension)
        if findings.is_refuted:
            findings = replace(findings, inquiry=inquiry.unnamed(), extension=None)
        shows = can_show(signals_of(preparation), listed[0].response_unit)
        limits = limits or recorded_limits(listed)
        return _concluded(findings, shows, limits, corrected, progress, clock)


def _fitted(
    law: Model,
    preparation: Preparation,
    *,
    history: HistoryOption | None,
    starts: int,
    seed: int,
    progress: Progress,
) -> tuple[Fitted, bool]:
    """The law fitted, and whether its residual has told more of the noise than the recordings."""
    progress(f"fitting {law.name}" + (f" from {starts} starts" if starts > 1 else ""))
    solved = settle(law.block, preparation, history=history, starts=starts, seed=seed)
    progress("correcting the discretisation error")
    base = fitted([solved.block], solved.preparation)
    other = with_residual_as_noise(base)
    return (base, False) if other is None else (fitted([base.solved.block], other), True)


Fitting = Callable[[Preparation], tuple[Fitted, bool]]
"""From a preparation to what `_fitted` returns."""


def _without_model(
    preparation: Preparation, fit: Fitting, progress: Progress
) -> tuple[PathView, Fitted]:
    """Recordings under path curves, and the fit of the law that stands for any."""
    progress("following the path of the drive")
    path, noisy = path_view(preparation)
    base, is_renewed = fit(noisy)
    return (path_view(base.preparation)[0] if is_renewed else path), base


def _with_model(
    preparation: Preparation, fit: Fitting, progress: Progress, *, has_path: bool
) -> tuple[PathView | None, Fitted, ModelView]:
    """The fit of a model and its view, and where it does not describe the recordings, these under
    path curves, whose noise is then what path curves leave where it was not known."""
    base, _ = fit(preparation)
    excess, doubt = misfit_of(base)
    view = None
    if excess <= doubt or not has_path:
        progress("computing the columns of every effect")
        view = model_view(base)
        # No free law is likelier than noise: what it spends, the sum of λ / (1 + λ) over its
        # directions, is less than the sum of log(1 + λ) that its evidence pays for it.
        if not has_path or not names_of(view.posterior):
            return None, base, view
    progress("following the path of the drive")
    if preparation.has_unknown_noise:
        path, noisy = path_view(preparation)
        base, view = fit(noisy)[0], None
    else:
        path, _ = path_view(base.preparation)
    if view is None:
        progress("computing the columns of every effect")
        view = model_view(base)
    return path, base, view


def held_out_take(first: Take, holdout: Recording) -> Take:
    """The held-out recording, with the history and the noise of the first training recording."""
    require_units_of(first.recording, holdout)
    noise = measured_noise(holdout) or first.noise
    if first.history != "periodic":
        return take_of(holdout, noise, first.history, None)
    take = take_of(holdout, noise, None, None)
    return steady_of(take) or take


def _concluded(
    findings: Findings,
    shows: Sequence[Visible],
    limits: Limits,
    corrected: Sequence[str],
    progress: Progress,
    clock: Clock,
) -> Diagnosis:
    """The diagnosis: its verdict and everything that supports it."""
    progress("writing the verdict")
    verdict, effects, axes = findings.verdict, findings.effects, findings.axes
    named = [name.effect for name in findings.inquiry.names]
    return Diagnosis(
        verdict=verdict,
        sentence=sentence_of(findings) + (_SO_FAR if clock.was_short else ""),
        base=findings.base_fit,
        extended=findings.extended_fit,
        effects=effects,
        candidates=findings.candidates,
        axes=axes,
        where=where_of(axes, verdict, named, findings.residuals),
        noise=findings.noise,
        numerics=findings.base.numerics,
        p_value=findings.p_value,
        held_out=findings.held_out,
        next_experiment=_next_experiment(findings, shows, limits, progress, clock),
        warnings=(*corrected, *findings.doubts, *_warnings(findings)),
        shape=findings.shape,
        can_show=tuple(shows),
        complete=not clock.was_short,
    )


def _next_experiment(
    findings: Findings,
    shows: Sequence[Visible],
    limits: Limits,
    progress: Progress,
    clock: Clock,
) -> NextExperiment | None:
    """The drive that distinguishes the effects that this recording does not, or else, where more is
    missing than is named, one that shows what this recording cannot."""
    preparation, fit = findings.base.preparation, findings.base_fit
    if clock.is_over:
        return None
    split = next((n for n in findings.inquiry.names if n.alike), None)
    # Of a model that does not describe the recordings no refit tells what each would show.
    refits = findings.inquiry.refits if findings.inquiry.is_adequate else ()
    explained = {e.names: e for e in refits}
    names = () if split is None else (split.effect, *split.alike)
    rivals = [explained[name,] for name in names if (name,) in explained]
    if len(rivals) < 2:
        if not is_incomplete(findings) and split is None:
            return None
        progress("designing the next experiment")
        unit = preparation.takes[0].recording.response_unit
        drive, both = completed(signals_of(preparation), limits, unit)
        return afterwards(completed_sentence(drive, shows, both), fit)
    blocks = [e.fitted.solved.block for e in rivals]
    proposal = propose(blocks, preparation, limits, progress)
    return afterwards(next_experiment([e.names[0] for e in rivals], proposal), fit)


def _warnings(findings: Findings) -> tuple[str, ...]:
    """Reasons for doubt, in words."""
    base = findings.base
    warnings = [
        warning
        for take in base.preparation.takes
        for warning in (*take.recording.warnings, *take.recording.checks())
    ]
    if findings.noise.method == "residual":
        warnings.append(
            "The noise floor was estimated from the residual itself, since there are no repeats, "
            "no rests and no specification: a mismatch that looks like noise cannot be excluded."
        )
    warnings += discretisation_warnings(base.numerics)
    if not base.solved.converged:
        warnings.append("The base fit did not converge; its results are those of its best point.")
    return (*warnings, *findings.events, *findings.tones, *findings.displaced)
