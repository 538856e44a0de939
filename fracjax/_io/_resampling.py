"""Channels brought to one uniform rate."""

from typing import NamedTuple

import numpy as np

from fracjax._io._clocks import Clock
from fracjax._io._segments import LONGEST_GAP, gaps
from fracjax._recording import MINIMUM_SAMPLES, InputError

_FINEST = 100
"""Most samples that resampling makes of one."""
_GAP = 1.5
"""Steps beyond which samples are missing."""


class Channel(NamedTuple):
    """Samples (N,) and when they were taken; where they are bad, they are not used."""

    samples: np.ndarray
    clock: Clock
    bad: np.ndarray


class Resampled(NamedTuple):
    """Channels on one uniform grid."""

    samples: dict[str, np.ndarray]
    bad: np.ndarray
    """(N,), where any channel was bad."""
    note: str


def resampled(channels: dict[str, Channel], rate: float, source: str) -> Resampled:
    """Channels at a uniform rate [Hz] over the time they have in common, by monotone cubics.

    The cubics (F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5, 1984) never leave the
    range of the two samples they join: no swing appears in a gap or beside a step that was not
    recorded, as a spline would invent. Of a smooth signal they are off by up to |y''| h²/8 for
    a gap h [s] where it turns, as straight lines are, and by less elsewhere.

    Raises InputError for a rate that leaves too few samples or invents too many.
    """
    from scipy.interpolate import PchipInterpolator

    first = max(float(each.clock.times[0]) for each in channels.values())
    last = min(float(each.clock.times[-1]) for each in channels.values())
    span = last - first
    if span <= 0:
        raise InputError.at(
            source,
            "drive and response at the same time",
            "times that do not overlap",
            "give files of the same run",
        )
    for each in channels.values():
        if wide := gaps(each.clock.times):
            gap = each.clock.times[wide[0]] - each.clock.times[wide[0] - 1]
            raise InputError.at(
                f"{source}, --resample",
                f"no gap of more than {LONGEST_GAP} steps",
                f"one of {gap:.4g} s after {each.clock.times[wide[0] - 1] - first:.6g} s",
                f"split the file at its gap of {gap:.4g} s",
            )
    finest = max(len(each.samples) / np.ptp(each.clock.times) for each in channels.values())
    usual = max(1 / each.clock.step for each in channels.values())
    lowest, highest = MINIMUM_SAMPLES / span, _FINEST * finest
    if not lowest <= rate <= highest:
        widest = max(float(np.diff(each.clock.times).max()) for each in channels.values())
        remedy = f"give one such as {usual:.4g}Hz"
        if not lowest <= usual <= highest:
            remedy = f"split the file at its gap of {widest:.4g} s"
        raise InputError.at(
            f"{source}, --resample",
            f"a rate from {lowest:.3g} Hz, which gives {MINIMUM_SAMPLES} samples, to "
            f"{highest:.3g} Hz, which makes {_FINEST} of each",
            f"{rate:g} Hz beside samples at {usual:.4g} Hz",
            remedy,
        )
    count = 1 + int(span * rate * (1 + 1e-9))
    grid = np.minimum(first + np.arange(count) / rate, last)
    samples, bad = {}, np.zeros(count, bool)
    for role, each in channels.items():
        good = ~each.bad
        with np.errstate(all="ignore"):
            samples[role] = PchipInterpolator(
                each.clock.times[good], each.samples[good], extrapolate=True
            )(grid)
        bad |= np.interp(grid, each.clock.times, each.bad.astype(float)) > 0
    return Resampled(samples, bad, _note(channels, grid, rate, first, source))


def _note(
    channels: dict[str, Channel], grid: np.ndarray, rate: float, first: float, source: str
) -> str:
    """What was done, and how much of the result was never measured."""
    invented, widest, where = 0, 0.0, 0.0
    for each in channels.values():
        steps = np.diff(each.clock.times)
        gaps = np.flatnonzero(steps > _GAP * each.clock.step)
        inside = [
            np.count_nonzero(
                (grid > each.clock.times[at] + each.clock.step / 2)
                & (grid < each.clock.times[at + 1] - each.clock.step / 2)
            )
            for at in gaps
        ]
        invented = max(invented, int(np.sum(inside)))
        if steps.max() > widest:
            widest, where = float(steps.max()), float(each.clock.times[steps.argmax()]) - first
    note = (
        f"{source}: resampled to {rate:.6g} Hz by monotone cubics; the largest gap bridged is "
        f"{widest:.4g} s, {where:.6g} s after the first sample."
    )
    if invented:
        note += f" {invented} of {len(grid)} samples lie in gaps and were invented."
    slowest = {
        role: 1 / each.clock.step for role, each in channels.items() if rate > 1.5 / each.clock.step
    }
    for role, hertz in slowest.items():
        name = {"input": "drive", "output": "response"}[role]
        note += f" The {name} has about {hertz:.3g} Hz: between its samples it was interpolated."
    folded = max(1 / each.clock.step for each in channels.values())
    if rate < 0.9 * folded:
        note += (
            f" The file has about {folded:.3g} Hz: what is faster than {rate / 2:.4g} Hz folds "
            "down, as nothing was filtered."
        )
    return note
