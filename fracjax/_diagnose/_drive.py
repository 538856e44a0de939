"""What is corrected in a recording before its diagnosis (spikes, a rounded drive, more samples than
the drive's band needs), and loops that no actuator has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev
from scipy.ndimage import gaussian_filter1d

from .._blocks import AbstractBlock
from .._operators import interpolate
from .._prepare import top_frequency
from .._protocol import MOST, Reading, readings_of
from .._recording import Recording, resolution

# All numbers here are chosen by judgement.
_WIDTHS = (48, 32, 24, 16, 12, 8, 6, 4, 3, 2)
"""Widths of the smoothing that are tried [samples]."""
_WITHIN = 0.75
"""How far the smoothed drive may be from the recorded one, in steps between codes."""
_COARSE = 1e-3
"""The step, over the drive's span, from which a drive counts as rounded."""
_PER_PERIOD, _LEAST_RATE = 32, 1000.0
"""A recording is thinned to `MOST` samples, but not below this many per period of the drive's
highest frequency, nor below this rate [Hz]."""
_SLOW = 0.5
"""The share of samples that must show the drive for the whole of a recording to be used."""
_MOST_SPIKES, _MOST_TIMES = 0.02, 5
"""The share of samples up to which outliers are spikes, and how many times are listed."""
_STRONG = 0.3
"""The amplitude, over the largest one, from which a line of the drive counts for its phase."""
_HALF = 0.5
"""The share of the response that even curves must explain."""
_LEAD = 2.0
"""The phase by which a response may lead [degrees]."""
_OPEN = 0.5
"""The distance from a drive's end to its start, over its span, from which it makes no loop."""
_CURVES = 6
"""The order of the polynomials of the drive."""


def drive_step(drive: np.ndarray) -> float:
    """The step between the codes that a drive (N,) is written in, where that is coarse; else 0."""
    span = float(np.ptp(drive))
    step = resolution(drive) if span else 0.0
    return step if step > _COARSE * span else 0.0


def unrounded(recording: Recording) -> tuple[Recording, str]:
    """A recording with its rounded drive smoothed as far as its codes allow, and a warning; a drive
    that is held in steps stays as it is.

    A rounded drive has jumps that the actuator has never seen: the missing response to them looks
    like a lag or a resonance.
    """
    drive, step = recording.drive, drive_step(recording.drive)
    if step == 0 or interpolate(drive, 1)[1] == "hold":
        return recording, ""
    for width in _WIDTHS:
        smooth = gaussian_filter1d(drive, width, mode="nearest")
        if np.abs(smooth - drive).max() <= _WITHIN * step:
            warning = (
                f"{recording.source}: the drive is written in steps of {step:.3g} "
                f"{recording.drive_unit}; it was smoothed within them over {width} samples. Record "
                "it with more digits."
            )
            return replace(recording, drive=smooth), warning
    return recording, ""


def without_spikes(recording: Recording) -> tuple[Recording, str]:
    """A recording with its spikes masked, and a warning."""
    alone = recording.spikes
    if not 0 < alone.sum() <= _MOST_SPIKES * len(recording):
        return recording, ""
    masked = alone if recording.masked is None else alone | recording.masked
    times = ", ".join(f"{k * recording.dt:.6g}" for k in np.flatnonzero(alone)[:_MOST_TIMES])
    more = ", …" if alone.sum() > _MOST_TIMES else ""
    warning = (
        f"{recording.source}: {alone.sum()} samples stand alone, far from their neighbours, at "
        f"{times}{more} s: spikes, which were left out."
    )
    return replace(recording, masked=masked), warning


def thinned(recording: Recording) -> tuple[Recording, str]:
    """A long recording at the rate that the drive's band needs, and a warning."""
    needed = max(_PER_PERIOD * top_frequency(recording), _LEAST_RATE)
    every = int(min(len(recording) / MOST, recording.rate / needed))
    if every < 2:
        return recording, ""
    warning = (
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
    return fewer, warning


def parted(recording: Recording) -> tuple[list[Recording], str]:
    """A recording that is long even as `thinned` by fewer samples: the whole of it, and its longest
    fast stretch for itself; or, where it is fast all along, its first part; and a warning."""
    if len(recording) <= 2 * MOST:
        return [recording], ""
    whole, *stretches = readings_of(recording.drive, MOST)
    parts = [] if np.mean(whole.counted) < _SLOW else [_read(recording, whole)]
    parts += [_read(recording, stretch) for stretch in stretches]
    times = [
        f"{'all' if reading.every == 1 else f'every {reading.every}th'} from "
        f"{reading.start * recording.dt:.4g} to {reading.stop * recording.dt:.4g} s"
        for reading in (whole, *stretches)[-len(parts) :]
    ]
    warning = (
        f"{recording.source}: of {len(recording)} samples {' and '.join(times)} were used, which "
        "show the drive; diagnose other parts on their own."
    )
    return parts, warning


def _read(recording: Recording, reading: Reading) -> Recording:
    """The samples of a recording that are read."""
    own = reading.samples
    masked = ~reading.counted
    if recording.masked is not None:
        masked = masked | recording.masked[own]
    return replace(
        recording,
        masked=masked if masked.any() else None,
        drive=recording.drive[own],
        response=recording.response[own],
        dt=reading.every * recording.dt,
        began=None if recording.began is None else recording.began + reading.start * recording.dt,
    )


def _explained(response: np.ndarray, curves: np.ndarray) -> float:
    """The sum of squares of a centred response (N,) that curves (N, k) of the drive explain."""
    centred = curves - curves.mean(axis=0)
    fitted = centred @ np.linalg.lstsq(centred, response, rcond=None)[0]
    return float(fitted @ fitted)


def is_even(recording: Recording) -> bool:
    """Whether a response is even in its drive, a butterfly loop."""
    drive, response = recording.drive, recording.response - recording.response.mean()
    curves = chebyshev.chebvander(2 * (drive - drive.min()) / np.ptp(drive) - 1, _CURVES)[:, 1:]
    by_odd, by_even = (_explained(response, curves[:, k::2]) for k in (0, 1))
    return by_even > _HALF * response @ response > by_odd


def lead_of(recording: Recording) -> float:
    """By how many degrees a response leads its drive at the drive's lowest strong lines; 0 where
    it follows, or where the drive makes no loop, such as one step."""
    drive = recording.drive
    if abs(drive[-1] - drive[0]) > _OPEN * np.ptp(drive):
        return 0.0
    lines = np.fft.rfft(drive - drive.mean())
    answer = np.fft.rfft(recording.response - recording.response.mean())
    strong = np.abs(lines) > _STRONG * np.abs(lines).max()
    strong[0] = False
    # Above a resonance a response may seem to lead.
    strong[2 * int(np.argmax(strong)) :] = False
    coherent = np.sum(np.conj(lines[strong]) * answer[strong])
    lead = float(np.degrees(np.angle(coherent * np.sign(coherent.real or 1.0))))
    return lead if lead > _LEAD else 0.0


def wrong_way(recording: Recording, block: AbstractBlock, *, follows: bool) -> str:
    """The warning of a loop that no actuator has: one that is even in the drive, or one that leads
    it, unless the model `leads` by nature or `follows` as it may; "" for other loops."""
    if is_even(recording):
        return (
            f"{recording.source}: the response is even in the drive, a butterfly loop, which no "
            "model here describes; diagnose one branch, or measure a quantity that keeps the sign."
        )
    lead = lead_of(recording)
    if lead and not (follows or block.leads):
        return (
            f"{recording.source}: the response leads the drive by {lead:.2g} degrees, and its loop "
            "runs the wrong way: the channels are skewed in time or swapped; correct that first. "
            "If the drive is a motion and the response its force, which leads by nature, take a "
            "model that does too, such as impedance."
        )
    return ""
