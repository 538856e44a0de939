"""A signal: finite numbers along one axis."""

from functools import cache

import numpy as np

from fracjax._recording._errors import InputError

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


def resolution(response: np.ndarray) -> float:
    """The step [response unit] of the grid of a response's (N,) values, 0 where there is none.

    Neighbouring values must be whole steps apart, to a tenth of a step, and the smallest gap must
    be one step.  A converter's codes that were scaled and rounded to a few digits still qualify.
    Noise of many digits does not, nor do codes so fine that no code has its neighbour in the
    recording.
    """
    gaps = np.diff(np.unique(response))
    gaps = gaps[gaps > 1e-9 * np.ptp(response)]  # smaller gaps are rounding errors
    codes = np.round(gaps / gaps.min())
    step = float(gaps.sum() / codes.sum())
    return step if np.all(np.abs(gaps / step - codes) < 0.1) else 0.0


_SPIKE = 12.0
"""Least height of a spike, in typical departures of a sample from the line of its neighbours."""
_WIDEST_SPIKE = 3
_AROUND = 20
"""Samples on both sides that tell what is typical there."""
_MOST_SPIKES = 0.02, 5
"""So large a share of the samples, and so many more, would be the signal itself."""


def spikes(response: np.ndarray) -> np.ndarray:
    """Which samples of a response (N,) stand alone, far from those before and behind: (N,).

    Far is twelve times what samples typically depart from the line between their neighbours, in the
    whole response and around them, and a hundredth of the range; up to three in a row, where those
    on both sides agree.
    """
    alone = np.zeros(len(response), bool)
    if len(response) < MINIMUM_SAMPLES:
        return alone
    # Medians that pass over what is no number take four times as long.
    complete = bool(np.isfinite(response).all())
    median, percentile = (
        (np.median, np.percentile) if complete else (np.nanmedian, np.nanpercentile)
    )
    bends = np.full(len(response) + 2 * _AROUND, np.nan)
    inside = bends[_AROUND:-_AROUND]
    inside[[0, -1]] = 0.0
    np.abs(response[1:-1] - (response[:-2] + response[2:]) / 2, out=inside[1:-1])
    far = _SPIKE * float(median(inside))
    most = _MOST_SPIKES[0] * len(response) + _MOST_SPIKES[1]

    @cache
    def large() -> float:
        """A hundredth of the range, which takes longer to find and is asked of few recordings."""
        return 0.01 * float(np.ptp(percentile(response, [1, 99])))

    for width in range(1, _WIDEST_SPIKE + 1):
        middle = (response[: -width - 1] + response[width + 1 :]) / 2
        first = np.flatnonzero(np.abs(response[1:-width] - middle) > far)
        # Few samples are so far from the middle, and only of these the others are looked at.
        within = response[first + np.arange(1, width + 1)[:, None]]
        height = np.abs(within - middle[first]).min(axis=0)
        apart = np.abs(response[first + width + 1] - response[first])
        stands = (height > far) & (apart < 0.5 * height)
        first, height = first[stands], height[stands]
        if first.size >= most:
            first, height = first[height > large()], height[height > large()]
            if first.size >= most:
                continue
        around = bends[first[:, None] + np.arange(width + 2 * _AROUND)]
        quiet = _medians_below(around, height / _SPIKE)
        first, height = first[quiet], height[quiet]
        first = first[height > large()] if first.size else first
        for at in range(1, width + 1):
            alone[first + at] = True
    return alone


def _medians_below(values: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Whether the median of the numbers in each row (R, n) is below a limit (R,), by counting."""
    below, above = values < limits[:, None], values >= limits[:, None]
    more = np.sum(below, axis=1) - np.sum(above, axis=1)
    tied = np.flatnonzero(more == 0)  # so that the limit is between the two in the middle
    low = np.max(values[tied], axis=1, initial=-np.inf, where=below[tied])
    high = np.min(values[tied], axis=1, initial=np.inf, where=above[tied])
    more[tied] = low + high < 2 * limits[tied]
    return more > 0
