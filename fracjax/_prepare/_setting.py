"""The magnitudes that recordings suggest: spans, rates, frequencies, resolution."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._recording import Recording, fastest, kept, varying

if TYPE_CHECKING:
    from .._blocks import Setting

_REST = 1e-2
"""A recording whose drive spans less than this share of the widest one is a rest."""


def setting_of(recordings: list[Recording]) -> Setting:
    """The magnitudes that the recordings suggest.  Raises InputError where no drive varies."""
    driven = driven_recordings(recordings)
    from .._blocks import Setting

    return Setting(
        drive_low=float(min(r.drive.min() for r in recordings)),
        drive_high=float(max(r.drive.max() for r in recordings)),
        response_span=float(max(np.ptp(r.response) for r in recordings)),
        step=float(min(r.dt for r in recordings)),
        duration=float(max(len(r) * r.dt for r in recordings)),
        top_frequency=max(top_frequency(r) for r in driven),
        top_rate=float(max(np.abs(np.diff(r.drive)).max() / r.dt for r in driven)),
        rms_rate=float(max(np.sqrt(np.mean(np.diff(r.drive) ** 2)) / r.dt for r in driven)),
        response_low=float(min(r.response.min() - r.response[0] for r in recordings)),
        resolution=min(r.resolution for r in recordings),
    )


def driven_recordings(recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings whose drive varies.

    Next to them a recording whose drive spans less than 1 % of the widest is a rest, whose measured
    drive is noise.  Raises InputError where no drive varies.
    """
    spans = [np.ptp(recording.drive) for recording in recordings]
    if not any(spans):
        varying(recordings[0].drive, f"{recordings[0].source}, drive")
    return [r for r, span in zip(recordings, spans, strict=True) if span > _REST * max(spans)]


def top_frequency(recording: Recording) -> float:
    """The frequency [Hz] below which 99 % of the power of the drive's rate lies."""
    return _top_frequency(recording.drive, recording.dt)


@kept
def _top_frequency(drive: np.ndarray, step: float) -> float:
    """The frequency [Hz] of `top_frequency`, of a drive (N,) in steps of time [s]."""
    return fastest(np.diff(drive)) / step
