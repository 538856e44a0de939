"""From tables to recordings: columns, units, clocks, segments and missing samples together."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fracjax._io._alignment import aligned, on_one_zero, unequal
from fracjax._io._assigned_units import Scale, Unit, require_scaled, unit_of
from fracjax._io._choice import choose
from fracjax._io._clocks import Clock, note_on_facts, rate_of
from fracjax._io._missing import Mask, note_on, require_masked, with_spikes, within
from fracjax._io._parts import Part, Timing, parts_of
from fracjax._io._resampling import Channel, resampled
from fracjax._io._segments import in_words
from fracjax._io._table import SIGNALS, Table, column_label
from fracjax._recording import MINIMUM_SAMPLES, InputError, Recording


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
    scales: Mapping[str, Scale] = field(default_factory=dict)
    wrap: str | None = None

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
    began: float | None
    """When the first sample was taken [s since 1970, or since the zero of its column of times]."""


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
            masked=each.masked,
            began=each.began,
        )
        for each in signals
    ]


class Segments(NamedTuple):
    """The segments of a file."""

    signals: list[Signals]
    lengths: list[float]
    """[s]"""
    gaps: list[float | None]
    """[s] between them, None where the clock begins anew."""
    unused: tuple[str, ...]
    """What the file states and nobody used."""


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


def signals_of(tables: Mapping[str, Table], request: Request) -> Segments:
    """The signals by segment, the segments' lengths [s] and the gaps [s] between them.

    `tables`: by role, the same one for drive and response or one for each.

    Raises InputError for whatever is missing, ambiguous or contradictory.
    """
    try:
        return _signals_of(tables, request)
    except InputError as error:
        raise InputError(_with_length(str(error), tables)) from None


def _with_length(refusal: str, tables: Mapping[str, Table]) -> str:
    """A refusal that also says, where it does not, that the file is too short."""
    for table in tables.values():
        read = [about for each in range(table.width) if not (about := table.about(each)).remedy]
        count = max((about.length for about in read), default=MINIMUM_SAMPLES)
        if count < MINIMUM_SAMPLES and f"at least {MINIMUM_SAMPLES} samples" not in refusal:
            return (
                f"{refusal.removesuffix('.')}; and give a longer recording: it has {count} "
                f"samples, and at least {MINIMUM_SAMPLES} are needed."
            )
    return refusal


def _signals_of(tables: Mapping[str, Table], request: Request) -> Segments:
    """`signals_of`, with the first fault alone."""
    first = next(iter(tables.values()))
    hertz = None if request.rate is None else rate_of(request.rate, f"{first.source}, --rate")
    wanted = (
        None
        if request.resample is None
        else rate_of(request.resample, f"{first.source}, --resample")
    )
    roles = [role for role in request.columns if role != "time"]
    chosen: dict[str, tuple[int, int | None]] = {}
    assumed = []
    for table, group in _groups(tables, roles):
        choice = choose(
            table,
            {role: request.columns.get(role) for role in ("time", *group)},
            has_rate=hertz is not None,
            stated=[r for r in roles if request.units.get(r) or r in request.scales],
        )
        assumed += [choice.note] if choice.note else []
        for role in group:
            chosen[role] = choice.signals[role], choice.times.get(role)
    _require_lengths(tables, chosen)
    require_scaled(
        {role: tables[role] for role in roles},
        {role: chosen[role][0] for role in roles},
        request.scales,
    )
    units = {
        role: unit_of(
            tables[role],
            role,
            chosen[role][0],
            request.units.get(role),
            request.scales.get(role),
        )
        for role in roles
    }
    timing = Timing(hertz, request.units.get("time"), request.wrap, wanted is None)
    parts: dict[str, list[Part]] = {}
    for role in roles:
        column, time = chosen[role]
        alike = [r for r in roles if tables[r] is tables[role] and chosen[r][1] == time]
        other = None if time is None else next((r for r in alike if r in parts), None)
        parts[role] = parts_of(
            tables[role],
            column,
            time,
            timing,
            [chosen[r][0] for r in alike],
            () if other is None else parts[other],
        )
    counts = {len(each) for each in parts.values()}
    if len(counts) > 1:
        counts = " and ".join(f"{len(each)} of the {SIGNALS[role]}" for role, each in parts.items())
        raise InputError.at(first.source, "as many segments of both", counts, "split the files")
    total = counts.pop()
    lengths = [_length(parts[roles[0]][at].clock) for at in range(total)]
    apart = _apart([parts[roles[0]][at].clock for at in range(total)])
    order = range(total)
    if request.segment is not None:
        if not 1 <= request.segment <= total:
            raise InputError.at(
                f"{first.source}, --segment",
                f"one from 1 to {total}",
                f"{request.segment}",
                "correct it",
            )
        order = range(request.segment - 1, request.segment)
    segments = [
        _signals(
            {role: parts[role][at] for role in roles}, units, chosen, wanted, request, at, total
        )
        for at in order
    ]
    segments[0] = segments[0]._replace(notes=(*assumed, *segments[0].notes))
    if total > 1:
        said = (
            f"{first.source}: it holds {in_words(lengths, apart)}; each is a recording of its own."
        )
        segments[0] = segments[0]._replace(notes=(said, *segments[0].notes))
    unused = tuple(
        f"{table.source}, {said.place}: {said.text}"
        for table in dict.fromkeys(tables.values())
        for said in table.unused
    )
    return Segments(segments, lengths, apart, unused)


def _groups(tables: Mapping[str, Table], roles: list[str]) -> list[tuple[Table, list[str]]]:
    """Each table with the roles it has to fill."""
    if len({id(table) for table in tables.values()}) == 1:
        return [(tables[roles[0]], roles)]
    return [(tables[role], [role]) for role in roles]


def _require_lengths(
    tables: Mapping[str, Table], chosen: Mapping[str, tuple[int, int | None]]
) -> None:
    """Raise `InputError` where columns differ in length and no clocks bring them together."""
    abouts = {}
    for role, (column, time) in chosen.items():
        table = tables[role]
        abouts[role] = table.about(column)
        if time is not None and table.about(time).length != abouts[role].length:
            raise unequal({role: (table, column), "time": (table, time)})
    alike = len({about.length for about in abouts.values()}) == 1
    timed = all(time is not None for _, time in chosen.values())
    started = all(about.start is not None for about in abouts.values())
    rates = {about.clocks for about in abouts.values()}
    own_rates = len(rates) > 1 and all(rates)
    if not (alike or timed or started or own_rates):
        raise unequal({role: (tables[role], column) for role, (column, _) in chosen.items()})


def _length(clock: Clock) -> float:
    return float(clock.times[-1] - clock.times[0] + clock.step)


def _apart(clocks: list[Clock]) -> list[float | None]:
    """The gaps [s] between clocks that follow one another, None where one begins anew."""
    steps = [float(later.times[0] - earlier.times[-1]) for earlier, later in pairwise(clocks)]
    return [step if step > 0 else None for step in steps]


def _signals(
    parts: dict[str, Part],
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
        for factor in part.table.about(part.column).scales if role not in request.scales else ():
            label = f"{part.table.source}, {column_label(part.table.names, part.column)}"
            notes.append(f"{label}: {factor.place} of {factor.text} was not applied.")
    for role, part in parts.items():
        read = [part.column, chosen[role][1]]
        notes += [part.table.about(at).note for at in read if at is not None]
    bad: dict[str, np.ndarray] = {}
    parts = on_one_zero(parts)
    for role, part in parts.items():
        times = part.clock.times - part.clock.times[0]
        lost = ~np.isfinite(part.values)
        allowed = within(request.mask, times, part.clock.step)
        require_masked(part.table, part.column, part.rows, part.values, allowed, times)
        bad[role] = with_spikes(request.mask, part.values, lost) if role == "output" else lost
    if wanted is None:
        parts, cuts, alignment_notes = aligned(parts, source)
        bad = {role: each[cuts[role]] for role, each in bad.items()}
        notes += alignment_notes
        samples = {role: part.values for role, part in parts.items()}
        masked = np.logical_or.reduce(list(bad.values()))
        step = next(iter(parts.values())).clock.step
        notes += notes_on_parts(parts, bad)
        began = _began(next(iter(parts.values())).clock)
    else:
        notes += notes_on_parts(parts, bad)
        channels = {
            role: Channel(part.values, part.clock, bad[role]) for role, part in parts.items()
        }
        together = resampled(channels, wanted, source)
        samples, masked, step = together.samples, together.bad, 1 / wanted
        notes.append(together.note)
        starts = [start for part in parts.values() if (start := _began(part.clock)) is not None]
        began = max(starts) if len(starts) == len(parts) else None
    scaled = {
        role: values * units[role].scale + units[role].offset
        if (units[role].scale, units[role].offset) != (1.0, 0.0)
        else values
        for role, values in samples.items()
    }
    taken: dict[str, str | int] = {}
    for role, part in parts.items():
        names = part.table.names
        time = chosen[role][1]
        if time is not None:
            taken.setdefault("time", names[time] if names else time)
        taken[role] = names[part.column] if names else part.column
    told_units = {role: units[role].name for role in parts}
    kept = tuple(dict.fromkeys(note for note in notes if note))
    masked = masked if masked.any() else None
    return Signals(scaled, told_units, step, masked, source, kept, taken, began)


def _began(clock: Clock) -> float | None:
    """When the first sample of a clock was taken [s since 1970, or since its column's zero], None
    where its file does not say."""
    if not clock.states_start:
        return None
    return (clock.start or 0) / 1e9 + float(clock.times[0])


def notes_on_parts(parts: dict[str, Part], bad: dict[str, np.ndarray]) -> list[str]:
    """The notes on samples that are left out."""
    notes: list[str] = []
    for role, part in parts.items():
        if bad[role].any():
            times = part.clock.times - part.clock.times[0]
            notes.append(note_on(part.table, role, part.column, bad[role], times))
    return notes
