"""From tables to recordings: columns, units, clocks, segments and missing samples together."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from fracjax._io._assigned_units import Unit, unit_of
from fracjax._io._choice import choose, listing, role as role_in
from fracjax._io._clocks import (
    Clock,
    clock_of_count,
    clock_of_rate,
    clock_of_time,
    is_counter,
    note_on_facts,
    rate_of,
)
from fracjax._io._clocks import is_time as is_time
from fracjax._io._facts import step_of
from fracjax._io._missing import Mask, notes_on, require_masked, with_spikes, within
from fracjax._io._resampling import Channel, resampled
from fracjax._io._segments import cut, in_words, segments_of_times
from fracjax._io._table import Table, column_label
from fracjax._recording import InputError, Recording, require_samples

_SAME = 1e-6
"""Largest relative difference of steps that are one, and, of a step, of moments that are one."""


@dataclass(frozen=True)
class Request:
    """What a call says of how to read."""

    columns: Mapping[str, str | int | None]
    """Name or index by role: "time", "input", "output"."""
    rate: str | float | None = None
    units: Mapping[str, str | None] = field(default_factory=dict)
    resample: str | float | None = None
    mask: Mask = None
    segment: int | None = None

    def of(self, *roles: str) -> "Request":
        """The same for some of the signals."""
        kept = {role: self.columns.get(role) for role in ("time", *roles)}
        return replace(self, columns=kept)


class Signals(NamedTuple):
    """The signals of one segment by role, in uniform steps."""

    samples: dict[str, np.ndarray]
    units: dict[str, str]
    step: float
    """[s]"""
    masked: np.ndarray | None
    """(N,), the samples that are left out."""
    source: str
    notes: tuple[str, ...]
    columns: dict[str, str | int]
    """By role, the column's name, or its index from 0 where it has none."""


class _Part(NamedTuple):
    """One signal of one segment."""

    table: Table
    column: int
    rows: slice
    values: np.ndarray
    clock: Clock


def recordings_of(signals: list[Signals]) -> list[Recording]:
    """The recordings of the segments of a table with drive and response."""
    return [
        Recording(
            each.samples["input"],
            each.samples["output"],
            each.step,
            each.units["input"],
            each.units["output"],
            each.source,
            each.notes,
            each.masked,
        )
        for each in signals
    ]


class Found(NamedTuple):
    """The segments of a file."""

    signals: list[Signals]
    lengths: list[float]
    """[s]"""
    gaps: list[float | None]
    """[s] between them, None where the clock begins anew."""


def the_one(
    signals: list[Signals], lengths: list[float], gaps: list[float | None], source: str
) -> Signals:
    """The only segment.  Raises InputError where there are several."""
    if len(signals) > 1:
        raise InputError.at(
            source,
            "one recording",
            in_words(lengths, gaps),
            f"give --segment 1 to {len(signals)}, or split the file",
        )
    return signals[0]


def signals_of(tables: Mapping[str, Table], request: Request) -> Found:
    """The signals by segment, the segments' lengths [s] and the gaps [s] between them.

    `tables`: by role, the same one for drive and response or one for each.

    **Raises:** `InputError` for whatever is missing, ambiguous or contradictory.
    """
    first = next(iter(tables.values()))
    hertz = None if request.rate is None else rate_of(request.rate, f"{first.source}, --rate")
    wanted = (
        None
        if request.resample is None
        else rate_of(request.resample, f"{first.source}, --resample")
    )
    roles = [role for role in request.columns if role != "time"]
    chosen: dict[str, tuple[int, int | None]] = {}
    for table, group in _groups(tables, roles):
        found = choose(
            table,
            {role: request.columns.get(role) for role in ("time", *group)},
            has_rate=hertz is not None,
            stated=[role for role, told in request.units.items() if told],
        )
        for role in group:
            chosen[role] = found.signals[role], found.times.get(role)
    _require_lengths(tables, chosen, hertz)
    units = {role: unit_of(tables[role], role, chosen[role][0], request.units.get(role)) for role in roles}
    parts = {role: _parts(tables[role], *chosen[role], hertz, wanted, request) for role in roles}
    counts = {len(each) for each in parts.values()}
    if len(counts) > 1:
        told = " and ".join(f"{len(each)} of the {_NAMES[role]}" for role, each in parts.items())
        raise InputError.at(first.source, "as many segments of both", told, "split the files")
    total = counts.pop()
    lengths = [_length(parts[roles[0]][at].clock) for at in range(total)]
    apart = _apart([parts[roles[0]][at].clock for at in range(total)])
    order = range(total)
    if request.segment is not None:
        if not 1 <= request.segment <= total:
            raise InputError.at(
                f"{first.source}, --segment", f"one from 1 to {total}", f"{request.segment}", "correct it"
            )
        order = range(request.segment - 1, request.segment)
    found = [
        _signals({role: parts[role][at] for role in roles}, units, chosen, wanted, request, at, total)
        for at in order
    ]
    if total > 1:
        said = f"{first.source}: it holds {in_words(lengths, apart)}; each is a recording of its own."
        found[0] = found[0]._replace(notes=(said, *found[0].notes))
    return Found(found, lengths, apart)


_NAMES = {"input": "drive", "output": "response"}


def _groups(tables: Mapping[str, Table], roles: list[str]) -> list[tuple[Table, list[str]]]:
    """Each table with the roles it has to fill."""
    if len({id(table) for table in tables.values()}) == 1:
        return [(tables[roles[0]], roles)]
    return [(tables[role], [role]) for role in roles]


def _require_lengths(
    tables: Mapping[str, Table], chosen: Mapping[str, tuple[int, int | None]], rate: float | None
) -> None:
    """Raise `InputError` where columns of one table differ in length and no clocks bring them
    together."""
    abouts = {role: (tables[role], at, tables[role].about(at)) for role, (at, _) in chosen.items()}
    for role, (at, time) in chosen.items():
        if time is not None:
            table = tables[role]
            if table.about(time).length != table.about(at).length:
                abouts[role] = table, time, table.about(time)
                raise _unequal({f"{role}": (table, at), "time": (table, time)})
    if len({about.length for _, _, about in abouts.values()}) == 1:
        return
    if all(time is not None for _, time in chosen.values()):
        return
    if all(about.clocks or chosen[role][1] is not None for role, (_, _, about) in abouts.items()):
        rates = {about.clocks for _, _, about in abouts.values()}
        if len(rates) > 1 or all(about.start is not None for _, _, about in abouts.values()):
            return
    raise _unequal({role: (table, at) for role, (table, at, _) in abouts.items()})


def _unequal(columns: Mapping[str, tuple[Table, int]]) -> InputError:
    table = next(iter(columns.values()))[0]
    told = " and ".join(
        f"{each.about(at).length} of {column_label(each.names, at)}" for each, at in columns.values()
    )
    return InputError.at(
        table.source, "as many samples in each column", told, "choose columns of one length"
    )


def _parts(
    table: Table,
    column: int,
    time: int | None,
    rate: float | None,
    resample: float | None,
    request: Request,
) -> list[_Part]:
    """The segments of one signal, each with its clock."""
    values = table.numbers(column)
    require_samples(len(values), table.source)
    if time is None:
        counter = _counter(table, column)
        whole = clock_of_rate(table, column, rate, listing(table))
        places = list(table.breaks)
        if counter is not None:
            counts = table.numbers(counter)
            if np.isfinite(counts).all() and len(counts) == len(values):
                steps = np.diff(counts)
                places = sorted({*places, *(np.flatnonzero((steps <= 0) | (steps > 10 * np.median(steps))) + 1)})
                if (steps != np.median(steps)).any() and len(cut(len(values), places)) == 1:
                    row = int((steps != np.median(steps)).argmax()) + 1
                    raise InputError.at(
                        table.place(row, counter),
                        f"a count by {np.median(steps):g}",
                        f"{counts[row]:g} after {counts[row - 1]:g}: samples are missing",
                        f"give --time {counter} and --resample, or split the file there",
                    )
        slices = cut(len(values), [int(p) for p in places])
        return [
            _Part(table, column, rows, values[rows], whole._replace(times=whole.times[rows] - (whole.times[rows.start or 0] if len(slices) > 1 else 0.0)))
            for rows in slices
        ]
    about, times = table.about(time), table.numbers(time)
    if not np.isfinite(times).all():
        row = int((~np.isfinite(times)).argmax())
        raise InputError.at(
            table.place(row, time), "a time", table.shown(row, time), "correct or delete that line"
        )
    counts = _counts(table, time, times, rate)
    told = request.units.get("time")
    second = Unit("s", 1.0, "") if counts else unit_of(table, "time", time, told)
    found = []
    if about.stamps and rate is None and about.clocks and (np.diff(times) == 0).any():
        # Stamps of whole seconds beside a stated rate.
        rate = 1 / step_of(about.clocks[0], table.source)
    for rows in segments_of_times(times):
        if counts:
            clock = clock_of_count(table, time, times[rows], rate, about.clocks)
        else:
            written = second.name if not second.is_assumed else "s"
            clock = clock_of_time(
                table,
                time,
                written if second.scale == 1.0 else told or written,
                rows,
                rate,
                uniform=resample is None,
                facts=about.clocks,
                is_assumed=second.is_assumed,
            )
            clock = clock._replace(times=clock.times * 1.0)
            if second.note and not second.is_assumed:
                clock = clock._replace(notes=(second.note, *clock.notes))
        if not clock.uniform and resample is None:
            raise InputError.at(
                table.source, "a count without gaps", "one with gaps", f"give --resample {1 / clock.step:.4g}Hz"
            )
        found.append(_Part(table, column, rows, values[rows], clock))
    return found


def _counts(table: Table, time: int, times: np.ndarray, rate: float | None) -> bool:
    """Whether a column given or taken as the time counts samples: it says so, or no unit and the
    call gives a rate."""
    whole = len(times) > 1 and bool((times == np.round(times)).all())
    if not whole or table.about(time).stamps:
        return False
    spoken = role_in(table, time)
    if spoken == "counter":
        return True
    return rate is not None and is_counter(times) and spoken != "time" and abs(rate - 1) > 1e-3


def _counter(table: Table, column: int) -> int | None:
    """The column that counts the samples of another."""
    length = table.about(column).length
    for at in range(table.width if table.names else 0):
        about = table.about(at)
        if at != column and not about.fault and about.length == length and not about.stamps:
            if role_in(table, at) == "counter":
                return at
    return None


def _length(clock: Clock) -> float:
    return float(clock.times[-1] - clock.times[0] + clock.step)


def _apart(clocks: list[Clock]) -> list[float | None]:
    """The gaps [s] between clocks that follow one another, None where one begins anew."""
    steps = [
        float(later.times[0] - earlier.times[-1])
        for earlier, later in zip(clocks[:-1], clocks[1:], strict=True)
    ]
    return [step if step > 0 else None for step in steps]


def _signals(
    parts: dict[str, _Part],
    units: dict[str, Unit],
    chosen: Mapping[str, tuple[int, int | None]],
    wanted: float | None,
    request: Request,
    at: int,
    total: int,
) -> Signals:
    """One segment's signals in uniform steps."""
    tables = list(dict.fromkeys(part.table.source for part in parts.values()))
    source = " and ".join(tables) + (f", segment {at + 1} of {total}" if total > 1 else "")
    clocks = [part.clock for part in parts.values()]
    notes = [*note_on_facts(source, clocks), *(n for clock in clocks for n in clock.notes)]
    notes += [units[role].note for role in parts]
    for role, part in parts.items():
        read = [part.column, chosen[role][1]]
        notes += [part.table.about(at).note for at in read if at is not None]
    bad: dict[str, np.ndarray] = {}
    parts = _on_one_zero(parts, source)
    for role, part in parts.items():
        times = part.clock.times - part.clock.times[0]
        lost = ~np.isfinite(part.values)
        allowed = within(request.mask, times, part.clock.step)
        require_masked(part.table, part.column, part.rows, part.values, allowed, times)
        bad[role] = with_spikes(request.mask, part.values, lost) if role == "output" else lost
    if wanted is None:
        parts, cuts, told = _aligned(parts, source)
        bad = {role: each[cuts[role]] for role, each in bad.items()}
        notes += told
        samples = {role: part.values for role, part in parts.items()}
        masked = np.logical_or.reduce(list(bad.values()))
        step = next(iter(parts.values())).clock.step
        notes += notes_on_parts(parts, bad)
    else:
        notes += notes_on_parts(parts, bad)
        channels = {role: Channel(part.values, part.clock, bad[role]) for role, part in parts.items()}
        together = resampled(channels, wanted, source)
        samples, masked, step = together.samples, together.bad, 1 / wanted
        notes.append(together.note)
    scaled = {role: values * units[role].scale if units[role].scale != 1.0 else values for role, values in samples.items()}
    taken: dict[str, str | int] = {}
    for role, part in parts.items():
        names = part.table.names
        time = chosen[role][1]
        if time is not None:
            taken.setdefault("time", names[time] if names else time)
        taken[role] = names[part.column] if names else part.column
    told_units = {role: units[role].name for role in parts}
    kept = tuple(dict.fromkeys(note for note in notes if note))
    return Signals(scaled, told_units, step, masked if masked.any() else None, source, kept, taken)


def notes_on_parts(parts: dict[str, _Part], bad: dict[str, np.ndarray]) -> list[str]:
    """What is said of samples that are left out."""
    notes: list[str] = []
    for role, part in parts.items():
        times = part.clock.times - part.clock.times[0]
        notes += notes_on(part.table, {role: part.column}, bad, times)
    return notes


def _on_one_zero(parts: dict[str, _Part], source: str) -> dict[str, _Part]:
    """The signals with their times counted from one zero, where the file says when each began."""
    if len(parts) < 2:
        return parts
    starts = {role: part.clock.start for role, part in parts.items()}
    if any(start is None for start in starts.values()):
        return parts
    zero = min(start for start in starts.values() if start is not None)
    return {
        role: part._replace(
            clock=part.clock._replace(times=part.clock.times + ((starts[role] or zero) - zero) / 1e9)
        )
        for role, part in parts.items()
    }


def _aligned(
    parts: dict[str, _Part], source: str
) -> tuple[dict[str, _Part], dict[str, slice], list[str]]:
    """The signals over the time they have in common, where one grid of samples serves them all.

    **Raises:** `InputError` where none does.
    """
    everything = {role: slice(0, len(part.values)) for role, part in parts.items()}
    if len(parts) < 2:
        return parts, everything, []
    (one, first), (two, second) = parts.items()
    a, b = first.clock, second.clock
    long = max(len(a.times), len(b.times))
    if abs(a.step - b.step) > 0.01 * a.step / long:
        told = (
            f"the {_NAMES[one]} at {1 / a.step:.6g} Hz and the {_NAMES[two]} at {1 / b.step:.6g} Hz"
        )
        fastest = max(1 / a.step, 1 / b.step)
        raise InputError.at(source, "one rate", told, f"give --resample {fastest:.6g}Hz")
    shift = (b.times[0] - a.times[0]) / a.step
    if abs(shift) < 0.01 and len(a.times) == len(b.times):
        return parts, everything, []
    if abs(shift) < 0.01 and not (a.told and b.told):
        raise _unequal({one: (first.table, first.column), two: (second.table, second.column)})
    whole = round(shift)
    if abs(shift - whole) > 0.01:
        raise InputError.at(
            source,
            "drive and response sampled at the same moments",
            f"the {_NAMES[two]} {shift * a.step:.6g} s after the {_NAMES[one]}",
            f"give --resample {1 / a.step:.6g}Hz",
        )
    begin = max(whole, 0)
    stop = min(len(a.times), whole + len(b.times))
    if stop - begin < 1:
        raise InputError.at(
            source,
            "drive and response at the same time",
            "times that do not overlap",
            "give files of the same run",
        )
    cuts = {one: slice(begin, stop), two: slice(begin - whole, stop - whole)}
    order = (two, one) if shift > 0 else (one, two)
    later, earlier = (_NAMES[role] for role in order)
    note = (
        f"{source}: the {later} begins {abs(shift) * a.step:.6g} s after the {earlier}; both were "
        f"cut to the {stop - begin} samples they have in common."
    )
    found = {
        role: part._replace(
            values=part.values[cuts[role]],
            clock=part.clock._replace(times=part.clock.times[cuts[role]]),
        )
        for role, part in parts.items()
    }
    return found, cuts, [note]
