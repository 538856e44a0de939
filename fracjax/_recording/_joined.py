"""Recordings taken one after the other as one."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from fracjax._recording._errors import InputError, require_kind
from fracjax._recording._recording import Recording, require_units_of
from fracjax._recording._units import parse_quantity

STAMPS = "stamps"
"""Pauses that the recordings' own stamps tell."""
_SAME_STEP = 1e-6
"""The largest relative difference of steps that are one."""
_LONGEST = 4.0
"""The longest of all pauses together, over what was recorded: a fit computes them too, and what a
longer one leaves of the past is hardly more than nothing.  Chosen by judgement."""


def joined(
    recordings: Sequence[Recording], pauses: str | float | Sequence[str | float] = STAMPS
) -> Recording:
    """Recordings of one actuator, taken one after the other, as one recording.

    What an actuator keeps from one recording to the next, its creep, its warmth, its wear and the
    turning points of its path, is then that of one experiment.  In a pause the drive goes from its
    last value to its next in a straight line, and the response counts for no fit.

    Args:
        recordings: two or more, in the order in which they were taken, with one step and the same
            units.
        pauses: the time from the last sample of each to the first of the next, in s or as a text
            such as "2 s": one for all, or a list.  "stamps" takes it from the dates and times in
            their files, which then also say the order.

    Returns:
        The recording, whose `masked` holds the pauses.

    Raises:
        InputError: where units or steps differ, a pause is none, or stamps do not tell it.
    """
    listed = [recordings] if isinstance(recordings, Recording) else list(recordings)
    for k, recording in enumerate(listed):
        where = f"recording {k + 1}"
        require_kind(recording, Recording, where, "read a file by fracjax.read(path) first")
    if len(listed) < 2:
        raise InputError.at("recordings", "two or more", f"{len(listed)}", "give them all")
    for other in listed[1:]:
        require_units_of(listed[0], other)
        if abs(other.dt / listed[0].dt - 1) > _SAME_STEP:
            raise InputError.at(
                other.source,
                f"the step of {listed[0].source}, {listed[0].dt:g} s",
                f"{other.dt:g} s",
                f"read it with --resample {listed[0].rate:.6g}Hz",
            )
    if isinstance(pauses, str) and pauses.strip() == STAMPS:
        listed.sort(key=_began)
        seconds = [_between(*pair) for pair in pairwise(listed)]
    else:
        seconds = _stated(pauses, len(listed) - 1)
    step = listed[0].dt
    recorded = sum(map(len, listed)) * step
    if sum(seconds) > _LONGEST * recorded:
        raise InputError.at(
            "pauses",
            f"at most {_LONGEST * recorded:.4g} s together, {_LONGEST:g} times what was recorded",
            f"{sum(seconds):.4g} s",
            "give the recordings without --pauses: each then begins anew",
        )
    drives, responses, masks = [listed[0].drive], [listed[0].response], [_masked(listed[0])]
    for (before, after), pause in zip(pairwise(listed), seconds, strict=True):
        share = np.arange(1, max(round(pause / step), 1)) * step / max(pause, step)
        for parts, name in ((drives, "drive"), (responses, "response")):
            last, first = getattr(before, name)[-1], getattr(after, name)[0]
            parts += [last + (first - last) * share, getattr(after, name)]
        masks += [np.ones(share.size, bool), _masked(after)]
    gaps = ", ".join(f"{pause:.4g}" for pause in seconds)
    sources = ", ".join(r.source for r in listed)
    note = (
        f"{sources} are one recording, in this order: the pauses between them, of {gaps} s, count "
        "for no fit, and the drive goes through them in a straight line."
    )
    kept = dict.fromkeys(w for recording in listed for w in recording.warnings)
    masked = np.concatenate(masks)
    return replace(
        listed[0],
        drive=np.concatenate(drives),
        response=np.concatenate(responses),
        source=" + ".join(r.source for r in listed),
        warnings=(*kept, note),
        masked=masked if masked.any() else None,
    )


def _masked(recording: Recording) -> np.ndarray:
    """Which samples (N,) do not count."""
    return np.zeros(len(recording), bool) if recording.masked is None else recording.masked


def _began(recording: Recording) -> float:
    """When a recording began [s].  Raises InputError where its file does not say."""
    if recording.began is None:
        raise InputError.at(
            recording.source,
            "a date or a time that says when it began",
            "none",
            'say the pauses, such as --pauses "2 s"',
        )
    return recording.began


def _between(before: Recording, after: Recording) -> float:
    """The time [s] from the last sample of one to the first of the next, by their stamps."""
    pause = _began(after) - _began(before) - (len(before) - 1) * before.dt
    if pause < 0.5 * before.dt:
        raise InputError.at(
            after.source,
            f"a beginning after the end of {before.source}",
            f"{-pause:.4g} s before it",
            'say the pauses, such as --pauses "2 s"',
        )
    return pause


def _stated(pauses: str | float | Sequence[str | float], count: int) -> list[float]:
    """Pauses [s] as a call gives them."""
    listed = pauses.split(",") if isinstance(pauses, str) else np.atleast_1d(pauses).tolist()
    seconds = [parse_quantity(each, "s", "pauses") for each in listed]
    if len(seconds) == 1:
        seconds *= count
    if len(seconds) != count:
        raise InputError.at(
            "pauses",
            f"{count}, one between each two recordings",
            f"{len(seconds)}",
            "give them all",
        )
    for pause in seconds:
        if pause < 0:
            raise InputError.at("pauses", "times of 0 s or more", f"{pause:g} s", "correct it")
    return seconds
