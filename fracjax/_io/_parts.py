"""The segments of one signal, each with its clock."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fracjax._io._assigned_units import unit_of
from fracjax._io._choice import listing, role, written_unit
from fracjax._io._clocks import (
    Clock,
    clock_of_count,
    clock_of_rate,
    clock_of_time,
    is_counter,
)
from fracjax._io._facts import step_of
from fracjax._io._segments import cut, segments_of_times
from fracjax._io._table import Table
from fracjax._io._units import readable
from fracjax._recording import MINIMUM_SAMPLES, InputError, require_samples


class Part(NamedTuple):
    """One signal of one segment."""

    table: Table
    column: int
    rows: slice
    values: np.ndarray
    clock: Clock


class Timing(NamedTuple):
    """What a call says of the clock."""

    rate: float | None
    """[Hz]"""
    unit: str | None
    """That of the time column."""
    uniform: bool
    """Whether samples must come in uniform steps."""


def parts_of(
    table: Table, column: int, time: int | None, timing: Timing, beside: Sequence[Part] = ()
) -> list[Part]:
    """The segments of a signal, by its time column `time` or without one.

    `beside` are those of another signal of the table, by the same column, whose clocks are its own
    where it has as many samples.

    Raises InputError for a clock that goes wrong, or samples that are missing.
    """
    values = table.numbers(column)
    if time is None:
        require_samples(len(values), table.source)
        return _without_time(table, column, values, timing)
    times = table.numbers(time)
    # A channel of fewer samples than its neighbours ends in empty cells.
    filled = np.isfinite(times) | ~np.isnan(values)
    count = len(filled) - int(filled[::-1].argmax()) if filled.any() else 0
    if beside and beside[-1].rows.stop == count:
        return [part._replace(column=column, values=values[part.rows]) for part in beside]
    times, values = times[:count], values[:count]
    if not np.isfinite(times).all():
        row = int((~np.isfinite(times)).argmax())
        raise InputError.at(
            table.place(row, time), "a time", table.shown(row, time), "correct or delete that line"
        )
    require_samples(count, table.source)
    clock_of = _counted if _counts(table, time, times, timing.rate) else _timed
    return [
        Part(table, column, rows, values[rows], clock_of(table, time, rows, timing))
        for rows in segments_of_times(times)
    ]


def _without_time(table: Table, column: int, values: np.ndarray, timing: Timing) -> list[Part]:
    """The blocks of a table without times, parted also where a count of samples begins anew."""
    whole = clock_of_rate(table, column, timing.rate, listing(table))
    places = list(table.breaks)
    counter = _counter(table, column)
    if counter is not None:
        places = sorted({*places, *_breaks_of_count(table, counter)})
    slices = cut(len(values), places)
    if table.breaks and len(slices) == 1:
        raise InputError.at(
            table.place(table.breaks[0], column),
            f"blocks of at least {MINIMUM_SAMPLES} rows each",
            "one that begins there, with a shorter one before or after it",
            "delete what stands between them, or split the file",
        )
    return [
        Part(
            table,
            column,
            rows,
            values[rows],
            whole._replace(times=whole.times[: rows.stop - rows.start])
            if len(slices) > 1
            else whole,
        )
        for rows in slices
    ]


def _breaks_of_count(table: Table, counter: int) -> list[int]:
    """The rows at which a count of samples begins anew.  Raises InputError where it skips some."""
    counts = table.numbers(counter)
    steps = np.diff(counts)
    usual = np.median(steps)
    places = [int(at) + 1 for at in np.flatnonzero(steps <= 0)]
    odd = (steps != usual) & (steps > 0)
    if odd.any():
        row = int(odd.argmax()) + 1
        raise InputError.at(
            table.place(row, counter),
            f"a count by {usual:g}",
            f"{counts[row]:g} after {counts[row - 1]:g}, so that samples are missing",
            f"give --time {counter}, which parts the recording there or, with --resample, fills it",
        )
    return places


def _counted(table: Table, time: int, rows: slice, timing: Timing) -> Clock:
    """The clock of a stretch of a column that counts samples."""
    counts = table.numbers(time)[rows]
    clock = clock_of_count(table, time, counts, timing.rate, table.about(time).clocks)
    if timing.uniform and not clock.uniform:
        row = int((np.diff(counts) != np.median(np.diff(counts))).argmax()) + 1
        raise InputError.at(
            table.place((rows.start or 0) + row, time),
            "a count without gaps",
            f"{counts[row]:g} after {counts[row - 1]:g}",
            f"give --resample {1 / clock.step:.4g}Hz",
        )
    return clock


def _timed(table: Table, time: int, rows: slice, timing: Timing) -> Clock:
    """The clock of a stretch of a column of times."""
    about = table.about(time)
    second = unit_of(table, "time", time, timing.unit)
    rate = timing.rate
    if about.stamps and rate is None and about.clocks:
        # Stamps of whole seconds beside a stated rate.
        repeated = (np.diff(table.numbers(time)[rows]) == 0).any()
        rate = 1 / step_of(about.clocks[0], table.source) if repeated else None
    clock = clock_of_time(
        table,
        time,
        # The numbers are in the unit that is written, whatever the call says.
        readable(written_unit(table, time) or second.name) or second.name,
        rows,
        rate,
        uniform=timing.uniform,
        facts=about.clocks,
        is_assumed=second.is_assumed,
    )
    note = "" if second.is_assumed or second.scale != 1.0 else second.note
    return clock._replace(notes=(note, *clock.notes))


def _counts(table: Table, time: int, times: np.ndarray, rate: float | None) -> bool:
    """Whether a column given or taken as the time counts samples: it says so, or no unit and the
    call gives a rate."""
    if table.about(time).stamps:
        return False
    spoken = role(table, time)
    if spoken == "counter":
        return len(times) > 1 and bool((times == np.round(times)).all())
    return rate is not None and spoken != "time" and abs(rate - 1) > 1e-3 and is_counter(times)


def _counter(table: Table, column: int) -> int | None:
    """The column that counts the samples of another."""
    length = table.about(column).length
    for at in range(table.width if table.names else 0):
        about = table.about(at)
        sound = not about.fault and about.length == length and not about.stamps
        if at != column and sound and role(table, at) == "counter":
            return at
    return None
