"""The step of a table's samples, by its time column or by a rate, and other steps on request."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from fracjax._io._table import Fact, Table, column_label
from fracjax._recording import MINIMUM_SAMPLES, InputError, parse_quantity

_UNIFORM = 1e-3
"""Largest departure of a step from the median step, and of a rate from the time column's."""
_FINEST = 100
"""Most samples that resampling makes of one."""


class Clock(NamedTuple):
    """When the samples of a table were taken."""

    times: np.ndarray
    """[s] from 0, shape (N,)"""
    step: float
    """[s], of times that are not uniform the usual one"""
    note: str
    """What had to be assumed."""


def rate_of(text: str | float, where: str) -> float:
    """The rate [Hz] that a call or a file gives, such as "200Hz" or 200."""
    hertz = parse_quantity(text, "Hz", where)
    if hertz <= 0:
        raise InputError.at(where, "a positive rate", f'"{text}"', "give one such as 200Hz")
    return hertz


def clock_of_rate(
    table: Table, columns: Iterable[int], count: int, rate: float | None, listing: str
) -> Clock:
    """The clock of `count` samples of columns that have no time column.

    **Arguments:** `rate` [Hz], which the call gives; without it, what the file states counts.
    """
    if rate is not None:
        return Clock(np.arange(count) / rate, 1 / rate, "")
    facts = dict.fromkeys(fact for column in columns for fact in table.about(column).clocks)
    steps = [_step_of_fact(table.source, fact) for fact in facts]
    told = " and ".join(f'"{fact.name}" of {fact.value}' for fact in facts)
    if not steps:
        raise InputError.at(
            table.source,
            "a time column or a rate",
            f"neither in {listing}",
            "give --rate such as 200Hz, or --time as a name or an index from 0",
        )
    if max(steps) > (1 + _UNIFORM) * min(steps):
        raise InputError.at(table.source, "one rate", told, "give --rate such as 200Hz")
    note = f"{table.source}: {1 / steps[0]:.6g} Hz was taken as the rate, from {told}."
    return Clock(steps[0] * np.arange(count), steps[0], note)


def clock_of_time(
    table: Table, column: int, written: str, rate: float | None, *, uniform: bool
) -> Clock:
    """The clock of a time column, which must increase.

    **Arguments:** `written`, the column's unit; `rate` [Hz], with which it must agree, and which
    counts where the stamps are rounded; `uniform`, whether it must run in uniform steps, but for
    its rounding.
    """
    label = f"{table.source}, {column_label(table.names, column)}"
    second = parse_quantity(f"1 {written}", "s", label)
    times = table.numbers(column)
    steps = np.diff(times)
    even = _even(steps)
    slope = float(times[-1] - times[0]) / len(steps) if even.all() else _slope(times)
    stuck = ~(steps > 1e-9 * np.median(np.abs(steps)))
    if stuck.any() and (slope is None or rate is None):
        raise _refusal(table, column, times, stuck, "time to increase", _mend(slope, second))
    # Where there are gaps, the step between them.
    step = second * (float(steps[steps < 2 * np.median(steps)].mean()) if slope is None else slope)
    if uniform and slope is None:
        expected = f"a step of {step / second:.6g} {written}"
        remedy = f"give --resample {1 / step:.4g}Hz"
        raise _refusal(table, column, times, ~even, expected, remedy)
    rounded = slope is not None and not even.all()
    if rate is not None:
        if rounded and _beyond(times, 1 / (rate * second), _rounding(times))[0] <= 0:
            return Clock(np.arange(len(times)) / rate, 1 / rate, "")
        if abs(step * rate - 1) > _UNIFORM:
            raise InputError.at(
                label, f"a step of {1 / rate:g} s by --rate", f"{step:g} s", "leave out --rate"
            )
    if slope is None:
        return Clock(second * (times - times[0]), step, "")
    note = f"{label}: its stamps are rounded; a step of {step:.9g} s fits them all."
    return Clock(step * np.arange(len(times)), step, note if rounded else "")


def is_time(times: np.ndarray) -> bool:
    """Whether numbers, shape (N,), increase in uniform steps, but for their rounding."""
    steps = np.diff(times)
    return len(steps) > 0 and bool(
        _even(steps).all() or ((steps > 0).all() and _slope(times) is not None)
    )


def resampled(
    clock: Clock, signals: dict[str, np.ndarray], rate: float, source: str
) -> tuple[dict[str, np.ndarray], str]:
    """The signals at a uniform rate [Hz], by monotone cubics, and a note on what was bridged.

    The cubics (F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5, 1984) never leave the
    range of the two samples they join: no swing appears in a gap or beside a step that was not
    recorded, as a spline would invent. Of a smooth signal they are off by up to |y''| h²/8 for
    a gap h [s] where it turns, as straight lines are, and by less elsewhere.

    **Arguments:** each signal of shape (N,), as the times of the clock.

    **Raises:** `InputError` for a rate that leaves too few samples or invents too many.
    """
    from scipy.interpolate import PchipInterpolator

    times, usual = clock.times, 1 / clock.step
    steps = np.diff(times)
    widest = int(steps.argmax())
    lowest, highest = MINIMUM_SAMPLES / times[-1], _FINEST * len(times) / times[-1]
    if not lowest <= rate <= highest:
        remedy = f"give one such as {usual:.4g}Hz"
        if not lowest <= usual <= highest:
            remedy = f"split the file at its gap of {steps[widest]:.4g} s"
        raise InputError.at(
            f"{source}, --resample",
            f"a rate from {lowest:.3g} to {highest:.3g} Hz",
            f"{rate:g} Hz",
            remedy,
        )
    count = 1 + int(times[-1] * rate * (1 + 1e-9))
    wanted = np.minimum(np.arange(count) / rate, times[-1])
    with np.errstate(all="ignore"):
        curves = {role: PchipInterpolator(times, y)(wanted) for role, y in signals.items()}
    note = (
        f"{source}: resampled to {rate:.6g} Hz by monotone cubics; the largest gap bridged is "
        f"{steps[widest]:.4g} s, {times[widest]:.6g} s after the first sample."
    )
    if rate < 0.9 * usual:
        note += (
            f" The file has about {usual:.3g} Hz: what is faster than {rate / 2:.4g} Hz folds "
            "down, as nothing was filtered."
        )
    return curves, note


def _step_of_fact(source: str, fact: Fact) -> float:
    """The step [s] that a file states as a step or a rate."""
    where = f'{source}, "{fact.name}"'
    if fact.unit == "Hz":
        return 1 / rate_of(fact.value, where)
    step = parse_quantity(fact.value, "s", where)
    if step <= 0:
        raise InputError.at(where, "a positive step", fact.value, "give --rate such as 200Hz")
    return step


def _refusal(
    table: Table, column: int, times: np.ndarray, bad: np.ndarray, expected: str, remedy: str
) -> InputError:
    """The refusal of the first bad step, of a mask of shape (N - 1,)."""
    row = int(bad.argmax()) + 1
    found = f"{times[row]:.9g} after {times[row - 1]:.9g}"
    return InputError.at(table.place(row, column), expected, found, remedy)


def _mend(slope: float | None, second: float) -> str:
    """What to do about stamps that do not increase, but may be rounded to a line of that slope."""
    if slope is None:
        return "correct or delete it"
    return f"if the stamps are rounded, give --rate {1 / (second * slope):.4g}Hz"


def _even(steps: np.ndarray) -> np.ndarray:
    """Which of the steps, shape (N - 1,), are positive and agree with their median."""
    usual = np.median(steps)
    return (steps > 0) & (np.abs(steps - usual) <= _UNIFORM * usual)


def _slope(times: np.ndarray) -> float | None:
    """The slope of a straight line that passes all stamps, shape (N,), within their rounding.

    None where there is none, or the stamps go back. What a line leaves over beyond the rounding
    is convex in its slope, so that the sign of its derivative halves the interval: the line must
    rise more where the stamp furthest above it comes later than the one furthest below. The search
    begins with least squares.
    """
    if (np.diff(times) < 0).any() or times[0] == times[-1]:
        return None
    half = _rounding(times)
    centred = np.arange(len(times)) - (len(times) - 1) / 2
    slope = float(centred @ times / (centred @ centred))
    reach = 4 * float(half.max()) / len(times)
    low, high = slope - reach, slope + reach
    for _ in range(40):
        excess, above, below = _beyond(times, slope, half)
        if excess <= 0:
            return slope if slope > 0 else None
        low, high = (slope, high) if above > below else (low, slope)
        slope = (low + high) / 2
    return None


def _beyond(times: np.ndarray, slope: float, half: np.ndarray) -> tuple[float, int, int]:
    """How far the best line of a slope misses the stamps beyond their rounding, each shape (N,).

    Not above 0 where it passes them all; with the stamps furthest above and below it.
    """
    rest = times - slope * np.arange(len(times))
    above, below = int((rest - half).argmax()), int((rest + half).argmin())
    return float(rest[above] - half[above] - rest[below] - half[below]), above, below


def _rounding(times: np.ndarray) -> np.ndarray:
    """Half a unit of the last digit each stamp was written to, and a hundredth of it, shape (N,).

    Of decimals it is that of a fixed number of places or of significant digits, whichever the
    stamps show; of numbers that float32 holds exactly, half its spacing; at least a unit of
    float64.
    """
    places = np.full(len(times), 17)
    for number in range(15, -1, -1):
        places[np.round(times, number) == times] = number
    with np.errstate(divide="ignore", over="ignore"):
        leading = np.floor(np.log10(np.abs(times)))
        digits = np.maximum(10.0 ** -places.max(), 10.0 ** (leading - (leading + places).max()))
        single = times.astype(np.float32)
    half = np.maximum(digits / 2, np.spacing(np.abs(times)))
    if (single == times).all():
        half = np.maximum(half, np.spacing(np.abs(single)).astype(np.float64) / 2)
    return 1.01 * half
