"""The segments of one signal, each with its clock."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fracjax._io._choice import listing, role
from fracjax._io._clocks import (
    Clock,
    clock_of_count,
    clock_of_rate,
    clock_of_time,
)
from fracjax._io._even import is_counter
from fracjax._io._facts import step_of
from fracjax._io._segments import cut, segments_of_times
from fracjax._io._table import Table, column_label
from fracjax._io._times import Stamps, stamps_of
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
    wrap: str | None
    """After what a counter begins anew."""
    uniform: bool
    """Whether samples must come in uniform steps."""


def parts_of(
    table: Table,
    column: int,
    time: int | None,
    timing: Timing,
    signals: Sequence[int],
    beside: Sequence[Part] = (),
) -> list[Part]:
    """The segments of a signal, by its time column `time` or without one.

    `signals` are all columns with the same time, and `beside` the parts of another of them, whose
    clocks are its own where it has as many samples.

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
    kept = _kept(table, column, signals, count)
    if beside and beside[-1].rows.stop == count and kept is None:
        return [part._replace(column=column, values=values[part.rows]) for part in beside]
    values = values[:count]
    if not np.isfinite(times[:count]).all():
        row = int((~np.isfinite(times[:count])).argmax())
        about = table.about(time)
        raise InputError.at(
            about.place(row), "a time", about.shown(row), "correct or delete that line"
        )
    require_samples(count, table.source)
    if _counts(table, time, times[:count], timing.rate):
        return [
            Part(table, column, rows, values[rows], _counted(table, time, rows, timing))
            for rows in segments_of_times(times[:count])
        ]
    stamps = stamps_of(table, time, timing.unit, timing.wrap)
    stamps = stamps._replace(values=stamps.values[:count])
    if kept is not None:
        note = (
            f"{table.source}, {column_label(table.names, column)}: it stands in "
            f"{np.count_nonzero(kept)} of {count} rows, with stamps of its own."
        )
        stamps = stamps._replace(values=stamps.values[kept], notes=(*stamps.notes, note))
        values = values[kept]
    if timing.rate is None:
        stamps, values = _once(table, stamps, values, signals, most=0.1 if timing.uniform else 1.0)
    return _timed(table, column, time, stamps, values, timing)


_SPARSE = 0.3
"""Least share of rows without a value where others may stand in them on purpose."""


def _kept(table: Table, column: int, signals: Sequence[int], count: int) -> np.ndarray | None:
    """The rows (count,) of a signal whose stamps are not those of the others: which stand in rows
    of their own, or at other rates.  None where every row is one of it."""
    own = np.isfinite(table.numbers(column)[:count])
    if not count or np.mean(own) > 1 - _SPARSE or np.count_nonzero(own) < MINIMUM_SAMPLES:
        return None
    others = [np.isfinite(table.numbers(each)[:count]) for each in signals if each != column]
    apart = bool(others) and np.mean(own & np.logical_or.reduce(others)) < 0.01
    every = np.diff(np.flatnonzero(own))
    return own if apart or every.min() == every.max() else None


def _once(
    table: Table, stamps: Stamps, values: np.ndarray, signals: Sequence[int], most: float
) -> tuple[Stamps, np.ndarray]:
    """Stamps and values without the rows that a logger wrote twice: a share of `most` of all, or
    every row."""
    again = np.diff(stamps.values) == 0
    if not again.any():
        return stamps, values
    columns = [table.numbers(each) for each in signals]
    if any(len(each) != len(values) for each in columns):
        return stamps, values
    twice = again & np.logical_and.reduce([np.diff(each) == 0 for each in columns])
    kept = np.concatenate([[True], ~twice])
    # Stamps that are rounded repeat also where the signals move.
    every = bool(kept[::2].all() and not kept[1::2].any())
    few = 0 < np.mean(twice) <= most
    if not (few or every) or (np.diff(stamps.values[kept]) <= 0).any():
        return stamps, values
    note = f"{table.source}: {twice.sum()} row(s) stand there twice, and were taken once."
    return stamps._replace(values=stamps.values[kept], notes=(*stamps.notes, note)), values[kept]


def _timed(
    table: Table, column: int, time: int, stamps: Stamps, values: np.ndarray, timing: Timing
) -> list[Part]:
    """The segments of a signal with stamps."""
    about = table.about(time)
    rate = timing.rate
    if about.stamps and rate is None and about.clocks and (np.diff(stamps.values) == 0).any():
        # Stamps of whole seconds beside a stated rate.
        rate = 1 / step_of(about.clocks[0], table.source)
    if rate is None and about.clocks:
        held = _held(stamps, step_of(about.clocks[0], table.source))
        if held is not None:
            stamps, values = held[0], np.repeat(values, held[1])
    parts = []
    for rows in segments_of_times(stamps.values):
        clock = clock_of_time(
            table,
            time,
            stamps._replace(values=stamps.values[rows]),
            rows,
            rate,
            uniform=timing.uniform,
            is_given=timing.unit is not None,
        )
        clock = clock._replace(notes=(stamps.unit.note, *stamps.notes, *clock.notes))
        parts.append(Part(table, column, rows, values[rows], clock))
    return parts


def _held(stamps: Stamps, step: float) -> tuple[Stamps, np.ndarray] | None:
    """Stamps at the stated step [s] of a table that has a row only where a signal changes, and how
    often each row stands for a sample; None of any other table."""
    steps = np.diff(stamps.values) * stamps.second / step
    times = np.round(steps)
    if np.mean(times) < 2 or times.min() < 1 or times.min() == times.max():
        return None
    if np.abs(steps - times).max() > 0.01:
        return None
    often = np.concatenate([times, [1]]).astype(int)
    total = int(often.sum())
    first = stamps.values[0]
    note = (
        f"It has {len(often)} rows for {total} samples at the rate of {1 / step:.6g} Hz that it "
        "states: a row where a signal changes. Each was held until the next."
    )
    values = first + np.arange(total) * (step / stamps.second)
    return stamps._replace(values=values, notes=(*stamps.notes, note)), often


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
            table.about(column).place(table.breaks[0]),
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


def _is_count(counts: np.ndarray) -> bool:
    """Whether numbers (N,) count samples, but for what is missing."""
    steps = np.diff(counts)
    usual = np.median(steps)
    whole = bool((counts == np.round(counts)).all())
    return whole and usual > 0 and float(np.mean(steps == usual)) > 0.9


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
            table.about(counter).place(row),
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
            table.about(time).place((rows.start or 0) + row),
            "a count without gaps",
            f"{counts[row]:g} after {counts[row - 1]:g}",
            f"give --resample {1 / clock.step:.4g}Hz",
        )
    return clock


def _counts(table: Table, time: int, times: np.ndarray, rate: float | None) -> bool:
    """Whether a column given or taken as the time counts samples: it says so, or no unit and the
    call gives a rate."""
    if table.about(time).stamps:
        return False
    spoken = role(table, time)
    if spoken == "counter":
        return len(times) > 1 and _is_count(times)
    return rate is not None and spoken != "time" and abs(rate - 1) > 1e-3 and is_counter(times)


def _counter(table: Table, column: int) -> int | None:
    """The column that counts the samples of another."""
    length = table.about(column).length
    for at in range(table.width if table.names else 0):
        about = table.about(at)
        sound = not about.fault and about.length == length and not about.stamps
        if at != column and sound and role(table, at) == "counter" and _is_count(about.numbers):
            return at
    return None
