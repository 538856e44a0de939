"""What path curves need of a recording, and of a drive that is not recorded yet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._filters import solve_recursion
from .._path import Signal, denoised
from .._prepare import Noise
from .._recording import Recording
from ._reading import readings_of

MOST = 12_000
"""Samples by which a diagnosis reads a long recording."""
_PULSE = 4096
"""Samples along which a noise's memory is followed."""


def recorded_signal(recording: Recording, noise: Noise) -> Signal:
    """A recording with its noise."""
    drive, error = denoised(recording.drive)
    weights = np.ones(len(recording))
    if recording.masked is not None:
        weights[recording.masked] = 0.0
    weights[: noise.filter.size - 1] = 0.0
    return Signal(
        drive=drive,
        response=recording.response,
        step=recording.dt,
        periodic=False,
        taps=noise.whitening,
        weights=weights,
        drive_error=error,
    )


def noise_level(signal: Signal) -> float:
    """The rms of a recording's noise [response unit]."""
    pulse = np.zeros(_PULSE)
    pulse[0] = 1.0
    return float(np.linalg.norm(solve_recursion(signal.taps, pulse)))


def few_samples(signal: Signal, most: int) -> Signal:
    """A recording by at most `most` samples, further apart than its noise is correlated."""
    every = -(-signal.drive.size // most)
    if every == 1:
        return signal
    return Signal(
        drive=signal.drive[::every],
        response=signal.response[::every],
        step=every * signal.step,
        periodic=False,
        taps=np.array([1 / noise_level(signal)]),
        weights=signal.weights[::every],
        drive_error=signal.drive_error[::every],
    )


def ideal_signal(drive: np.ndarray, step: float, slope: float, noise: float) -> Signal:
    """A drive (N,) in steps of time [s] with a response in proportion to it, by a slope [response
    unit/drive unit], and with white noise [response unit]."""
    return Signal(
        drive=drive,
        response=slope * (drive - drive.min()),
        step=step,
        periodic=False,
        taps=np.array([1 / noise]),
        weights=np.ones(drive.size),
        drive_error=np.zeros(drive.size),
    )


def as_read(signal: Signal, most: int) -> list[Signal]:
    """A recording as a diagnosis reads it, which of a long one takes at most so many samples of the
    whole and of its longest fast stretch."""
    if signal.drive.size <= 2 * most:
        return [signal]
    signals, level = [], noise_level(signal)
    for reading in readings_of(signal.drive, most):
        own = reading.samples
        signals.append(
            replace(
                signal,
                drive=signal.drive[own],
                response=signal.response[own],
                step=signal.step * reading.every,
                taps=signal.taps if reading.every == 1 else np.array([1 / level]),
                weights=signal.weights[own] * reading.counted,
                drive_error=signal.drive_error[own],
            )
        )
    return signals
