r"""A measured drive without most of its noise, and what of it is left.

Turning points and branches need a drive without noise, and what noise it keeps moves the response
by slope × noise.  The level is that of sixth differences, in which a smooth drive vanishes; the
drive is replaced by local cubics, each over the longest window in which they fit to the noise.

Source: Savitzky & Golay, Anal. Chem. 36 (1964) 1627; Fuller, Measurement Error Models (1987).
"""

from __future__ import annotations

from math import comb

import numpy as np
from scipy.interpolate import Akima1DInterpolator
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.signal import savgol_filter

_ORDER = 6
"""Of the differences."""
_LEAST = 1e-7
"""The noise, over the span, below which a drive counts as computed: rounding of its digits."""
_WINDOWS = (5, 9, 15, 25, 41)
"""Lengths of the windows [samples]."""
_FITS = 1.6
"""The mean square of the distance from a local cubic, over the noise's, up to which it fits: noise
alone has less in 99 of 100 windows of 41 samples."""
_CORNER = 0.06
"""The rms of f(1 - f)/2 about its mean of 1/12 for a corner at any place f between samples, and at
a sample, where it is none, over the largest fourth difference that it makes."""
_NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a standard normal variable."""


def denoised(drive: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A drive (N,) without most of its noise, and the rms error (N,) that is left, both in its
    unit."""
    differences = np.abs(np.diff(drive, _ORDER))
    level = float(np.median(differences)) / (_NORMAL_MEDIAN * np.sqrt(comb(2 * _ORDER, _ORDER)))
    if level <= _LEAST * np.ptp(drive) or drive.size <= _WINDOWS[-1]:
        return drive, np.zeros_like(drive)
    smooth, error = drive.copy(), np.full(drive.size, level)
    fits = np.ones(drive.size, dtype=bool)
    for window in _WINDOWS:
        cubic = savgol_filter(drive, window, 3)
        fits &= uniform_filter1d(((drive - cubic) / level) ** 2, window) <= _FITS
        # A cubic's middle has 9/4 over the window of the noise's variance.
        smooth, error = (
            np.where(fits, new, old)
            for new, old in ((cubic, smooth), (level * np.sqrt(2.25 / window), error))
        )
    return smooth, error


def unresolved(drive: np.ndarray) -> np.ndarray:
    """How far the mean of a drive (N,) about each sample may be from that of a smooth curve through
    its samples, in its unit: corners between samples have large fourth differences."""
    fourth = np.abs(np.convolve(drive, [1, -4, 6, -4, 1], "same"))
    fourth[:2], fourth[-2:] = 0.0, 0.0
    return _CORNER * np.asarray(maximum_filter1d(fourth, 5))


def delayed(drive: np.ndarray, steps: float, *, periodic: bool) -> np.ndarray:
    """A drive (N,) some steps later; before its first sample it was constant, or of steady
    cycles."""
    margin = int(steps) + 8
    times = np.arange(-margin, drive.size)
    before = drive[times[:margin] % drive.size] if periodic else np.full(margin, drive[0])
    return np.asarray(
        Akima1DInterpolator(times, np.concatenate([before, drive]))(np.arange(drive.size) - steps)
    )


def limited(drive: np.ndarray, rate: float) -> np.ndarray:
    """A drive (N,) whose change in a step is at most `rate`, in its unit."""
    slow, last = drive.copy(), -1
    for k in np.flatnonzero(np.abs(np.diff(drive)) > rate).tolist():
        # From a step that is too fast on, until the drive is caught up.
        k = max(k, last)
        while k + 1 < slow.size:
            gap = drive[k + 1] - slow[k]
            slow[k + 1] = slow[k] + min(max(gap, -rate), rate)
            k += 1
            if slow[k] == drive[k]:
                break
        last = k
    return slow
