"""Periods and rests of a drive."""

from typing import NamedTuple

import numpy as np
from scipy.fft import next_fast_len

from fracjax._recording._kept import kept
from fracjax._recording._signals import MINIMUM_SAMPLES


class Repeats(NamedTuple):
    """A periodic stretch `[start, stop)` of the drive and its period, all in samples."""

    period: int
    start: int
    stop: int

    @property
    def whole(self) -> int:
        """How many samples whole periods fill, counted from the recording's first."""
        return self.stop // self.period * self.period


_POINT = 3e-3
"""Largest step from one repeat to the next, in ranges: seven sigma of 0.03 % noise."""
_PATTERN = 2e-3
"""Largest rms departure from the mean pattern, in the pattern's own standard deviations."""
_CANDIDATES = 32
_LONG = 2**20
"""Samples from which a drive is looked at in steps first: the transform of all of them would take
more time and memory than all else that is asked of a recording."""


def unit_range(signal: np.ndarray) -> np.ndarray:
    """The signal, shape (N,), shifted and scaled to 0..1."""
    shifted = signal - signal.min()
    return shifted / (shifted.max() or 1.0)


def runs_of(mask: np.ndarray) -> np.ndarray:
    """Where a mask, shape (N,), is true: its runs `[start, stop)`, shape (runs, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return edges.reshape(-1, 2)


def maxima_of(values: np.ndarray) -> np.ndarray:
    """The indices of the local maxima of values (N,), of flat ones the middle, as `find_peaks` of
    `scipy.signal` has them, which takes longer to import than a fit takes."""
    starts = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    stops = np.append(starts[1:], values.size)
    rises = np.diff(values[starts]) > 0
    tops = 1 + np.flatnonzero(rises[:-1] & ~rises[1:])
    return (starts[tops] + stops[tops] - 1) // 2


@kept
def mismatch(u: np.ndarray) -> np.ndarray:
    """Mean of (u[t + lag] - u[t])², lags 0..2N/3, by FFT; unlike autocorrelation free of edges."""
    count, lag = len(u), np.arange(len(u) - len(u) // 3)
    size = int(next_fast_len(count + lag.size, real=True))  # type: ignore[arg-type]
    centred = u - u.mean()
    spectrum = np.fft.rfft(centred, size)
    products = np.fft.irfft(spectrum.real**2 + spectrum.imag**2, size)[: lag.size]
    squares = np.concatenate(([0.0], np.cumsum(centred**2)))
    later = squares[count - lag.size + 1 :][::-1]
    return (later + squares[count] - squares[: lag.size] - 2 * products) / (count - lag)


def _likely_periods(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Local minima of the mismatch of u, shape (N,), the deepest first, and the mismatch there.

    Lags beyond N/3 cannot repeat three times.
    """
    values = mismatch(u)[: len(u) // 3 + 2]
    lags = _minima(values)
    order = np.argsort(values[lags], kind="stable")
    return lags[order], values[lags[order]]


def _minima(values: np.ndarray) -> np.ndarray:
    """Indices of the inner local minima of `values`, shape (N,)."""
    return 1 + np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] <= values[2:]))


def _keeps(u: np.ndarray, period: int) -> bool:
    """Whether all repeats of `period` in u, shape (N,), follow one pattern that is no hold."""
    repeats = u[: len(u) // period * period].reshape(-1, period)
    pattern = repeats.mean(axis=0)
    departure, size = float(np.sqrt(np.mean((repeats - pattern) ** 2))), float(pattern.std())
    return len(repeats) >= 3 and size > 0.01 and departure <= _PATTERN * size


def _stretch(u: np.ndarray, period: int) -> Repeats | None:
    """The longest stretch of u, shape (N,), that keeps `period`."""
    shortest = max(3 * period, MINIMUM_SAMPLES, -(-len(u) // 10))
    # A run that is long enough shows at three successive ones of a few samples.
    every = max((shortest - period) // 4, 1)
    near = np.abs(u[period::every] - u[:-period:every]) <= _POINT
    if not np.any(near[2:] & near[1:-1] & near[:-2]):
        return None
    runs = runs_of(np.abs(u[period:] - u[:-period]) <= _POINT)
    lengths = runs[:, 1] - runs[:, 0] + period
    for run in np.argsort(-lengths, kind="stable"):
        if lengths[run] < shortest:
            return None
        start = int(runs[run, 0])
        stop = start + int(lengths[run])
        if _keeps(u[start:stop], period):
            return Repeats(period, start, stop)
    return None


@kept
def repeats_in(u: np.ndarray) -> Repeats | None:
    """The longest periodic stretch of u, shape (N,), and its fundamental period.

    Every so many-th sample of a long drive repeats where the drive does, perhaps in several of its
    periods, the fundamental one of which three such repeats show.
    """
    every = len(u) // _LONG
    if every < 2:
        return _located(u)
    coarse = _located(u[::every])
    if coarse is None:
        return None
    start = coarse.start * every
    fine = _located(u[start : start + 3 * (coarse.period + 1) * every])
    return None if fine is None else _stretch(u, fine.period)


def _located(u: np.ndarray) -> Repeats | None:
    """Locate the longest periodic stretch of u, shape (N,), then reduce it to its fundamental."""
    lags, depths = _likely_periods(u)
    longest: Repeats | None = None
    for lag in lags[:_CANDIDATES]:
        repeats = _stretch(u, int(lag))
        if repeats and (longest is None or _length(repeats) > _length(longest)):
            longest = repeats
        if longest and _length(longest) == len(u):
            break
    if longest is None:
        return None
    steady = u[longest.start : longest.stop]
    if len(steady) < len(u):
        lags, depths = _likely_periods(steady)
    # Where no step from one repeat to the next is larger, their mean square is no larger either.
    near = np.sort(lags[depths <= _POINT**2])
    whole = (_stretch(steady, int(lag)) for lag in near)
    kept = (repeats.period for repeats in whole if repeats and repeats.stop == len(steady))
    return longest._replace(period=next(kept, longest.period))


def _length(repeats: Repeats) -> int:
    return repeats.stop - repeats.start


@kept
def stretches_at_rest(u: np.ndarray, minimum: int) -> list[tuple[int, int]]:
    """Stretches of u, shape (N,), in 0..1, at least `minimum` long, no wider than their noise."""
    if minimum > len(u):
        return []
    centred = u - u.mean()

    def means(values: np.ndarray, width: int) -> np.ndarray:
        sums = np.empty(len(values) + 1)
        sums[0] = 0.0
        np.cumsum(values, out=sums[1:])
        return (sums[width:] - sums[:-width]) / width

    def quiet(variance, noise):
        return (variance < 5e-3**2) & (variance <= np.maximum(3e-6**2, 1.5 * noise))

    variance = means(centred**2, minimum) - means(centred, minimum) ** 2
    noise = means(np.diff(u) ** 2, minimum - 1) / 2
    stretches: list[tuple[int, int]] = []
    for start, stop in runs_of(quiet(variance, noise)) + np.array([0, minimum - 1]):
        # Two runs may be a step apart that is shorter than a stretch, which both then hold.
        first, last = max(int(start), stretches[-1][1] if stretches else 0), int(stop)
        part = u[first:last]
        if part.size >= minimum and quiet(part.var(), np.mean(np.diff(part) ** 2) / 2):
            stretches.append((first, last))
    return stretches
