"""Warnings about what a recording may lack: motion, its beginning, or single samples."""

from __future__ import annotations

import numpy as np

from .._prepare import begins_in_motion, steady_of, take_of
from .._recording import Recording

_SIDE = 4
"""Samples on each side of a place from which the rates of drive and response there are estimated;
chosen by judgement."""


def doubts_about(recording: Recording) -> tuple[str, ...]:
    """Warnings about a recording, in addition to `Recording.checks`."""
    warnings = (_rest(recording), _beginning(recording), _lost_samples(recording))
    return tuple(warning for warning in warnings if warning)


def _rest(recording: Recording) -> str | None:
    """The warning for a drive that never moves."""
    if np.ptp(recording.drive) > 0:
        return None
    return (
        f"The drive is constant at {recording.drive[0]:g} {recording.drive_unit}: such a rest "
        "shows only noise and drift. Diagnose it together with a recording whose drive moves; if "
        "the drive should have moved, choose the right column with --input."
    )


def _beginning(recording: Recording) -> str | None:
    """The warning for a recording that begins neither at rest nor in a steady cycle."""
    steady = steady_of(take_of(recording, None, None, None)) is not None
    if steady or not begins_in_motion(recording):
        return None
    return (
        "The recording has no baseline: it begins in motion, neither at rest nor in a steady "
        "cycle, so that the prior history of the actuator is unknown. Record a rest first, or "
        "leave out the first samples with --settle."
    )


def _lost_samples(recording: Recording) -> str | None:
    """The warning for samples that are missing or were replaced by the last value.

    Where samples are missing, drive and response both jump by the same number of steps; where the
    last value was held instead, both stand still and then jump.
    """
    drive, response = (_paces(signal) for signal in (recording.drive, recording.response))
    # A missing sample doubles the step; more places than 2 % of the samples are a property of the
    # drive and no losses.  Both limits are chosen by judgement.
    skipped = (drive > 1.7) & (response > 1.7) & (np.abs(drive - response) < 0.25 * drive)
    held = (drive == 0) & (response == 0)
    places = np.flatnonzero(skipped | held)
    if not 0 < places.size <= 0.02 * len(recording):
        return None
    first = (places[0] + 1) * recording.dt
    return (
        f"Samples seem to be missing or held at {places.size} place(s), first at {first:.6g} s, "
        "where drive and response jump or stand still together: the times are wrong from there on. "
        "Record again, or cut the recording before that time."
    )


def _paces(signal: np.ndarray) -> np.ndarray:
    """Each step of a signal (N,) divided by the mean of its neighbours, shape (N - 1,).

    It is 1 where the neighbours do not agree.  They agree where the mean steps on both sides differ
    by less than 0.3 of their mean, and this mean exceeds 4 standard deviations of the noise.
    """
    steps = np.diff(signal)
    means = (signal[_SIDE:] - signal[:-_SIDE]) / _SIDE
    before, after = means[: -_SIDE - 1], means[_SIDE + 1 :]
    inner = steps[_SIDE:-_SIDE]
    around = (before + after) / 2
    # The noise of a step, from differences of successive steps, which contain no slow motion.
    noise = 1.48 * np.median(np.abs(np.diff(steps))) / np.sqrt(3)
    agree = (np.abs(after - before) < 0.3 * np.abs(around)) & (np.abs(around) > 4 * noise)
    paces = np.ones(steps.size)
    paces[_SIDE:-_SIDE][agree] = inner[agree] / around[agree]
    return paces
