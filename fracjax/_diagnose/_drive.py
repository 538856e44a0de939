"""What a recording needs before it is asked, and what its loop says of it: spikes, a rounded drive,
more samples than the drive's band needs, a loop that no actuator runs through."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev
from scipy.ndimage import gaussian_filter1d

from .._operators import interpolate
from .._prepare import top_frequency
from .._recording import Recording, spikes

_WIDTHS = (48, 32, 24, 16, 12, 8, 6, 4, 3, 2)
_WITHIN = 0.75
_COARSE = 1e-3
_MOST_SAMPLES, _PER_PERIOD, _LEAST_RATE = 12_000, 32, 1000.0
_MOST_SPIKES, _MOST_TIMES = 0.02, 5
_STRONG, _EVEN, _LEAD, _CURVES = 0.3, 0.5, np.radians(5.0), 6


def drive_step(drive: np.ndarray) -> float:
    """The step between the codes that a drive (N,) is written in, where that is coarse; else 0."""
    span = float(np.ptp(drive))
    gaps = np.diff(np.unique(drive))
    step = float(gaps.min()) if gaps.size else 0.0
    codes = np.round(gaps / step) if step else gaps
    on_grid = bool(step) and np.all(np.abs(gaps / step - codes) < 0.1)
    return step if on_grid and step > _COARSE * span else 0.0


def unrounded(recording: Recording) -> tuple[Recording, str]:
    """A recording whose rounded drive follows the smoothest course that its codes leave open, and
    what is to be said of that; one that is held in steps stays as it is.

    A rounded drive moves in jumps that the actuator has never seen: what it does not answer to
    looks like a lag or a mode.
    """
    drive, step = recording.drive, drive_step(recording.drive)
    if step == 0 or interpolate(drive, 1)[1] == "hold":
        return recording, ""
    for width in _WIDTHS:
        smooth = gaussian_filter1d(drive, width, mode="nearest")
        if np.abs(smooth - drive).max() <= _WITHIN * step:
            said = (
                f"{recording.source}: the drive is written in steps of {step:.3g} "
                f"{recording.drive_unit}; it was smoothed within them over {width} samples. Record "
                "it with more digits."
            )
            return replace(recording, drive=smooth), said
    return recording, ""


def without_spikes(recording: Recording) -> tuple[Recording, str]:
    """A recording whose spikes no fit counts, and what is to be said of them."""
    alone = spikes(recording.response)
    if not 0 < alone.sum() <= _MOST_SPIKES * len(recording):
        return recording, ""
    masked = alone if recording.masked is None else alone | recording.masked
    times = ", ".join(f"{k * recording.dt:.6g}" for k in np.flatnonzero(alone)[:_MOST_TIMES])
    more = ", …" if alone.sum() > _MOST_TIMES else ""
    said = (
        f"{recording.source}: {alone.sum()} samples stand alone, far from their neighbours, at "
        f"{times}{more} s: spikes, which were left out."
    )
    return replace(recording, masked=masked), said


def thinned(recording: Recording) -> tuple[Recording, str]:
    """A long recording at the rate that the drive's band needs, and what is to be said of that."""
    needed = max(_PER_PERIOD * top_frequency(recording), _LEAST_RATE)
    every = int(min(len(recording) / _MOST_SAMPLES, recording.rate / needed))
    if every < 2:
        return recording, ""
    said = (
        f"{recording.source}: every {every}th of {len(recording)} samples was used, as many as the "
        f"drive's band up to {top_frequency(recording):.3g} Hz needs."
    )
    masked = None if recording.masked is None else recording.masked[::every]
    fewer = replace(
        recording,
        masked=masked,
        drive=recording.drive[::every],
        response=recording.response[::every],
        dt=every * recording.dt,
    )
    return fewer, said


def _explained(response: np.ndarray, curves: np.ndarray) -> float:
    """The squares of a centred response (N,) that curves (N, k) of the drive explain."""
    centred = curves - curves.mean(axis=0)
    fitted = centred @ np.linalg.lstsq(centred, response, rcond=None)[0]
    return float(fitted @ fitted)


def wrong_way(recording: Recording) -> str:
    """What is to be said of a loop that no actuator runs through: a response that leads its drive,
    or that is even in it; nothing of others."""
    drive = recording.drive - recording.drive.mean()
    response = recording.response - recording.response.mean()
    lines, answer = np.fft.rfft(drive), np.fft.rfft(response)
    strong = np.abs(lines) > _STRONG * np.abs(lines).max()
    strong[0] = False
    # Above a mode a response may seem to lead.
    strong[2 * int(np.argmax(strong)) :] = False
    coherent = np.sum(np.conj(lines[strong]) * answer[strong])
    size = np.sqrt(np.sum(np.abs(lines[strong]) ** 2) * np.sum(np.abs(answer[strong]) ** 2))
    lead = float(np.angle(coherent * np.sign(coherent.real or 1.0)))
    curves = chebyshev.chebvander(2 * (drive - drive.min()) / np.ptp(drive) - 1, _CURVES)[:, 1:]
    by_odd, by_even = (_explained(response, curves[:, k::2]) for k in (0, 1))
    if by_even > _EVEN * response @ response > by_odd:
        return (
            f"{recording.source}: the response is even in the drive, a butterfly loop, which no "
            "model here gives; diagnose one branch, or measure a quantity that keeps the sign."
        )
    if lead > _LEAD and abs(coherent) > _EVEN * size:
        return (
            f"{recording.source}: the response leads the drive by {np.degrees(lead):.2g} degrees, "
            "and its loop runs the wrong way: the channels are skewed in time or swapped; correct "
            "that first."
        )
    return ""
