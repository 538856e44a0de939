"""What path curves need of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Signal:
    """What path curves need of a recording: drive (N,) and response (N,), its step [s], whether it
    is of steady cycles, the noise's whitening filter (p+1,), the samples' weights (N,), 0 for one
    that does not count, and the rms error (N,) of the drive."""

    drive: np.ndarray
    response: np.ndarray
    step: float
    periodic: bool
    taps: np.ndarray
    weights: np.ndarray
    drive_error: np.ndarray

    def weighted_by(self, slope: np.ndarray) -> Signal:
        """The same with the error of the drive in the noise, through the response's slope (N,)."""
        moved = slope * self.drive_error * abs(self.taps[0])
        return replace(self, weights=self.weights / np.sqrt(1 + moved**2))


def response_of(signals: Sequence[Signal]) -> np.ndarray:
    """The responses (ΣN,) of recordings, each minus its first value."""
    return np.concatenate([s.response - s.response[0] for s in signals])


def span_of(signals: Sequence[Signal]) -> float:
    """The largest range of the responses of recordings."""
    return max(float(np.ptp(s.response)) for s in signals)


def ends_of(signals: Sequence[Signal]) -> np.ndarray:
    """Where one recording ends and the next begins."""
    return np.cumsum([s.drive.size for s in signals])[:-1]
