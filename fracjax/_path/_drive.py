r"""A measured drive without most of its noise, and what of it is left.

Turning points and branches need a drive without noise, and what noise it keeps moves the response
by slope × noise.  The level is that of sixth differences, in which a smooth drive vanishes; the
drive is replaced by local cubics, each over the longest window in which they fit to the noise.

Source: Savitzky & Golay, Anal. Chem. 36 (1964) 1627; Lepski, Theory Probab. Appl. 35 (1991) 454;
Fuller, Measurement Error Models (1987).
"""

from __future__ import annotations

from math import comb

import numpy as np
from scipy.interpolate import Akima1DInterpolator
from scipy.ndimage import uniform_filter1d

from .._recording import runs_of
from ._kernels import smoothness

_ORDER = 6
"""Of the differences."""
_LEAST = 1e-7
"""The noise, over the span, below which a drive counts as computed: rounding of its digits."""
_WINDOWS = (5, 9, 15, 25, 41, 81, 161, 321)
"""Lengths of the windows [samples]: a hold's noise is a path that the drive has not travelled."""
_FITS = 2.7
"""How many standard deviations the mean square of the distance from a local cubic may be above the
noise's for it to fit."""
_STRAYS = 5.0
"""The mean square of the distance of a cubic from that of the window before, over what noise makes
of it along the two or three directions in which they differ, up to which the longer one bends
nothing away (Lepski's rule)."""
_MOVES = 5.0
"""The slope, over its standard deviation, from which a drive moves."""
_NEAR = 3.0
"""How far the ends of a hold may be from its mean, over their errors."""
_NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a standard normal variable."""


def denoised(drive: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A drive (N,) without most of its noise, and the rms error (N,) that is left, both in its
    unit."""
    differences = np.abs(np.diff(drive, _ORDER))
    level = float(np.median(differences)) / (_NORMAL_MEDIAN * np.sqrt(comb(2 * _ORDER, _ORDER)))
    if level <= _LEAST * np.ptp(drive) or drive.size <= _WINDOWS[0]:
        return drive, np.zeros_like(drive)
    from scipy.signal import savgol_filter  # computed drives do without; it takes long to import

    smooth, error = drive.copy(), np.full(drive.size, level)
    fits, shorter, variance = np.ones(drive.size, dtype=bool), drive, 1.0
    stands = np.zeros(drive.size, dtype=bool)
    for window in (w for w in _WINDOWS if w <= drive.size):
        cubic = np.asarray(savgol_filter(drive, window, 3))
        # A cubic's middle has 9/4 over the window of the noise's variance.
        strayed, own = ((cubic - shorter) / level) ** 2, 2.25 / window
        rest = uniform_filter1d(((drive - cubic) / level) ** 2, window)
        fits &= rest <= 1 + _FITS * np.sqrt(2 / window)
        fits &= uniform_filter1d(strayed, window) <= _STRAYS * (variance - own)
        smooth, error = (
            np.where(fits, new, old)
            for new, old in ((cubic, smooth), (level * np.sqrt(own), error))
        )
        shorter, variance = cubic, own
        slope = np.asarray(savgol_filter(drive, window, 1, deriv=1))
        stands = np.where(fits, np.abs(slope) <= _MOVES * level * np.sqrt(12 / window**3), stands)
    for first, stop in runs_of(stands):
        hold = slice(first, stop)
        _settle(smooth[hold], error[hold], drive[hold], level)
    return smooth, error


def _settle(smooth: np.ndarray, error: np.ndarray, drive: np.ndarray, level: float) -> None:
    """Let a stretch (n,) of a drive be a hold, where it is one: then it has travelled no path."""
    mean = float(drive.mean())
    near = np.flatnonzero(np.abs(smooth - mean) <= _NEAR * error)
    if not near.size:
        return
    held = slice(near[0], near[-1] + 1)
    if np.mean((smooth[held] - mean) ** 2) <= _STRAYS * np.mean(error[held] ** 2):
        smooth[held], error[held] = mean, level / np.sqrt(near[-1] + 1 - near[0])


def unresolved(drive: np.ndarray) -> np.ndarray:
    """How far the mean of a drive (N,) about each sample may be from that of a curve through its
    samples, in its unit, where it is not smooth.

    A corner at a sample bends the drive there alone; one between two samples, a part f of the way,
    bends it by 1 - f and f of what it is, and is off by f (1 - f)/2 of it.
    """
    bends = np.pad(np.abs(np.diff(drive, 2)), 1)
    whole = np.maximum(bends[:-1] + bends[1:], 1e-300)
    between = 0.5 * bends[:-1] * bends[1:] / whole
    off = np.maximum(np.append(between, 0.0), np.insert(between, 0, 0.0))
    return off * (1 - smoothness(drive, periodic=False))


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
