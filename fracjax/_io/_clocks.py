"""When samples were taken: by a column of times, by a count of samples, or by a rate."""

import re
from collections.abc import Sequence
from math import isclose
from typing import NamedTuple

import numpy as np

from fracjax._io._declared import title_of
from fracjax._io._even import (
    UNIFORM,
    are_even,
    beyond,
    even,
    filled,
    is_counter,
    is_time,
    rounding,
    slope_of,
)
from fracjax._io._facts import (
    NUMBER,
    is_decimated,
    scales_time,
    speaks_of_sampling,
    step_of,
    units_in,
)
from fracjax._io._table import Fact, Stated, Table, column_key, column_label
from fracjax._io._times import Stamps
from fracjax._io._units import is_compatible, is_spelled_unit, readable, unread
from fracjax._recording import InputError, conversion, parse_quantity

_STATED = 1e-2
"""Largest departure of a column's step from the one that the file states beside it."""


class Clock(NamedTuple):
    """When the samples of a channel were taken."""

    times: np.ndarray
    """[s], shape (N,); from 0 where no column gives them."""
    step: float
    """[s], of times that are not uniform the usual one"""
    notes: tuple[str, ...]
    """What had to be assumed."""
    start: int | None = None
    """When the zero of the times is [ns since 1970]."""
    uniform: bool = True
    states_start: bool = True
    """Whether a column, or a start in the file, says when it began."""
    facts: tuple[Fact, ...] = ()
    """What in the file its step was taken from, where no column gives it."""


def rate_of(text: str | float, where: str) -> float:
    """The rate [Hz] that a call or a file gives, such as "200Hz" or 200."""
    hertz = parse_quantity(text, "Hz", where)
    if hertz <= 0:
        raise InputError.at(where, "a positive rate", f'"{text}"', "give one such as 200Hz")
    return hertz


def clock_of_rate(table: Table, column: int, rate: float | None, listing: str) -> Clock:
    """The clock of a column without times.

    `rate`: [Hz], which the call gives; without it, what the file states counts.
    """
    about = table.about(column)
    counted = np.arange(about.length)
    states_start = about.start is not None
    if rate is not None:
        return Clock(counted / rate, 1 / rate, (), about.start, states_start=states_start)
    step = _stated_step(table, about.clocks, listing)
    return Clock(
        step * counted, step, (), about.start, states_start=states_start, facts=about.clocks
    )


def note_on_facts(source: str, clocks: Sequence[Clock]) -> list[str]:
    """The note on steps that were taken from facts in the file."""
    notes = []
    for step in dict.fromkeys(clock.step for clock in clocks if clock.facts):
        facts = dict.fromkeys(f for clock in clocks if clock.step == step for f in clock.facts)
        sources = " and ".join(f'"{fact.name}" of {fact.value}' for fact in facts)
        notes.append(f"{source}: {1 / step:.6g} Hz was taken as the rate, from {sources}.")
    return notes


def _stated_step(table: Table, facts: Sequence[Fact], listing: str) -> float:
    """The step [s] that a file states."""
    facts = list(dict.fromkeys(facts))
    steps = [step_of(fact, f'{table.source}, "{fact.name}"') for fact in facts]
    clock_texts = " and ".join(f'"{fact.name}" of {fact.value}' for fact in facts)
    if not steps:
        raise InputError.at(
            table.source,
            "a time column or a rate",
            f"neither in {listing}",
            _rates_in(table) or _times_in(table),
        )
    if max(steps) > (1 + UNIFORM) * min(steps):
        raise InputError.at(table.source, "one rate", clock_texts, "give --rate such as 200Hz")
    _require_whole_truth(table, facts, steps[0], clock_texts)
    return steps[0]


def _times_in(table: Table) -> str:
    """The columns that run in even steps, as options, and a rate."""
    columns = range(table.width if table.names else 0)
    sound = [c for c in columns if not (table.about(c).fault or table.about(c).stamps)]
    times = {column_key(table.names, c): filled(table.numbers(c)) for c in sound}
    runs = [key for key, each in times.items() if is_time(each) and not is_counter(each)]
    if not runs:
        return "give --rate such as 200Hz, or --time as a name or an index from 0"
    return f"give --time {' or --time '.join(runs[:2])}, in even steps, or --rate such as 200Hz"


def _rates_in(table: Table) -> str:
    """The rates of sampling in lines that were not understood, as options; empty without any."""
    options = []
    for said in table.unused:
        for number, word in re.findall(rf"(?<![\d.,])({NUMBER})\s*([^\W\d]+(?:/s)?)", said.text):
            hertz = conversion(readable(word) or "V", "Hz")
            if hertz and speaks_of_sampling(said.text):
                rate = f"{float(number) * hertz:.10g}Hz"
                options.append(f'--rate {rate} if "{said.text[:60]}" says that of the samples')
    return f"give {' or '.join(options[:2])}, else --rate such as 200Hz" if options else ""


def _require_whole_truth(
    table: Table, facts: Sequence[Fact], step: float, clock_texts: str
) -> None:
    """Raise `InputError` where a line that was not used may change a stated step [s]: by a unit of
    time where it has none, or by a number of samples that were averaged."""
    for said in table.unused:
        place = f'"{said.text[:60]}" in {said.place}'
        for word in units_in(said.text):
            read = readable(word) or ""
            bare = all(re.fullmatch(r"[-+.\deE]+", fact.value.strip()) for fact in facts)
            if not (bare and is_compatible(read, "s", "Hz")):
                continue
            number = float(facts[0].value)
            of_time = is_compatible(read, "s")
            scaled = number * (conversion(read, "s" if of_time else "Hz") or 1.0)
            rate = 1 / scaled if of_time else scaled
            raise InputError.at(
                table.source,
                f"a unit of {clock_texts}",
                f"none, but {place}",
                f"give --rate {rate:.10g}Hz if that is its unit, or --rate {1 / step:.10g}Hz",
            )
        if is_decimated(said.text):
            number = max(
                map(float, re.findall(rf"(?<![\w.]){NUMBER}(?![\w.])", said.text)), default=0.0
            )
            remedy = f"give --rate {1 / step / number:.10g}Hz or" if number > 1 else "give"
            raise InputError.at(
                table.source,
                "the rate of the samples in the file",
                f"{clock_texts}, and {place}",
                f"{remedy} --rate {1 / step:.10g}Hz",
            )


def clock_of_count(
    table: Table, column: int, counts: np.ndarray, rate: float | None, facts: Sequence[Fact]
) -> Clock:
    """The clock of a column that counts samples, by a rate; where it skips, samples are missing."""
    label = f"{table.source}, {column_label(table.names, column)}"
    if rate is None and not facts:
        raise InputError.at(
            label, "a time or a rate", "a count of samples", "give --rate such as 200Hz"
        )
    step = 1 / rate if rate else _stated_step(table, facts, "")
    by = np.median(np.diff(counts))
    times = step * (counts - counts[0]) / by
    even = bool((np.diff(counts) == by).all())
    return Clock(times, step, (), None, even, facts=() if rate else tuple(facts))


def clock_of_time(
    table: Table,
    column: int,
    stamps: Stamps,
    rows: slice,
    rate: float | None,
    *,
    uniform: bool,
    is_given: bool = False,
) -> Clock:
    """The clock of a stretch of a time column, which must increase.

    `rate` [Hz], with which it must agree, and which counts where the stamps are rounded;
    `uniform`, whether it must run in uniform steps, but for its rounding; `is_given`, whether the
    call gives its unit, which else must agree with whatever the file states.
    """
    label = f"{table.source}, {column_label(table.names, column)}"
    about = table.about(column)
    times, second, written = stamps.values, stamps.second, stamps.unit.name
    start = about.start
    if stamps.zero:
        start = round(stamps.zero * 10**9) + (start or 0)
    steps = np.diff(times)
    is_even = are_even(steps)
    slope = float(times[-1] - times[0]) / len(steps) if is_even else slope_of(times)
    if not is_even and (slope is None or rate is None):
        stuck = ~(steps > 1e-9 * np.median(np.abs(steps)))
        if stuck.any():
            remedy = _mend(times, stuck, slope, second)
            mean = float(np.mean(times)) * second + float(stamps.zero)
            back = (steps < 0).any() or not np.ptp(times)
            if back and stuck.mean() > 0.3 and np.ptp(times) * second < mean / 2:
                # Steps from row to row.
                if rate is not None and abs(mean * rate - 1) < UNIFORM:
                    return Clock(np.arange(len(times)) / rate, 1 / rate, ())
                remedy = f"if they are steps from row to row, give --rate {1 / mean:.6g}Hz"
            raise _refusal(table, column, rows, times, stuck, "time to increase", remedy)
    # Where there are gaps, the step between them.
    step = second * (float(steps[steps < 2 * np.median(steps)].mean()) if slope is None else slope)
    notes = () if is_given else _agreement(table, column, step, about.clocks, stamps)
    if rate is None and not (stamps.unit.is_stated or about.clocks):
        _require_seconds(label, times, step, float(stamps.zero) / second)
    if uniform and slope is None:
        expected = f"a step of {step / second:.6g} {written}"
        lost = int(np.sum(np.maximum(np.round(second * steps / step) - 1, 0)))
        remedy = f"give --resample {1 / step:.4g}Hz"
        remedy += f", which invents {lost} samples" if lost else ""
        raise _refusal(table, column, rows, times, ~even(steps), expected, remedy)
    rounded = slope is not None and not is_even
    if rate is not None:
        if rounded and beyond(times, 1 / (rate * second), rounding(times))[0] <= 0:
            return Clock(second * times[0] + np.arange(len(times)) / rate, 1 / rate, notes, start)
        if abs(step * rate - 1) > UNIFORM:
            raise InputError.at(
                label, f"a step of {1 / rate:g} s by --rate", f"{step:g} s", "leave out --rate"
            )
    if slope is None:
        return Clock(second * times, step, notes, start, False)
    if rounded:
        notes += (f"{label}: its stamps are rounded; a step of {step:.9g} s fits them all.",)
    return Clock(second * times[0] + step * np.arange(len(times)), step, notes, start)


def _agreement(
    table: Table, column: int, step: float, facts: Sequence[Fact], stamps: Stamps
) -> tuple[str, ...]:
    """The note on seconds that no file states.

    Raises InputError where the file states another step [s], or speaks of a unit of time beside a
    column of none.
    """
    label = f"{table.source}, {column_label(table.names, column)}"
    stated = {fact.name: step_of(fact, label) for fact in facts}
    other = next((name for name, s in stated.items() if abs(s - step) > _STATED * step), None)
    written = stamps.unit.name if stamps.unit.is_stated else "a unit that is not written"
    if other is not None:
        ratio = stated[other] / step
        unit = next(
            (u for u, s in _CLOCKS.items() if abs(s / (ratio * stamps.second) - 1) < 0.01), ""
        )
        raise InputError.at(
            label,
            f'a step of {stated[other]:.6g} s, as "{other}" says',
            f"{step / stamps.second:.6g} in {written}",
            f"give --clock {unit or written}"
            if unit or stamps.unit.is_stated
            else "give --clock with its unit, or --clock s where it is in seconds",
        )
    if stamps.unit.is_stated:
        return ()
    own = Stated(unread(title_of(table, column)), "its name")
    for said in (*table.unused, own):
        words = re.findall(r"[^\W\d_]+", said.text) if said is own else units_in(said.text)
        read = [readable(word) for word in words if is_spelled_unit(word)]
        units = [unit for unit in read if unit and is_compatible(unit, "s")]
        if scales_time(said.text):
            factors = [float(number) for number in re.findall(NUMBER, said.text)]
            units += [unit for unit, s in _CLOCKS.items() if any(isclose(s, f) for f in factors)]
            units = units or ["ms"]
        if units and not stated:
            raise InputError.at(
                label,
                "a unit beside the name",
                f'none, but "{said.text[:60]}" in {said.place}',
                "give --clock s"
                if units[0] == "s"
                else f"give --clock {units[0]} if that is its unit, or --clock s",
            )
    return (f"{label}: no unit is written, s was assumed.",) if not stated else ()


_CLOCKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}


def _require_seconds(label: str, times: np.ndarray, step: float, zero: float) -> None:
    """Raise `InputError` for stamps, from `zero`, that are hardly seconds, where no unit is
    written."""
    begin = zero + float(times[0])
    description = ""
    remedy = (
        "give --clock ms where they are milliseconds, --clock s where they are seconds, or --rate "
        "where samples are counted"
    )
    if (times == np.round(times)).all():
        description = f"whole numbers {step:g} apart, which may be samples, ticks or milliseconds"
    elif step < 1e-3 and (3e4 < begin < 6e4 or 7e5 < begin < 8e5):
        description = f"numbers from {begin:.6g}, which may be days"
        remedy = "give --clock days, or --clock s where they are seconds"
    if description:
        raise InputError.at(
            label,
            "seconds, or a unit beside the name",
            description,
            remedy,
        )


def _refusal(
    table: Table,
    column: int,
    rows: slice,
    times: np.ndarray,
    bad: np.ndarray,
    expected: str,
    remedy: str,
) -> InputError:
    """The refusal of the first bad step, of a mask of shape (N - 1,)."""
    row = int(bad.argmax()) + 1
    shown = table.about(column).shown
    cells = [shown((rows.start or 0) + at).strip('"') for at in (row, row - 1)]
    steps_back = f"{cells[0]} after {cells[1]}"
    return InputError.at(
        table.about(column).place((rows.start or 0) + row), expected, steps_back, remedy
    )


def _mend(times: np.ndarray, stuck: np.ndarray, slope: float | None, second: float) -> str:
    """What to do about stamps that do not increase, but may be rounded to a line of that slope."""
    changes = np.flatnonzero(~stuck) + 1
    alike = np.diff(changes)
    if len(alike) and alike.min() == alike.max() > 1 and not (np.diff(times) < 0).any():
        many = int(alike[0])
        even = are_even(np.diff(times[changes]))
        each = f"each stamp stands {many} times"
        rate = many / (second * float(np.median(np.diff(times[changes]))))
        if many == 2 or not even:
            return (
                f"{each}, as of pairs of least and largest values: export the samples themselves, "
                "with peak detection off"
            )
        return f"{each}: if they are rounded, give --rate {rate:.10g}Hz"
    if slope is not None and len(changes) > 2:
        rows, span = changes[-1] - changes[0], second * (times[changes[-1]] - times[changes[0]])
        rate = _roundest((rows - 1) / span, (rows + 1) / span)
        return f"if the stamps are rounded, give --rate {rate:.10g}Hz"
    if (np.diff(times) < 0).all():
        return "turn the rows round, the last first"
    row = int(stuck.argmax()) + 1
    if stuck.sum() == 1 and are_even(np.diff(np.delete(times, row))):
        return "delete that line, which is there twice"
    return "correct that stamp, or record again"


def _roundest(low: float, high: float) -> float:
    """The number between two with the fewest digits: what a clock is set to."""
    middle = (low + high) / 2
    for digits in range(1, 16):
        number = float(f"{middle:.{digits - 1}e}")
        if low <= number <= high:
            return number
    return middle
