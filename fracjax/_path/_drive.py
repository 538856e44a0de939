r"""A measured drive without most of its noise, and what of it is left.

Turning points and branches need a drive without noise, and what noise it keeps moves the response
by slope × noise.  The level is that of sixth differences, in which a smooth drive vanishes; the
drive is replaced by local cubics, each over the longest window in which they fit to the noise.

Source: Savitzky & Golay, Anal. Chem. 36 (1964) 1627; Fuller, Measurement Error Models (1987).
"""

from __future__ import annotations

from math import comb

import numpy as np
from scipy.ndimage import uniform_filter1d
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
_NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a standard normal variable."""


def denoised(drive: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A drive (N,) without most of its noise, and the rms error (N,) that is left, both in its
    unit."""
    differences = np.abs(np.diff(drive, _ORDER))
    level = float(np.median(differences)) / (_NORMAL_MEDIAN * np.sqrt(comb(2 * _ORDER, _ORDER)))
    if level <= _LEAST * np.ptp(drive) or drive.size <= _WINDOWS[-1]:
        return drive, np.zeros_like(drive)
    smooth, remaining = drive.copy(), np.full(drive.size, level)
    fits = np.ones(drive.size, dtype=bool)
    for window in _WINDOWS:
        cubic = savgol_filter(drive, window, 3)
        fits &= uniform_filter1d(((drive - cubic) / level) ** 2, window) <= _FITS
        # A cubic's middle has 9/4 over the window of the noise's variance.
        smooth, remaining = (
            np.where(fits, new, old)
            for new, old in ((cubic, smooth), (level * np.sqrt(2.25 / window), remaining))
        )
    return smooth, remaining
