"""What a recording holds, before anything is fitted to it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._prepare import Noise, measured_noise, top_frequency
from .._recording import Recording
from .._show import quantity
from ._doubts import doubts_about
from ._drive_kind import kind_of_drive

_LEVELS = 64
_ENOUGH = 100_000
"""Samples that tell a noise level."""
_PERIODS = 4
_BAR = 20
"""Characters of the longest bar."""


def describe(
    recording: Recording, columns: Mapping[str, str | int] | None = None
) -> dict[str, Any]:
    """A recording as plain data: what was understood, and what stands in the way of a fit.

    `columns`: by "time", "input" and "output", where in its file it was found.
    """
    columns = columns or {}
    kind, repeats = kind_of_drive(recording), recording.drive_period()
    counted = recording.response
    if recording.masked is not None:
        counted = counted[~recording.masked]
    noise = _noise_of(recording)
    return {
        "schema": "fracjax.info/1",
        "source": recording.source,
        "time": {"column": columns.get("time")},
        "samples": len(recording),
        "rate_Hz": recording.rate,
        "duration_s": len(recording) * recording.dt,
        "drive": {
            "column": columns.get("input"),
            "unit": recording.drive_unit,
            "low": float(recording.drive.min()),
            "high": float(recording.drive.max()),
            "kind": kind,
            "top_frequency_Hz": None if kind == "rest" else top_frequency(recording),
        },
        "response": {
            "column": columns.get("output"),
            "unit": recording.response_unit,
            "low": float(counted.min()),
            "high": float(counted.max()),
        },
        "period": None
        if repeats is None
        else {
            "seconds": repeats.period * recording.dt,
            "repeats": (repeats.stop - repeats.start) / repeats.period,
            "from_s": repeats.start * recording.dt,
            "to_s": repeats.stop * recording.dt,
        },
        "rests_s": [
            [start * recording.dt, stop * recording.dt]
            for start, stop in recording.static_stretches()
        ],
        "loop_opening_percent": loop_opening(recording),
        "noise": None if noise is None else noise.to_dict(),
        "warnings": [*recording.warnings, *recording.checks(), *doubts_about(recording)],
    }


def shown_by(recording: Recording) -> list[dict[str, Any]] | None:
    """The smallest size of each effect of dynamics that a recording would show, whatever its law of
    hysteresis; None where no noise can be read from it."""
    noise = _noise_of(recording)
    if noise is None or kind_of_drive(recording) == "rest":
        return None
    from .._path import can_show  # takes as long to import as all else of `info`
    from .._protocol import MOST, as_read, recorded_signal

    signals = as_read(recorded_signal(recording, noise), MOST)
    shown = can_show(signals, recording.response_unit)
    return [vars(one) for one in shown]


def shown_rows(shown: Sequence[dict[str, Any]] | None) -> list[list[str]]:
    """What a recording can show: each effect with a bar, as long as the logarithm of the smallest
    size that would be seen, and that size or why none would be."""
    if shown is None:
        return [["–", "", "not known: no noise is seen; record a rest, or repeat the drive"]]
    sizes = [one["size"] for one in shown if one["size"] is not None]
    ends = (0.5 * min(sizes), max(sizes)) if sizes else (1.0, 2.0)
    rows = []
    for one in shown:
        if one["size"] is None:
            rows.append([one["effect"], _BAR * "░", f"not at any size: {one['reason']}"])
            continue
        share = math.log(one["size"] / ends[0]) / math.log(ends[1] / ends[0])
        text = f"{quantity(one['size'], one['unit'])} peak to peak"
        rows.append([one["effect"], max(round(share * _BAR), 1) * "█", text])
    return rows


def _noise_of(recording: Recording) -> Noise | None:
    """The noise of a recording; of a long one that of as many periods, or of as much of a rest, as
    determine it to a few per mille."""
    stretch = slice(0, len(recording))
    if len(recording) > 2 * _ENOUGH:
        repeats, rests = recording.drive_period(), recording.static_stretches()
        if repeats is not None:
            count = max(_PERIODS, _ENOUGH // repeats.period)
            stretch = slice(
                repeats.start, min(repeats.start + count * repeats.period, repeats.stop)
            )
        elif rests:
            start, stop = max(rests, key=lambda rest: rest[1] - rest[0])
            stretch = slice(start, min(start + _ENOUGH, stop))
    if not np.ptp(recording.response[stretch]):
        stretch = slice(0, len(recording))
    part = recording.window(stretch.start, stretch.stop)
    masked = recording.masked
    counts = None if masked is None else (~masked[stretch]).astype(float)
    return measured_noise(part, counts=counts)


def _mean_cycle(recording: Recording) -> np.ndarray | None:
    """Drive and response averaged over all whole periods, shape (2, period)."""
    repeats = recording.drive_period()
    if repeats is None:
        return None
    count = (repeats.stop - repeats.start) // repeats.period
    stretch = slice(repeats.start, repeats.start + count * repeats.period)
    signals = np.stack([recording.drive[stretch], recording.response[stretch]])
    return signals.reshape(2, count, repeats.period).mean(axis=1)


def loop_opening(recording: Recording) -> float | None:
    """Largest height of the mean loop over the response's span [%], None without repeats.

    At each level of the drive the height is the span of the response over all passages.
    """
    cycle = _mean_cycle(recording)
    if cycle is None:
        return None
    u, y = np.append(cycle, cycle[:, :1], axis=1)
    heights = []
    for level in np.linspace(u.min(), u.max(), _LEVELS + 2)[1:-1]:
        at = np.flatnonzero((u[:-1] < level) != (u[1:] < level))
        passages = y[at] + (level - u[at]) / (u[at + 1] - u[at]) * (y[at + 1] - y[at])
        heights.append(np.ptp(passages))
    return float(100 * max(heights) / np.ptp(y))
