"""The kind of drive of a recording, determined in the presence of noise.

The thresholds inside the functions were chosen by judgement; with noise of up to 1 % of the drive's
range the tests identify every kind.
"""

from __future__ import annotations

import numpy as np

from .._recording import Recording, hann, thinned

KINDS = ("rest", "steps", "sine", "triangle", "chirp", "multisine", "other")

_SPREAD = 2
"""Bins on each side over which a Hann window spreads a spectral line."""
_SINE = 0.995
"""A sine has more than this share of its power in one line; a triangle has 0.986."""
_BLOCKS = 20
"""Blocks per period whose slopes identify a triangle: enough samples in each to average noise."""
_ALIKE = 0.98
"""Least correlation of a period with the next one; noise of 5 % of a sine's range gives 0.98."""
_LINES = 0.998
"""Share of the power in the lines that count as those of a multisine; chosen by judgement."""


def kind_of_drive(recording: Recording) -> str:
    """One of `KINDS`; "other" if the drive is of no other kind."""
    if np.ptp(recording.drive) == 0:
        return "rest"
    drive = _moving(recording.drive)
    drive = drive - drive.mean()
    if _is_steps(drive):
        return "steps"
    drive = thinned(drive)
    power = np.abs(np.fft.rfft(drive * hann(drive.size))) ** 2
    peak = int(np.argmax(power))
    # With little more than one period, any curve would pass as a sine.
    if peak > 1:
        if power[max(0, peak - _SPREAD) : peak + _SPREAD + 1].sum() > _SINE * power.sum():
            return "sine"
        if _is_triangle(drive, drive.size / peak):
            return "triangle"
    period = _period(drive)
    if _is_chirp(drive if period is None else period):
        return "chirp"
    return "multisine" if period is not None and _is_multisine(period) else "other"


def _moving(drive: np.ndarray) -> np.ndarray:
    """The drive (N,) without a rest at its beginning and end, which would hide its kind."""
    far = 0.05 * np.ptp(drive)

    def away(value: float) -> np.ndarray:
        """Where the drive is far from a value, without a second drive in memory."""
        return (drive > value + far) | (drive < value - far)

    start = int(np.argmax(away(drive[0])))
    stop = drive.size - int(np.argmax(away(drive[-1])[::-1]))
    lengths = start, drive.size - stop
    return drive[start:stop] if drive.size // 50 < max(lengths) < drive.size // 2 else drive


def _period(drive: np.ndarray) -> np.ndarray | None:
    """The mean of the first periods of a drive (N,), of two to eight; None if it does not repeat.

    `Recording.drive_period` requires three periods that are equal to the last digit, as a
    simulation needs them; to name the kind, less is enough.
    """
    count = drive.size
    size = 1 << (2 * count - 1).bit_length()
    products = np.fft.irfft(np.abs(np.fft.rfft(drive, size)) ** 2, size)[: count // 2 + 1]
    squares = np.concatenate(([0.0], np.cumsum(drive**2)))
    lags = np.arange(products.size)
    powers = squares[count - lags] + squares[count] - squares[lags]
    alike = 2 * products / powers
    # Short lags correlate in any smooth signal: the search begins after the correlation has fallen.
    apart = int(np.argmax(alike < 0.5))
    later = alike[apart:]
    if apart == 0 or later.max() < _ALIKE:
        return None
    first = int(np.argmax(later > later.max() - (1 - _ALIKE) / 2))
    lag = apart + first + int(np.argmax(later[first : first + 1 + (apart + first) // 20]))
    repeats = min(count // lag, 8)
    return drive[: repeats * lag].reshape(repeats, lag).mean(axis=0)


def _is_steps(drive: np.ndarray) -> bool:
    """Whether few large jumps divide a drive (N,) into stretches that are flat except for noise."""
    changes = np.abs(np.diff(drive))
    jumps = changes > max(8 * np.median(changes), 0.02 * np.ptp(drive))
    if not 0 < jumps.sum() <= 0.05 * changes.size:
        return False
    stretch = np.concatenate(([0], np.cumsum(jumps)))
    means = np.bincount(stretch, drive) / np.bincount(stretch)
    return bool(np.var(drive - means[stretch]) < 0.01 * np.var(drive))


def _is_triangle(drive: np.ndarray, period: float) -> bool:
    """Whether a drive (N,) with a period [samples] rises and falls at one rate, by block means.

    In a triangle at most two slopes at each of the two corners differ from the median; in a sine
    only a fifth of them are near it.
    """
    width = max(1, int(period / _BLOCKS))
    blocks = drive[: drive.size // width * width].reshape(-1, width).mean(axis=1)
    slopes = np.abs(np.diff(blocks))
    alike = np.abs(slopes - np.median(slopes)) < 0.15 * np.median(slopes)
    return bool(alike.mean() > 0.6)


def _is_chirp(drive: np.ndarray) -> bool:
    """Whether the periods of a drive (N,), at least five, become steadily shorter or longer."""
    lengths = np.diff(_rises(drive))
    if lengths.size < 5 or lengths.max() < 1.5 * lengths.min():
        return False
    ranks = lengths.argsort().argsort()
    trend = np.corrcoef(np.arange(lengths.size), ranks)[0, 1]
    changes = np.abs(np.diff(np.log(lengths)))
    # A sweep changes at every period; a sequence of sines only between its parts.
    return bool(abs(trend) > 0.9 and np.median(changes) > 0.2 * changes.mean())


def _rises(drive: np.ndarray) -> np.ndarray:
    """Where a drive (N,) rises through zero [samples], between values well below and well above."""
    far = 0.15 * np.ptp(drive)
    side = np.where(drive > far, 1, np.where(drive < -far, -1, 0))
    outside = np.flatnonzero(side)
    rises = np.flatnonzero((side[outside[:-1]] < 0) & (side[outside[1:]] > 0))
    before, after = outside[rises], outside[rises + 1]
    return before + (after - before) * drive[before] / (drive[before] - drive[after])


def _is_multisine(period: np.ndarray) -> bool:
    """Whether a period consists of few lines, or of many whose power is level or smooth."""
    power = np.abs(np.fft.rfft(period))[1:] ** 2
    ranked = np.argsort(-power)
    share = np.cumsum(power[ranked]) / power.sum()
    lines = np.sort(ranked[: 1 + int(np.searchsorted(share, _LINES))])
    strong = np.count_nonzero(power > 0.01 * power.max())
    if strong < 3:
        return False
    if lines.size <= min(30, power.size // 4):
        return True
    # The powers of random signals differ by much more: they are exponentially distributed.
    return bool(np.median(np.abs(np.diff(np.log(power[lines])))) < 0.3)
