"""A drive that can tell, within the limits of an amplifier."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from .._path import SHOWN, Signal, Visible, can_show
from .._prepare import recordings_of
from .._recording import MINIMUM_SAMPLES, InputError, Recording, closest
from .._show import figure, quantity
from ._design import TOP, Task, designed
from ._drive import Drive
from ._limits import Limits
from ._recipe import RATIO, Recipe
from ._result import Protocol
from ._signals import MOST, as_read, ideal_signal, noise_level
from ._stage import Stage, above_zero, described, limits_given, recorded

ASKED = tuple(
    name for name in SHOWN if name not in ("clock_skew", "slew_rate_limit", "viscoelastic_layer")
)
"""The effects that a drive is designed for by default: not those that are a recorder's, or an
amplifier's beyond its limits, and of creep and a layer, whose look-alike it is, creep."""
_DURATION = "2 min"
_MOST = 200
"""Recipes that are compared."""
_FEW = 16
"""The same where the drive is one of many results."""
_MOST_SAMPLES = 20_000_000
"""Of a drive."""
_SHORTER = (0.25, 0.5)
"""Shorter durations, over the whole one."""
_FINER = 1.02
"""How nearly the smallest change of a limit is found."""

Progress = Callable[[str], None]


def _silent(text: str) -> None:
    """No progress."""


def protocol(
    limits: str | Limits | None = None,
    rate: str | float | None = None,
    *,
    duration: str | float | None = None,
    effects: Sequence[str] = ASKED,
    noise: str | float | None = None,
    stroke: str | None = None,
    capacitance: str | None = None,
    resolution: str | None = None,
    modes: str | float | None = None,
    after: Recording | Sequence[Recording] | None = None,
    shorter: bool = False,
    progress: Progress = _silent,
) -> Protocol:
    """Design the drive that shows the least visible of some effects best, whatever the hysteresis.

    Args:
        limits: of the drive, such as "0..100 V, 50 V/ms, 2 A": its range, and its fastest change, a
            current with a `capacitance`, or both.  With `after`, by default the recorded range and
            ten times the fastest recorded change.
        rate: of the samples, such as "5 kHz" or a number [Hz]; with `after` by default its rate.
        duration: of the drive, such as "2 min", the default, or a number [s]; with `after` by
            default its duration.
        effects: those that it is to show, by name.
        noise: of the response, rms, such as "2 nm", or over the stroke, such as "0.1 %", the
            default; with `after` by default its own.
        stroke: of the actuator over the range, such as "20 um"; without one, sizes are in % of it.
        capacitance: of the actuator, such as "3 uF".
        resolution: the step between the values of the converter, such as "1.5 mV".
        modes: the highest frequency at which a mode may be, such as "1 kHz"; by default a tenth of
            the rate.
        after: recordings of this actuator that the drive completes.
        shorter: whether to say what half and a quarter of the duration would show.
        progress: is called with a text at every step.

    Returns:
        The drive, with its parts and what it will show.

    Raises:
        InputError: if an option is unusable, or no drive fits the limits.
    """
    recordings = [] if after is None else recordings_of(after, "after")
    given = limits_given(
        limits, capacitance, resolution, recordings[0].drive_unit if recordings else ""
    )
    if recordings:
        stage = recorded(recordings, given, noise)
    elif given is None or given[0].slew == inf:
        named = "V" if given is None else given[1]
        raise InputError.at(
            "--limits", f'a range and a slew such as "0..100 {named}, 50 {named}/ms"',
            "nothing" if given is None else f'"{limits}"',
            "add the slew rate, or a current with --capacitance",
        )  # fmt: skip
    else:
        stage = described(given, noise, stroke)
    task = _task(stage, recordings, rate, duration, modes, effects)
    if recordings and duration is None:
        task = _with_time(task)
    _require_room(task, stage.units[0])

    def best(task: Task) -> tuple[Drive, tuple[Visible, ...]]:
        drive = _drive(task, designed(task, _MOST, progress))
        return drive, shown_by(drive, task, stage.units[1])

    sooner = [replace(task, duration=share * task.duration) for share in _SHORTER if shorter]
    drive, shows = best(task)
    return Protocol(
        drive=drive,
        limits=task.limits,
        top=task.top,
        noise=stage.noise,
        stroke=stage.slope * stage.limits.span,
        units=stage.units,
        effects=tuple(task.effects),
        shows=shows,
        before=can_show(stage.signals, stage.units[1]) if recordings else (),
        shorter=tuple(
            (one.duration, best(one)[1]) for one in sooner if one.drive(Recipe()) is not None
        ),
        after=tuple(r.source for r in recordings),
        warnings=_warnings(task),
    )


def completed(
    signals: Sequence[Signal], limits: Limits, unit: str
) -> tuple[Drive, tuple[Visible, ...]]:
    """The drive that shows, with recordings, what they alone do not, and what all will show.

    It is as long as the longest of them, or as its parts need, and at its rate.
    """
    longest = max(signals, key=lambda s: s.step * s.drive.size)
    stroke = max(float(np.ptp(s.response)) for s in signals)
    span = max(float(np.ptp(s.drive)) for s in signals)
    task = Task(
        limits,
        longest.step * longest.drive.size,
        longest.step,
        TOP / longest.step,
        stroke / span,
        max(map(noise_level, signals)),
        ASKED,
        tuple(signals),
    )
    task = _with_time(task)
    coarse = task.coarse()
    recipe = designed(task, _FEW, _silent)
    own = ideal_signal(_drive(coarse, recipe).values, coarse.step, task.slope, task.noise)
    return _drive(task, recipe), can_show([*coarse.before, own], unit)


def shown_by(drive: Drive, task: Task, unit: str) -> tuple[Visible, ...]:
    """What a drive will show, with what is recorded already."""
    own = ideal_signal(drive.values, drive.step, task.slope, task.noise)
    return can_show([*task.before, *as_read(own, MOST)], unit)


def _drive(task: Task, recipe: Recipe) -> Drive:
    """The drive of a recipe, or of the plain one, which fits, where it fits coarse samples only."""
    drive = task.drive(recipe) or task.drive(Recipe())
    assert drive is not None
    return drive


def _task(
    stage: Stage,
    recordings: Sequence[Recording],
    rate: str | float | None,
    duration: str | float | None,
    modes: str | float | None,
    effects: Sequence[str],
) -> Task:
    """What is to be designed.

    Raises:
        InputError: if an option is unusable.
    """
    if rate is None and not recordings:
        raise InputError.at("--rate", 'a sampling rate such as "5 kHz"', "nothing", "give it")
    hertz = recordings[0].rate if rate is None else above_zero(rate, "Hz", "--rate")
    if duration is None and recordings:
        seconds = max(r.dt * len(r) for r in recordings)
    else:
        seconds = above_zero(_DURATION if duration is None else duration, "s", "--duration")
    samples = seconds * hertz
    if not MINIMUM_SAMPLES < samples <= _MOST_SAMPLES:
        raise InputError.at(
            "--duration", f"{MINIMUM_SAMPLES} to {_MOST_SAMPLES} samples",
            f"{samples:.0f} in {figure(seconds)} s at {figure(hertz)} Hz", "change one of them",
        )  # fmt: skip
    top = TOP * hertz if modes is None else above_zero(modes, "Hz", "--modes")
    if top > TOP * hertz * (1 + 1e-9):
        raise InputError.at(
            "--rate", f"{figure(top / TOP)} Hz or more for modes up to {figure(top)} Hz",
            f"{figure(hertz)} Hz", f"raise it, or ask for modes up to {figure(TOP * hertz)} Hz",
        )  # fmt: skip
    for name in effects:
        if name not in SHOWN:
            raise InputError.at(
                "--for", f"effects of dynamics: {', '.join(SHOWN)}",
                f'"{name}"{closest(name, SHOWN)}', "choose among them",
            )  # fmt: skip
    if not effects:
        raise InputError.at("--for", "one effect or more", "none", "name one")
    limits = stage.limits.in_codes(1 / hertz)
    return Task(
        limits,
        seconds,
        1 / hertz,
        top,
        stage.slope,
        stage.noise,
        tuple(dict.fromkeys(effects)),
        stage.signals,
    )


def _require_room(task: Task, unit: str) -> None:
    """Raise `InputError` where no drive fits, with the smallest change that would do."""
    if task.drive(Recipe()) is not None:
        return
    longer = _least(lambda d: replace(task, duration=d), task.duration)
    given = f"{quantity(task.limits.slew, f'{unit}/s')} in {figure(task.duration)} s"
    faster = replace(task, limits=replace(task.limits, slew=1e3 * task.limits.slew, code=0.0))
    remedy = f"give a duration of {figure(longer)} s or more"
    if faster.drive(Recipe()) is None:
        raise InputError.at(
            "--duration", "time for a path at two rates, with holds and tones",
            f"{figure(task.duration)} s at {figure(1 / task.step)} Hz", remedy,
        )  # fmt: skip
    slew = _least(
        lambda v: replace(task, limits=replace(task.limits, slew=v, code=0.0)), task.limits.slew
    )
    raise InputError.at(
        "--limits",
        f"a slew of {quantity(slew, f'{unit}/s')} or more for a path at two rates", given,
        f"raise it, narrow the range, or {remedy}",
    )  # fmt: skip


def _with_time(task: Task) -> Task:
    """The same, longer where its parts need it."""
    if task.drive(Recipe()) is not None:
        return task
    return replace(task, duration=_least(lambda d: replace(task, duration=d), task.duration))


def _least(changed: Callable[[float], Task], value: float) -> float:
    """The smallest value, above one with which no drive fits, with which one does."""
    low, high = value, 2 * value
    while changed(high).drive(Recipe()) is None:
        low, high = high, 2 * high
    while high > _FINER * low:
        middle = (low * high) ** 0.5
        if changed(middle).drive(Recipe()) is None:
            low = middle
        else:
            high = middle
    return high


def _warnings(task: Task) -> tuple[str, ...]:
    """Where the limits cost something."""
    ratio = Recipe().fastest(task.limits, task.duration, task.step)
    if ratio >= RATIO:
        return ()
    return (
        f"The limits allow the path at rates that differ {figure(ratio)}-fold only, less than the "
        f"{figure(RATIO)}-fold that shows lags well: a longer drive or a faster amplifier would.",
    )
