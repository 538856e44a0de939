"""A column of times as stamps that lose no digit: exact, of two columns, of counters that wrap."""

import re
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fracjax._io._assigned_units import Unit, unit_of
from fracjax._io._declared import finer_column, written_unit
from fracjax._io._segments import segments_of_times, usual_step
from fracjax._io._table import Table, column_label
from fracjax._io._units import readable
from fracjax._recording import InputError, conversion, parse_quantity, unit

_LOST = 1e-5
"""Largest share of a step that the digits of a float64 may round away."""
_CLOSE = 0.01
"""Largest departure of the step across a wrap from the usual one, or one count."""
_BITS = (16, 24, 32, 8)
_CYCLES = (1, 60, 3600, 86400)
"""[s] after which counters within a second, minute, hour or day begin anew."""


class Stamps(NamedTuple):
    """When samples were taken."""

    values: np.ndarray
    """(N,), in the unit, from `zero`."""
    unit: Unit
    zero: Fraction = Fraction(0)
    """[s]"""
    notes: tuple[str, ...] = ()

    @property
    def second(self) -> float:
        """What brings the values to seconds."""
        return conversion(self.unit.name, "s") or 1.0


def stamps_of(table: Table, time: int, stated: str | None, wrap: str | None) -> Stamps:
    """The stamps of a column of times; `stated`, the unit that the call gives; `wrap`, after how
    many counts or which time it begins anew, "none" for never.

    Raises InputError for a unit that is none of time, or a wrap that does not fit.
    """
    about = table.about(time)
    label = f"{table.source}, {column_label(table.names, time)}"
    own = unit_of(table, "time", time, stated)
    if about.stamps:
        own = Unit("s", 1.0)
    elif not unit(own.name).is_compatible_with(unit("s")):
        raise InputError.at(label, "a time", f'a column in "{own.name}"', "give another as --time")
    if own.scale != 1.0:
        return Stamps(about.numbers * own.scale, own._replace(scale=1.0))
    stamps = _exact(Stamps(about.numbers, own), table, time)
    stamps = _with_finer(stamps, table, time)
    stamps = _of_one_unit(stamps, label)
    return _unwrapped(stamps, label, wrap, whole=bool(_are_whole(stamps.values)))


def _are_whole(values: np.ndarray) -> np.bool_:
    return np.all(values == np.round(values))


def _exact(stamps: Stamps, table: Table, time: int) -> Stamps:
    """The stamps from the first on, where a float64 would lose digits of their differences."""
    about, values = table.about(time), stamps.values
    if about.exact is None or len(values) < 2 or not np.isfinite(values).all():
        return stamps
    step = abs(float(values[-1] - values[0])) / len(values)
    if np.spacing(np.abs(values).max()) <= _LOST * step or (exact := about.exact()) is None:
        return stamps
    scale = Fraction(unit(stamps.unit.name).scale)
    return stamps._replace(values=exact.rest, zero=exact.first * scale)


def _with_finer(stamps: Stamps, table: Table, time: int) -> Stamps:
    """Whole seconds, or dates, with the column of their fractions added: nanoseconds, or
    milliseconds."""
    values = stamps.values
    if not np.isfinite(values).all() or not _are_whole(values * stamps.second):
        return stamps
    fine = finer_column(table, time)
    if fine is None:
        return stamps
    name = readable(written_unit(table, fine)) or "s"
    parts = table.about(fine).numbers * (conversion(name, "s") or 0.0)
    note = (
        f"{table.source}: the time is {column_label(table.names, time)} and the part of a second "
        f"in {column_label(table.names, fine)}."
    )
    first = values[0] * stamps.second
    zero = stamps.zero
    if not table.about(time).stamps:
        # Whole seconds since 1970 would take the digits of the fractions.
        zero, values = zero + Fraction(first), values - values[0]
    return Stamps(values * stamps.second + parts, Unit("s", 1.0), zero, (*stamps.notes, note))


def _of_one_unit(stamps: Stamps, label: str) -> Stamps:
    """Stamps whose unit changes within the column, as of a clock that is shown by its size."""
    values = stamps.values
    if not np.isfinite(values).all():
        return stamps
    steps = np.diff(values)
    if not len(steps) or steps.min() > 0.01 * steps.max() > 0:
        return stamps
    rows = segments_of_times(values)
    if len(rows) < 2:
        return stamps
    usual = [usual_step(np.diff(values[each])) for each in rows]
    ratios = [each / usual[0] if usual[0] else 1.0 for each in usual]
    powers = [3 * round(np.log10(ratio) / 3) if ratio > 0 else 0 for ratio in ratios]
    if not any(powers) or any(
        abs(ratio / 10.0**power - 1) > _CLOSE for ratio, power in zip(ratios, powers, strict=True)
    ):
        return stamps
    one = np.concatenate([values[e] / 10.0**p for e, p in zip(rows, powers, strict=True)])
    steps = np.diff(one)
    if np.abs(steps - usual[0]).max() > _CLOSE * usual[0]:
        changed = next(e.start for e, power in zip(rows, powers, strict=True) if power)
        raise InputError.at(
            label,
            "stamps in one unit",
            f"steps of {usual[0]:g}, and of {10.0 ** max(powers, key=abs) * usual[0]:g} from "
            f"sample {changed} on",
            "bring them to one unit, or delete the column and give --rate",
        )
    note = f"{label}: its unit changes within the column; all were brought to that of the first."
    return stamps._replace(values=one, notes=(*stamps.notes, note))


def _unwrapped(stamps: Stamps, label: str, wrap: str | None, *, whole: bool) -> Stamps:
    """Stamps of a counter that begins anew when it is full, counted on."""
    values = stamps.values
    if wrap == "none" or len(values) < 2 or not np.isfinite(values).all():
        return stamps
    steps = np.diff(values)
    back = steps < 0
    if not back.any():
        return stamps
    usual = usual_step(steps)
    full = [_full(wrap, stamps, label)] if wrap is not None else _sizes(stamps, whole)
    for size in full:
        closing = steps[back] + size
        tolerance = max(_CLOSE * usual, 1.0 if whole else 0.0)
        if np.ptp(values) <= size and (np.abs(closing - usual) <= tolerance).all():
            note = (
                f"{label}: it begins anew {np.count_nonzero(back)} time(s) after {size:.10g} and "
                "was counted on as one recording; give --wrap none where these are recordings of "
                "their own."
            )
            turns = np.concatenate([[0], np.cumsum(back)])
            return stamps._replace(values=values + size * turns, notes=(*stamps.notes, note))
    if wrap is not None:
        row = int(back.argmax()) + 1
        raise InputError.at(
            f"{label}, --wrap {wrap}",
            f"steps of {usual:g} where it begins anew",
            f"{values[row]:g} after {values[row - 1]:g}",
            "leave it out, or give --wrap none",
        )
    return stamps


def _full(wrap: str, stamps: Stamps, label: str) -> float:
    """What a call says that a counter holds: a number of bits, or a time."""
    if re.fullmatch(r"\s*\d+\s*", wrap):
        return 2.0 ** int(wrap)
    return parse_quantity(wrap, "s", f"{label}, --wrap") / stamps.second


def _sizes(stamps: Stamps, whole: bool) -> list[float]:
    """What a counter may hold: its bits, or of times a second, a minute, an hour or a day.

    Decimals that begin with a cycle may be recordings of that length instead.
    """
    cycles = [seconds / stamps.second for seconds in _CYCLES] if stamps.unit.is_stated else []
    if whole:
        return [*(2.0**bits for bits in _BITS), *cycles]
    first = stamps.values[0]
    restart = stamps.values[1:][np.diff(stamps.values) < 0][0]
    return cycles if first - restart > usual_step(np.diff(stamps.values)) else []
