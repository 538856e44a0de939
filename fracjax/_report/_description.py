"""What a recording holds, before anything is fitted to it."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._fit import measured_noise, top_frequency
from .._recording import Recording

_LEVELS = 64
_LINES = 30


def describe(recording: Recording) -> dict[str, Any]:
    """A recording as plain data: what was understood, and what stands in the way of a fit."""
    repeats = recording.drive_period()
    noise = measured_noise(recording)
    return {
        "schema": "fracjax.info/1",
        "source": recording.source,
        "samples": len(recording),
        "rate_Hz": recording.rate,
        "duration_s": len(recording) * recording.dt,
        "drive": {
            "unit": recording.drive_unit,
            "low": float(recording.drive.min()),
            "high": float(recording.drive.max()),
            "kind": kind_of_drive(recording),
            "top_frequency_Hz": top_frequency(recording),
        },
        "response": {
            "unit": recording.response_unit,
            "low": float(recording.response.min()),
            "high": float(recording.response.max()),
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
        "noise": None
        if noise is None
        else {"sigma": noise.sigma, "unit": noise.unit, "method": noise.method},
        "warnings": [*recording.warnings, *recording.checks()],
    }


def kind_of_drive(recording: Recording) -> str:
    """The drive's kind: steps, triangle, sine, multisine, or other where it is none of them."""
    changes = np.abs(np.diff(recording.drive))
    moving = changes[changes > 1e-3 * changes.max()]
    if moving.size <= 0.05 * changes.size:
        return "steps"
    if np.mean(np.abs(moving / np.median(moving) - 1) < 0.1) > 0.9:
        return "triangle"
    centred = recording.drive - recording.drive.mean()
    power = np.abs(np.fft.rfft(centred * np.hanning(centred.size))) ** 2
    peak = int(np.argmax(power))
    # A Hann window spreads one line over its neighbours.
    if power[max(0, peak - 2) : peak + 3].sum() > 0.995 * power.sum():
        return "sine"
    cycle = _mean_cycle(recording)
    if cycle is None:
        return "other"
    lines = np.sort(np.abs(np.fft.rfft(cycle[0]))[1:] ** 2)[::-1]
    few = min(_LINES, lines.size // 4)
    return "multisine" if lines[:few].sum() > 0.999 * lines.sum() else "other"


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
