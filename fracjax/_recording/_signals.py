"""A signal: finite numbers along one axis."""

from functools import cache
from typing import Any

import numpy as np

from fracjax._recording._errors import InputError
from fracjax._recording._rows import quantiles

MINIMUM_SAMPLES = 32
LARGEST = 1e100
"""Magnitudes beyond this are overload codes, not measurements; their squares stay finite."""


def require_samples(count: int, where: str) -> None:
    """Raise `InputError` where there are too few samples to fit anything."""
    if count < MINIMUM_SAMPLES:
        raise InputError.at(
            where, f"at least {MINIMUM_SAMPLES} samples", f"{count}", "give a longer recording"
        )


def signal_of(samples, where: str) -> np.ndarray:
    """A read-only float64 copy of `samples`, shape (N,), once it is a usable signal."""
    try:
        raw = np.asarray(samples)
    except ValueError:
        raise InputError.at(where, "real numbers", "rows of unequal length", "mend it") from None
    if raw.dtype.kind not in "iuf":
        raise InputError.at(where, "real numbers", f"{raw.dtype} values", "give numbers")
    if raw.ndim != 1:
        raise InputError.at(where, "one axis", f"shape {raw.shape}", "give one channel at a time")
    require_samples(len(raw), where)
    signal = raw.astype(np.float64)
    bad = ~(np.abs(signal) < LARGEST)
    if bad.any():
        at = int(bad.argmax())
        raise InputError.at(
            f"{where}, sample {at}", "a finite number", f"{signal[at]}", "correct or cut it"
        )
    signal.setflags(write=False)
    return signal


def bridged(signal: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """A signal (N,) with straight lines over lost samples (N,); itself where none or all are."""
    if not lost.any() or lost.all():
        return signal
    kept = np.flatnonzero(~lost)
    return np.interp(np.arange(len(signal)), kept, signal[kept])


def without_missing(samples, masked: np.ndarray) -> np.ndarray:
    """A signal (N,) with straight lines over the samples that are masked and no numbers."""
    signal = np.asarray(samples, dtype=np.float64)
    return bridged(signal, masked & ~(np.abs(signal) < LARGEST))


def varying(samples, where: str) -> np.ndarray:
    """A usable signal, shape (N,), that is not constant.  Raises InputError."""
    signal = signal_of(samples, where)
    if signal.min() == signal.max():
        raise InputError.at(
            where, "a signal that varies", f"the constant {signal[0]:g}", "choose the right column"
        )
    return signal


def resolution(response: np.ndarray) -> Any:
    """The step [response unit] of the grid of a response's (N,) values, 0 where there is none; of
    each of several responses (R, N).

    Neighbouring values must be whole steps apart, to a tenth of a step, and the smallest gap must
    be one step.  A converter's codes that were scaled and rounded to a few digits still qualify.
    Noise of many digits does not, nor do codes so fine that no code has its neighbour in the
    recording.
    """
    gaps = np.diff(np.sort(response))
    spans = np.ptp(response, axis=-1, keepdims=True)
    gaps[gaps <= 1e-9 * spans] = 0.0  # equal values, and rounding errors
    smallest = np.where(gaps > 0, gaps, np.inf).min(axis=-1, keepdims=True)
    codes = np.round(gaps / smallest)
    steps = gaps.sum(axis=-1, keepdims=True) / codes.sum(axis=-1, keepdims=True)
    even = np.all(np.abs(gaps / steps - codes) < 0.1, axis=-1)
    return np.where(even, steps[..., 0], 0.0)[()]


_SPIKE = 12.0
"""Least height of a spike, in typical departures of a sample from the line of its neighbours."""
_WIDEST_SPIKE = 3
_AROUND = 20
"""Samples on both sides that tell what is typical there."""
_MOST_SPIKES = 0.02, 5
"""So large a share of the samples, and so many more, would be the signal itself."""


def spikes(response: np.ndarray) -> np.ndarray:
    """Which samples of a response (N,) stand alone, far from those before and behind: (N,); of each
    of several responses (R, N): (R, N).

    Far is twelve times what samples typically depart from the line between their neighbours, in the
    whole response and around them, and a hundredth of the range; up to three in a row, where those
    on both sides agree.  The tip of a cusp, to which both sides lead, is none.
    """
    rows = np.atleast_2d(response)
    count, size = rows.shape
    alone = np.zeros(rows.shape, bool)
    if size < MINIMUM_SAMPLES:
        return alone.reshape(response.shape)
    bends = np.full((count, size + 2 * _AROUND), np.nan)
    inside = bends[:, _AROUND:-_AROUND]
    inside[:, [0, -1]] = 0.0
    np.abs(rows[:, 1:-1] - (rows[:, :-2] + rows[:, 2:]) / 2, out=inside[:, 1:-1])
    far = _SPIKE * quantiles(inside, 0.5)[0]
    most = _MOST_SPIKES[0] * size + _MOST_SPIKES[1]

    @cache
    def large() -> np.ndarray:
        """A hundredth of each range, which takes longer to find and is asked of few recordings."""
        return 0.01 * np.subtract(*quantiles(rows, 0.99, 0.01))

    for width in range(1, _WIDEST_SPIKE + 1):
        middle = (rows[:, : -width - 1] + rows[:, width + 1 :]) / 2
        distant = np.abs(rows[:, 1:-width] - middle) > far[:, None]
        # Few samples are so far from the middle, and only of these the others are looked at.
        row, first = np.divmod(np.flatnonzero(distant), middle.shape[1])
        within = rows[row, first + np.arange(1, width + 1)[:, None]]
        height = np.abs(within - middle[row, first]).min(axis=0)
        apart = np.abs(rows[row, first + width + 1] - rows[row, first])
        stands = (height > far[row]) & (apart < 0.5 * height)
        row, first, height = row[stands], first[stands], height[stands]
        if not row.size:
            continue
        high = height > large()[row]
        high &= np.bincount(row[high], minlength=count)[row] < most
        row, first, height = row[high], first[high], height[high]
        around = bends[row[:, None], first[:, None] + np.arange(width + 2 * _AROUND)]
        quiet = quantiles(around, 0.5)[0] < height / _SPIKE
        row, first, height = row[quiet], first[quiet], height[quiet]
        surprising = ~_is_led_to(rows, row, first, width, height)
        row, first = row[surprising], first[surprising]
        for at in range(1, width + 1):
            alone[row, first + at] = True
    return alone.reshape(response.shape)


def _is_led_to(
    rows: np.ndarray, row: np.ndarray, first: np.ndarray, width: int, height: np.ndarray
) -> np.ndarray:
    """Whether the straight line of the two samples before or behind leads to one of `width` samples
    after `first`, in responses (R, N): closer to it than half the height (K,).

    At a response's ends, where one of the two is missing, no line leads anywhere.
    """
    last = rows.shape[1] - 1
    led = np.zeros(row.size, bool)
    for near, far, side in ((first, first - 1, 1), (first + width + 1, first + width + 2, -1)):
        slope = rows[row, near] - rows[row, np.clip(far, 0, last)]
        steps = np.arange(1, width + 1)[:, None]
        course = rows[row, near] + steps * slope
        away = np.abs(rows[row, near + side * steps] - course).min(axis=0)
        led |= (away < height / 2) & (far >= 0) & (far <= last)
    return led
