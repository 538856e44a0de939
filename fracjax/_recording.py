"""The recording, validated once at the border, and the units it is written in."""

import math
import re
import threading
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Number
from typing import Any, NamedTuple, Self

import numpy as np
import pint

MINIMUM_SAMPLES = 32
LARGEST = 1e100
"""Magnitudes beyond this are overload codes, not measurements; their squares stay finite."""


class InputError(ValueError):
    """What the user gave cannot be used: one plain sentence, never a traceback."""

    @classmethod
    def at(cls, where: str, expected: str, found: str, remedy: str) -> Self:
        """Say where, what was expected, what was found, and the remedy."""
        return cls(f"{where}: expected {expected}, found {found}; {remedy}.")


class Repeats(NamedTuple):
    """A periodic stretch `[start, stop)` of the drive and its period, all in samples."""

    period: int
    start: int
    stop: int

    @property
    def whole(self) -> int:
        """How many samples whole periods fill, counted from the recording's first."""
        return self.stop // self.period * self.period


@dataclass(frozen=True, eq=False)
class Recording:
    """Uniform samples of a drive u and the response y it caused.

    **Arguments:** `drive` and `response`, shape (N,), in `drive_unit` and `response_unit`;
    `dt`, the step [s]; `source`, named in messages; `warnings`, what the reader had to assume.

    A constant drive is a rest: it tells the noise and what drifts, beside recordings that move.

    **Raises:** `InputError` unless both are finite, one-dimensional, of equal length, at least
    32 samples long and the response not constant, `dt` is positive and the units are known.
    Where `masked`, shape (N,), is true a sample need be no number; no fit counts it.
    """

    drive: np.ndarray
    response: np.ndarray
    dt: float
    drive_unit: str = "V"
    response_unit: str = "um"
    source: str = "recording"
    warnings: tuple[str, ...] = ()
    masked: np.ndarray | None = None

    def __post_init__(self):
        unit(self.drive_unit, f"{self.source}, drive")
        unit(self.response_unit, f"{self.source}, response")
        step = parse_quantity(self.dt, "s", f"{self.source}, dt")
        if not 1 / LARGEST < step < LARGEST:
            raise InputError.at(
                f"{self.source}, dt", "a positive step in seconds", f"{step:g}", "correct it"
            )
        drive, response = self.drive, self.response
        if self.masked is not None:
            masked = np.array(self.masked, dtype=bool)
            masked.setflags(write=False)
            object.__setattr__(self, "masked", masked)
            drive, response = bridged(drive, masked), bridged(response, masked)
        drive = _signal(drive, f"{self.source}, drive")
        response = varying(response, f"{self.source}, response")
        if len(drive) != len(response):
            raise InputError.at(
                self.source,
                "as many response as drive samples",
                f"{len(drive)} of the drive and {len(response)} of the response",
                "cut both to the same span",
            )
        for name, value in (("dt", step), ("drive", drive), ("response", response)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "warnings", tuple(self.warnings))

    def __len__(self) -> int:
        return len(self.drive)

    @property
    def times(self) -> np.ndarray:
        """Sample times from 0, shape (N,) [s]."""
        return self.dt * np.arange(len(self))

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]."""
        return 1 / self.dt

    def window(self, start: int, stop: int) -> "Recording":
        """Samples `[start, stop)` as a recording of its own, its time again from 0.

        **Raises:** `InputError` outside the recording, or where the window is no valid recording.
        """
        if not 0 <= start < stop <= len(self):
            raise InputError.at(
                self.source,
                f"a window within samples 0 to {len(self)}",
                f"{start} to {stop}",
                "choose it inside",
            )
        masked = None if self.masked is None else self.masked[start:stop]
        signals = {"drive": self.drive[start:stop], "response": self.response[start:stop]}
        return replace(self, **signals, masked=masked)

    def drive_period(self) -> Repeats | None:
        """The smallest whole-sample period that the drive keeps for at least three repeats.

        The longest stretch wins; it must fill a tenth of the recording. `None` where no stretch
        repeats to 0.2 % of its own deviation: sweeps, decays, holds, periods between samples.
        """
        return self._repeats

    @cached_property
    def _repeats(self) -> Repeats | None:
        return _repeats(_unit_range(self.drive))

    def static_stretches(self, minimum_seconds: float = 0.0) -> list[tuple[int, int]]:
        """Stretches `[start, stop)` [samples] of constant drive, where the noise can be read.

        Constant is: no wider than white noise of the same successive differences
        (J. von Neumann, Ann. Math. Stat. 12, 1941). A stretch lasts at least `minimum_seconds`
        [s], 64 samples (which give a noise level to 9 %) and a hundredth of the recording.
        """
        minimum = max(64, len(self) // 100, math.ceil(minimum_seconds * self.rate))
        return _still(_unit_range(self.drive), minimum)

    def checks(self) -> tuple[str, ...]:
        """Plain warnings about the data that a fit would not reveal."""
        found = (
            *(_clipping(self), _quantisation(self), _quantised_drive(self), _undersampling(self)),
            *(_spikes(self), _leading(self)),
        )
        return tuple(warning for warning in found if warning)


# Units ------------------------------------------------------------------------------------------

_NUMBER = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*", re.DOTALL | re.ASCII
)
_LETTER = "A-Za-zµμΩΩÅÅ"
_FACTOR = rf"[{_LETTER}][{_LETTER}0-9_]*((\*\*|\^)-?[0-9]|[²³])?"
_UNIT = re.compile(rf"{_FACTOR}(\s*[*/·]\s*{_FACTOR})*|[%°]")

_ONE_AT_A_TIME = threading.Lock()
"""pint reads its definitions on first use; a second thread would find half of them."""


def unit(text: str, where: str = "unit") -> pint.Unit:
    """The unit called `text`, such as "um", "µm", "V", "kHz" or "V/um".

    **Raises:** `InputError`, placed at `where`, for a unit that pint does not know.
    """
    name = text.strip()
    for spelling in (name, name.lower()):
        try:
            if _UNIT.fullmatch(spelling):
                with _ONE_AT_A_TIME:
                    return pint.get_application_registry().Unit(spelling.replace("·", "*"))
        except (pint.PintError, ValueError):
            continue
    raise InputError.at(
        where, "a unit such as um, mm, V, N, s, ms, Hz or kHz", f'"{text}"', "correct the unit"
    )


def parse_quantity(text: str | float, default: str, where: str = "quantity") -> float:
    """The value of "200 Hz" or "0.07um" in the unit `default`; a plain number is already in it.

    **Raises:** `InputError`, placed at `where`: no finite number, unknown unit, wrong dimension.
    """
    parts = _NUMBER.fullmatch(str(text))
    if parts is None:
        raise InputError.at(where, f'a value such as "20 {default}"', f'"{text}"', "correct it")
    number, name = float(parts[1]), parts[2] or default
    try:
        written, wanted = unit(name, where), unit(default)
        quantity = pint.get_application_registry().Quantity(number, written)
        value = float(quantity.to(wanted).magnitude)
    except pint.PintError:
        raise InputError.at(
            where, f"a value in {default} or a multiple of it", f'"{text}"', "correct the unit"
        ) from None
    if not math.isfinite(value):
        raise InputError.at(where, "a finite value", f'"{text}"', "correct it")
    return value


# Validation -------------------------------------------------------------------------------------


def found_in(given: object) -> str:
    """What was given, in a few words."""
    if isinstance(given, str):
        return f'"{given}"'
    if given is None or isinstance(given, Number):
        return f"{given}"
    return f"a {type(given).__name__}"


def require_kind(given: Any, kind: type, where: str, remedy: str) -> None:
    """Raise `InputError` where something is not of its kind."""
    if not isinstance(given, kind):
        raise InputError.at(where, f"a {kind.__name__}", found_in(given), remedy)


def pair_of(given: Any, where: str, expected: str, remedy: str) -> tuple[float, float]:
    """Two numbers.  Raises `InputError` where something is none such."""
    try:
        first, second = map(float, given)
    except (TypeError, ValueError):
        raise InputError.at(where, expected, found_in(given), remedy) from None
    return first, second


def require_samples(count: int, where: str) -> None:
    """Raise `InputError` where there are too few samples to fit anything."""
    if count < MINIMUM_SAMPLES:
        raise InputError.at(
            where, f"at least {MINIMUM_SAMPLES} samples", f"{count}", "give a longer recording"
        )


def require_units_of(first: Recording, other: Recording) -> None:
    """Raise `InputError` unless two recordings are written in the same units."""
    expected, found = ((r.drive_unit, r.response_unit) for r in (first, other))
    if found != expected:
        raise InputError.at(
            other.source,
            f"the units of {first.source} ({', '.join(expected)})",
            f"({', '.join(found)})",
            "convert one of them",
        )


def _signal(samples, where: str) -> np.ndarray:
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


def bridged(samples, masked: np.ndarray) -> np.ndarray:
    """A signal (N,) with straight lines over the samples that are masked and no numbers."""
    signal = np.asarray(samples, dtype=np.float64)
    lost = masked & ~(np.abs(signal) < LARGEST)
    if not lost.any() or lost.all():
        return signal
    kept = np.flatnonzero(~lost)
    return np.interp(np.arange(len(signal)), kept, signal[kept])


def varying(samples, where: str) -> np.ndarray:
    """A usable signal, shape (N,), that is not constant.  Raises InputError."""
    signal = _signal(samples, where)
    if signal.min() == signal.max():
        raise InputError.at(
            where, "a signal that varies", f"the constant {signal[0]:g}", "choose the right column"
        )
    return signal


_SPIKE = 12.0
"""Least height of a spike, in typical departures of a sample from the line of its neighbours."""
_WIDEST_SPIKE = 3


def spikes(response: np.ndarray) -> np.ndarray:
    """Which samples of a response (N,) stand alone, far from those before and behind: (N,).

    Far is twelve times what samples typically depart from the line between their neighbours, and a
    hundredth of the range; up to three in a row, where those on both sides agree.
    """
    found = np.zeros(len(response), bool)
    if len(response) < MINIMUM_SAMPLES:
        return found
    low, high = np.nanpercentile(response, [1, 99])
    typical = 1.4826 * np.nanmedian(np.abs(response[1:-1] - (response[:-2] + response[2:]) / 2))
    least = max(_SPIKE * typical, 0.01 * (high - low))
    for width in range(1, _WIDEST_SPIKE + 1):
        before, after = response[: -width - 1], response[width + 1 :]
        inner = [response[1 + at : 1 + at + len(before)] for at in range(width)]
        height = np.min([np.abs(each - (before + after) / 2) for each in inner], axis=0)
        far = (height > least) & (np.abs(after - before) < 0.5 * height)
        for at in range(width):
            found[1 + at : 1 + at + len(before)] |= far
    return found


# Periods and rests --------------------------------------------------------------------------------

_POINT = 3e-3
"""Largest step from one repeat to the next, in ranges: seven sigma of 0.03 % noise."""
_PATTERN = 2e-3
"""Largest rms departure from the mean pattern, in the pattern's own standard deviations."""
_CANDIDATES = 32


def _unit_range(signal: np.ndarray) -> np.ndarray:
    """The signal, shape (N,), shifted and scaled to 0..1."""
    shifted = signal - signal.min()
    return shifted / (shifted.max() or 1.0)


def _runs(mask: np.ndarray) -> np.ndarray:
    """Where a mask, shape (N,), is true: its runs `[start, stop)`, shape (runs, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return edges.reshape(-1, 2)


def _mismatch(u: np.ndarray) -> np.ndarray:
    """Mean of (u[t + lag] - u[t])² for lags 0..N/3 by FFT, unlike autocorrelation free of edges.

    Lags beyond N/3 cannot repeat three times.
    """
    count, lags = len(u), len(u) // 3 + 2
    size = 1 << (2 * count - 1).bit_length()
    centred = u - u.mean()
    products = np.fft.irfft(np.abs(np.fft.rfft(centred, size)) ** 2, size)[:lags]
    squares = np.concatenate(([0.0], np.cumsum(centred**2)))
    lag = np.arange(lags)
    return (squares[count - lag] + squares[count] - squares[lag] - 2 * products) / (count - lag)


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
    runs = _runs(np.abs(u[period:] - u[:-period]) <= _POINT)
    lengths = runs[:, 1] - runs[:, 0] + period
    for run in np.argsort(-lengths, kind="stable"):
        if lengths[run] < max(3 * period, MINIMUM_SAMPLES, len(u) / 10):
            return None
        start = int(runs[run, 0])
        stop = start + int(lengths[run])
        if _keeps(u[start:stop], period):
            return Repeats(period, start, stop)
    return None


def _repeats(u: np.ndarray) -> Repeats | None:
    """Locate the longest periodic stretch of u, shape (N,), then reduce it to its fundamental."""
    mismatch = _mismatch(u)
    lags = _minima(mismatch)
    deepest = lags[np.argsort(mismatch[lags], kind="stable")[:_CANDIDATES]]
    found = [repeats for lag in deepest if (repeats := _stretch(u, int(lag)))]
    if not found:
        return None
    longest = max(found, key=lambda repeats: repeats.stop - repeats.start)
    steady = u[longest.start : longest.stop]
    whole = (_stretch(steady, int(lag)) for lag in _minima(_mismatch(steady)))
    kept = (repeats.period for repeats in whole if repeats and repeats.stop == len(steady))
    return longest._replace(period=next(kept, longest.period))


def _still(u: np.ndarray, minimum: int) -> list[tuple[int, int]]:
    """Stretches of u, shape (N,), in 0..1, at least `minimum` long, no wider than their noise."""
    if minimum > len(u):
        return []
    centred = u - u.mean()

    def means(values: np.ndarray, width: int) -> np.ndarray:
        sums = np.concatenate(([0.0], np.cumsum(values)))
        return (sums[width:] - sums[:-width]) / width

    def quiet(variance, noise):
        return (variance < 5e-3**2) & (variance <= np.maximum(3e-6**2, 1.5 * noise))

    variance = means(centred**2, minimum) - means(centred, minimum) ** 2
    noise = means(np.diff(u) ** 2, minimum - 1) / 2
    runs = _runs(quiet(variance, noise)) + np.array([0, minimum - 1])
    return [
        (int(start), int(stop))
        for start, stop in runs
        if quiet(u[start:stop].var(), np.mean(np.diff(u[start:stop]) ** 2) / 2)
    ]


_LEAD = 0.003
"""Least area of a loop that runs the wrong way round, as a share of its box."""

# Warnings -----------------------------------------------------------------------------------------


def _clipping(recording: Recording) -> str | None:
    """A response that rests on its extreme value while the drive moves on."""
    moving = np.diff(recording.drive) != 0
    levels, level = np.unique(recording.response, return_inverse=True)
    stuck = np.bincount(level[1:][moving & (np.diff(level) == 0)], minlength=len(levels))
    for name, end, inner in (("largest", -1, -2), ("smallest", 0, 1)):
        if stuck[end] >= 10 and stuck[end] > 5 * stuck[inner]:
            return (
                f"The response stays at its {name} value, {levels[end]:g} "
                f"{recording.response_unit}, for {stuck[end]} samples while the drive moves: "
                "the sensor or its range is clipped."
            )
    return None


def _quantisation(recording: Recording) -> str | None:
    """A response that takes few distinct values."""
    levels = np.unique(recording.response)
    if len(levels) >= min(200, len(recording) / 4):
        return None
    return (
        f"The response takes only {len(levels)} distinct values, about "
        f"{np.median(np.diff(levels)):.3g} {recording.response_unit} apart: "
        "rounding of that size will look like mismatch."
    )


def _quantised_drive(recording: Recording) -> str | None:
    """A drive that moves, and was recorded on few evenly spaced levels."""
    levels, level = np.unique(recording.drive, return_inverse=True)
    if not 16 <= len(levels) < min(200, len(recording) / 4):
        return None
    apart, moves = np.diff(levels), np.diff(level)
    step = float(np.median(apart))
    even = np.abs(apart - step).max() < 0.02 * step
    # A staircase rests as long on every level as on the others.
    dwell = np.diff(np.flatnonzero(moves))
    glides = dwell.size > 0 and (np.median(dwell) <= 4 or np.median(dwell) < 0.2 * dwell.max())
    if not (even and glides and np.mean(np.abs(moves) <= 1) > 0.9):
        return None
    return (
        f"The drive takes only {len(levels)} distinct values, {step:.3g} {recording.drive_unit} "
        "apart: it was recorded more coarsely than it moved, and what the model makes of its steps "
        "will look like mismatch."
    )


def _spikes(recording: Recording) -> str | None:
    """Samples of the response that stand alone."""
    found = spikes(recording.response)
    if recording.masked is not None:
        found &= ~recording.masked
    if not 0 < np.count_nonzero(found) <= 0.02 * len(recording):
        return None
    at = recording.dt * int(found.argmax())
    return (
        f"The response has {np.count_nonzero(found)} sample(s) far from those before and behind, "
        f"the first at {at:.6g} s: spikes. Leave them out with --mask bad."
    )


def _leading(recording: Recording) -> str | None:
    """A response that is ahead of its drive: the mean loop runs the wrong way round."""
    repeats = recording.drive_period()
    if repeats is None:
        return None
    count = (repeats.stop - repeats.start) // repeats.period
    stretch = slice(repeats.start, repeats.start + count * repeats.period)
    drive, response = (
        signal[stretch].reshape(count, -1).mean(axis=0) - signal[stretch].mean()
        for signal in (recording.drive, recording.response)
    )
    spans = np.ptp(drive) * np.ptp(response)
    likeness = float(drive @ response) / float(np.sqrt((drive @ drive) * (response @ response)))
    # ∮ y du is negative where y lags behind u.
    area = np.sign(likeness) * float(response @ (np.roll(drive, -1) - np.roll(drive, 1))) / 2
    if abs(likeness) < 0.5 or area < _LEAD * spans:
        return None
    return (
        "The response leads the drive: their loop runs the wrong way round, by "
        f"{100 * area / spans:.2g} % of its box. The channels are skewed in time, or drive and "
        "response are swapped: check their clocks, --input and --output."
    )


def _undersampling(recording: Recording) -> str | None:
    """A drive whose fastest part (99 % of the power lies below) has few samples per period."""
    u = _unit_range(recording.drive)
    power = np.abs(np.fft.rfft((u - u.mean()) * np.hanning(len(u)))) ** 2
    fastest = max(1, int(np.searchsorted(np.cumsum(power), 0.99 * power.sum())))
    samples = len(u) / fastest
    if samples >= 10:
        return None
    return (
        f"The fastest part of the drive, near {recording.rate / samples:.3g} Hz, has only "
        f"{samples:.1f} samples per period: at least 10 are needed to follow its loop."
    )
