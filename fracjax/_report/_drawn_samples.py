"""Which samples of a recording are drawn, and where each lies along the axes of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._recording import Recording

if TYPE_CHECKING:
    from .._diagnose import Axis

_WHOLE = 6000
"""Recordings of at most so many samples are drawn whole."""
_PIXELS = 1000
"""Stretches whose extremes are drawn of longer ones: as many as a plot is wide, in pixels."""
_MOVING = 1e-3
"""Least rate of a moving drive, as a share of its largest, as for the diagnosis' strips."""


def drawn_samples(signals: Sequence[np.ndarray]) -> np.ndarray:
    """The indices of the samples to draw: all of a short recording, or the extremes of each signal
    (N,) in each of as many equal stretches as a plot is wide."""
    count = signals[0].size
    if count <= _WHOLE:
        return np.arange(count)
    starts = np.linspace(0, count, _PIXELS, endpoint=False).astype(int)
    chosen = [np.array([0, count - 1])]
    for signal in signals:
        for extreme in (np.argmin, np.argmax):
            pieces = np.split(signal, starts[1:])
            chosen.append(starts + np.array([extreme(piece) for piece in pieces]))
    return np.unique(np.concatenate(chosen))


def bins_of_samples(recording: Recording, axes: Sequence[Axis]) -> dict[str, np.ndarray]:
    """For each axis along which samples can be ordered the bin (N,) of every sample, -1 outside.

    The axes of frequency and of harmonics have no place for a single sample.
    """
    rates = np.gradient(recording.drive, recording.dt)
    repeats = recording.drive_period()
    coordinates = {
        "time": recording.times,
        "level": recording.drive,
        "rate": rates,
        "reversal": _since_reversal(rates, recording.dt),
    }
    if repeats is not None:
        coordinates["phase"] = np.arange(len(recording)) / repeats.period % 1 * 360
    bins = {}
    for axis in axes:
        if axis.axis in coordinates:
            bins[axis.axis] = _bins(coordinates[axis.axis], axis.edges)
    return bins


def _bins(values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """The bin between edges (n+1,) of every value (N,), -1 outside; both ends are included."""
    within = (edges[0] <= values) & (values <= edges[-1])
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, edges.size - 2)
    return np.where(within, index, -1).astype(np.int8)


def _since_reversal(rates: np.ndarray, step: float) -> np.ndarray:
    """The time [s] since the drive last turned, half a step at the first sample after it."""
    moving = np.where(np.abs(rates) > _MOVING * np.abs(rates).max(), np.sign(rates), 0)
    samples = np.arange(moving.size)
    direction = moving[np.maximum.accumulate(np.where(moving != 0, samples, 0))]
    turns = np.concatenate([[0], np.flatnonzero(np.diff(direction) != 0) + 1])
    return (samples - turns[np.searchsorted(turns, samples, side="right") - 1] + 0.5) * step
