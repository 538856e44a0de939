"""What a recording shows of its sensors and its clock that a fit would not reveal."""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np

from fracjax._recording._periods import Repeats, runs_of, unit_range
from fracjax._recording._spectrum import fastest
from fracjax._show import pretty_unit, quantity

_ON_LADDER, _ON_LADDER_SHARE = 0.1, 0.9
"""Largest distance of a rung from a multiple of the least, and least share of rungs so near, of
values that were rounded; chosen by judgement: a fifth of what is not rounded is as near."""


class Sampled(Protocol):
    """What the warnings look at: the signals of a recording, their units and clock."""

    @property
    def drive(self) -> np.ndarray:
        """Shape (N,), in `drive_unit`."""
        ...

    @property
    def response(self) -> np.ndarray:
        """Shape (N,), in `response_unit`."""
        ...

    @property
    def drive_unit(self) -> str:
        """The unit of the drive."""
        ...

    @property
    def response_unit(self) -> str:
        """The unit of the response."""
        ...

    @property
    def masked(self) -> np.ndarray | None:
        """The samples that no fit counts, shape (N,)."""
        ...

    @property
    def dt(self) -> float:
        """The step [s]."""
        ...

    @property
    def rate(self) -> float:
        """The sampling rate [Hz]."""
        ...

    spikes: cached_property[np.ndarray]
    """The samples of the response that stand alone, shape (N,)."""

    def __len__(self) -> int: ...

    def drive_period(self) -> Repeats | None:
        """The periodic stretch of the drive."""
        ...


def warnings_about(recording: Sampled) -> tuple[str, ...]:
    """All of them, in plain sentences."""
    overflow = _overflow(recording)
    warnings = (
        *(_clipping(recording), _quantisation(recording), _quantised_drive(recording)),
        *(_undersampling(recording), _unresolved_edges(recording)),
        # What overflows and returns within few samples looks like a spike.
        *(overflow or _spikes(recording), _leading(recording)),
        _duplicate(recording),
    )
    return tuple(warning for warning in warnings if warning)


_LEAD = 0.003
"""Least area of a loop that runs the wrong way round, as a share of its box."""


def _clipping(recording: Sampled) -> str | None:
    """A response that rests on its extreme value while the drive moves on."""
    response = recording.response
    stuck = (np.diff(recording.drive) != 0) & (np.diff(response) == 0)
    for name, end, rest in (
        ("largest", response.max(), response < response.max()),
        ("smallest", response.min(), response > response.min()),
    ):
        inner = (np.max if name == "largest" else np.min)(response[rest])
        count, beside = (int(np.sum(stuck & (response[1:] == level))) for level in (end, inner))
        if count >= 10 and count > 5 * beside:
            return (
                f"The response stays at its {name} value, "
                f"{end:g} {pretty_unit(recording.response_unit)}, for {count} samples while the "
                "drive moves: the sensor or its range is clipped."
            )
    return None


def _few_levels(signal: np.ndarray) -> np.ndarray | None:
    """The distinct values of a signal (N,) in order; None where they are many.

    Where a hundredth of the samples has many, all have, and need not be sorted.
    """
    for part in (signal[:: max(1, len(signal) // 9_973)], signal):
        levels = np.unique(part)
        if len(levels) >= min(200, len(signal) / 4):
            return None
    return levels


def _quantisation(recording: Sampled) -> str | None:
    """A response that takes few distinct values."""
    levels = _few_levels(recording.response)
    if levels is None or len(levels) < 2:
        return None
    apart = np.diff(levels)
    # What repeats without noise has few values as well, but they are not those of a ladder.
    rungs = apart / apart.min()
    if np.mean(np.abs(rungs - np.round(rungs)) < _ON_LADDER) < _ON_LADDER_SHARE:
        return None
    return (
        f"The response takes only {len(levels)} distinct values, about "
        f"{quantity(float(np.median(apart)), recording.response_unit)} apart: "
        "rounding of that size will look like mismatch."
    )


def _quantised_drive(recording: Sampled) -> str | None:
    """A drive that moves, and was recorded on few evenly spaced levels."""
    levels = _few_levels(recording.drive)
    if levels is None or len(levels) < 16:
        return None
    level = np.searchsorted(levels, recording.drive)
    apart, moves = np.diff(levels), np.diff(level)
    step = float(np.median(apart))
    even = np.abs(apart - step).max() < 0.02 * step
    # A staircase rests as long on every level as on the others, and a ramp on none.
    dwell = np.diff(np.flatnonzero(moves))
    glides = dwell.size > 0 and (np.median(dwell) <= 4 or np.median(dwell) < 0.2 * dwell.max())
    held = len(np.unique(level[1:][moves == 0]))
    if not (even and glides and 2 * held > len(levels) and np.mean(np.abs(moves) <= 1) > 0.9):
        return None
    return (
        f"The drive takes only {len(levels)} distinct values, "
        f"{quantity(step, recording.drive_unit)} apart: it was recorded more coarsely than it "
        "moved, and what the model makes of its steps will look like mismatch."
    )


def _spikes(recording: Sampled) -> str | None:
    """Samples of the response that stand alone."""
    alone = recording.spikes
    if recording.masked is not None:
        alone = alone & ~recording.masked
    if not 0 < np.count_nonzero(alone) <= 0.02 * len(recording):
        return None
    at = recording.dt * int(alone.argmax())
    return (
        f"The response has {np.count_nonzero(alone)} sample(s) far from those before and behind, "
        f"the first at {at:.6g} s: spikes. Leave them out with --mask bad."
    )


def _leading(recording: Sampled) -> str | None:
    """A response that is ahead of its drive: the mean loop runs the wrong way round."""
    repeats = recording.drive_period()
    if repeats is None:
        return None
    count = (repeats.stop - repeats.start) // repeats.period
    stretch = slice(repeats.start, repeats.start + count * repeats.period)
    drive, response = (
        signal[stretch].reshape(count, -1).mean(axis=0) - signal[stretch].mean()
        for signal in (recording.drive, recording.response)
    )
    spans = np.ptp(drive) * np.ptp(response)
    likeness = float(drive @ response) / float(np.sqrt((drive @ drive) * (response @ response)))
    # ∮ y du is negative where y lags behind u.
    area = np.sign(likeness) * float(response @ (np.roll(drive, -1) - np.roll(drive, 1))) / 2
    if abs(likeness) < 0.5 or area < _LEAD * spans:
        return None
    return (
        "The response leads the drive: their loop runs the wrong way round, by "
        f"{100 * area / spans:.2g} % of its box. The channels are skewed in time, or drive and "
        "response are swapped: check their clocks, --input and --output. A force leads the motion "
        "that it causes: take the force as the drive."
    )


def _duplicate(recording: Sampled) -> str | None:
    """A response that is the drive itself, scaled or not."""
    u, y = (unit_range(each) for each in (recording.drive, recording.response))
    if np.ptp(recording.drive) == 0 or np.abs(u - y).max() > 1e-12:
        return None
    return (
        "The response repeats the drive sample by sample: the file holds one channel twice, or the "
        "wrong column was taken. Choose another with --output."
    )


_OVERFLOW = 0.75
"""Least jump of a response that overflowed, as a share of its range, and the share of its range
within which the drive moves meanwhile."""


def _overflow(recording: Sampled) -> str | None:
    """A response that jumps from one end of its range to the other and back while the drive glides,
    as a number too large for its converter or counter does."""
    y, u = unit_range(recording.response), unit_range(recording.drive)
    jumps = np.diff(y)
    beyond = (np.abs(jumps) > _OVERFLOW) & (np.abs(np.diff(u)) < 0.25)
    ups, downs = np.count_nonzero(beyond & (jumps > 0)), np.count_nonzero(beyond & (jumps < 0))
    if not (ups and downs and abs(ups - downs) <= 1):
        return None
    turns = np.concatenate([[0], np.cumsum(np.where(beyond, np.sign(jumps), 0.0))])
    # Counted on, the jumps are gone: what remains of each is no larger than elsewhere.
    size = float(np.median(np.abs(jumps[beyond])))
    rest = np.abs(np.diff(y - size * turns))
    # A spike jumps twice within few samples, whereas what overflows stays there for a while.
    if rest[beyond].max() > 0.1 or ups + downs <= 2 * np.count_nonzero(recording.spikes):
        return None
    at = recording.dt * int(beyond.argmax() + 1)
    return (
        f"The response jumps through its range {ups + downs} times while the drive glides, first "
        f"at {at:.6g} s: it overflowed. Record it with a smaller gain, or count it on before."
    )


_UNRESOLVED = 0.1
"""Least error of the interpolation of a sample, as a share of the drive's range, at an edge whose
course the samples do not tell."""


def _unresolved_edges(recording: Sampled) -> str | None:
    """Edges of the drive that are over from one sample to the next."""
    u = unit_range(recording.drive)
    # The error of the cubic through two samples on either side; it is half of a step at its edge.
    cubic = (4 * (u[1:-3] + u[3:-1]) - u[:-4] - u[4:]) / 6
    unresolved = np.abs(u[2:-2] - cubic) > _UNRESOLVED
    edges = runs_of(unresolved)
    # Where most of the drive is so, it has too few samples per period.
    if not len(edges) or np.mean(unresolved) > 0.1:
        return None
    return (
        f"The drive has {len(edges)} edge(s) between one sample and the next, the first at "
        f"{recording.dt * int(edges[0, 0] + 2):.6g} s: when it moved within the step is not "
        "recorded, and the response of the next samples will look like mismatch unless the edges "
        "fall on samples. Soften the edges, or record the drive faster."
    )


def _undersampling(recording: Sampled) -> str | None:
    """A drive whose fastest part (99 % of the power lies below) has few samples per period."""
    samples = 1 / fastest(recording.drive)
    if samples >= 10:
        return None
    return (
        f"The fastest part of the drive, near {recording.rate / samples:.3g} Hz, has only "
        f"{samples:.1f} samples per period: at least 10 are needed to follow its loop."
    )
