"""What a recording may have lost, in plain sentences: its beginning, and samples on the way."""

from __future__ import annotations

import numpy as np

from .._prepare import begins_in_motion, steady_of, take_of
from .._recording import Recording

_SIDE = 4
"""Samples on each side of a place that tell how fast drive and response move there."""


def doubts_about(recording: Recording) -> tuple[str, ...]:
    """Warnings beside `Recording.checks`."""
    found = (_rest(recording), _beginning(recording), _lost_samples(recording))
    return tuple(warning for warning in found if warning)


def _rest(recording: Recording) -> str | None:
    """A drive that never moves."""
    if np.ptp(recording.drive) > 0:
        return None
    return (
        f"The drive is constant at {recording.drive[0]:g} {recording.drive_unit}: a rest, which "
        "tells the noise and what drifts. Diagnose it beside a recording that moves; if it should "
        "have moved, choose the right column with --input."
    )


def _beginning(recording: Recording) -> str | None:
    """A recording that begins neither at rest nor in a steady cycle: its past is unknown."""
    steady = steady_of(take_of(recording, None, None, None)) is not None
    if steady or not begins_in_motion(recording):
        return None
    return (
        "The recording has no baseline: it begins in motion, neither at rest nor in a steady "
        "cycle, so that what the actuator remembers of before is unknown. Record a rest first, "
        "or leave the first samples out with --settle."
    )


def _lost_samples(recording: Recording) -> str | None:
    """Places where drive and response both move by the time of several samples, or of none.

    Where samples are missing, both jump by as many of their steps; where the last value was held
    instead, both stand still and then jump.
    """
    drive, response = (_paces(signal) for signal in (recording.drive, recording.response))
    skipped = (drive > 1.7) & (response > 1.7) & (np.abs(drive - response) < 0.25 * drive)
    held = (drive == 0) & (response == 0)
    places = np.flatnonzero(skipped | held)
    if not 0 < places.size <= 0.02 * len(recording):
        return None
    at = (places[0] + 1) * recording.dt
    return (
        f"Samples seem to be missing or held at {places.size} place(s), first at {at:.6g} s, where "
        "drive and response jump or stand still together: the clock is off from there on. Record "
        "again, or cut the recording before it."
    )


def _paces(signal: np.ndarray) -> np.ndarray:
    """Each step of (N,) in steps around it, shape (N - 1,); 1 where these do not agree.

    They agree where the steps on both sides have one sign and differ by less than a third.
    """
    steps = np.diff(signal)
    sums = np.concatenate(([0.0], np.cumsum(steps)))
    means = (sums[_SIDE:] - sums[:-_SIDE]) / _SIDE
    before, after = means[: -_SIDE - 1], means[_SIDE + 1 :]
    inner = steps[_SIDE:-_SIDE]
    around = (before + after) / 2
    # Steps of noise alone: successive differences of the steps hold no slow motion.
    noise = 1.48 * np.median(np.abs(np.diff(steps))) / np.sqrt(3)
    agree = (np.abs(after - before) < 0.3 * np.abs(around)) & (np.abs(around) > 4 * noise)
    paces = np.ones(steps.size)
    paces[_SIDE:-_SIDE][agree] = inner[agree] / around[agree]
    return paces
