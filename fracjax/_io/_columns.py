"""Which column is the time, the drive and the response, and what unit each is written in."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from fracjax._io._table import Table, column_label, quoted
from fracjax._io._time import clock_of_rate, clock_of_time, is_time, rate_of, resampled
from fracjax._recording import InputError, Recording, require_samples, unit

_WORDS = {
    "time": {"time", "t", "zeit"},
    "input": {"drive", "voltage", "volt", "volts", "input", "command", "excitation", "u"},
    "output": {"response", "output", "displacement", "disp", "position", "pos", "deflection"}
    | {"stroke", "extension", "force", "x", "y"},
}
_KINDS = {"time": ("s",), "input": ("V", "A"), "output": ("m", "N")}
"""What units point to a role where no name does."""
_ASSUMED = {"time": "s", "input": "V", "output": "um"}
_ROLES = ("input", "output", "time")
_LISTED = 12

_WITH_UNIT = (
    re.compile(r"(.*?)[\s_]*[\[(]\s*([^\])]*?)\s*[\])]"),
    re.compile(r"(.*?)\s+/\s+(\S+)"),
    re.compile(r"(.*)_([numkµμ]?[VAmNs]|sec|microns?|volts?)"),
)


class _Signals(NamedTuple):
    """The chosen columns of a table."""

    samples: dict[str, np.ndarray]
    units: dict[str, str]
    """By role, that of the time included."""
    step: float
    """[s]"""
    notes: tuple[str, ...]
    columns: dict[str, str | int]
    """By role, the column's name, or its index from 0 where it has none."""


def recording(
    table: Table,
    columns: Mapping[str, str | int | None],
    *,
    rate: str | float | None,
    units: Mapping[str, str | None],
    resample: str | float | None,
) -> tuple[Recording, dict[str, str | int]]:
    """The recording in a table, and by role its columns: the name, or the index from 0.

    **Arguments:** `columns`, name or index of the time, input and output column where the call
    gives it; `rate` [Hz]; `units` of input and output, likewise; `resample`, the rate [Hz] to
    interpolate to.

    **Raises:** `InputError` for a column or rate that is missing, ambiguous or contradictory, an
    unknown unit, columns of unequal length, a time that does not run in uniform steps (with
    `resample`, that does not increase), or a signal no `Recording` takes.
    """
    samples, told, step, notes, taken = _signals(table, columns, rate, units, resample)
    drive, response = samples["input"], samples["output"]
    units_told = told["input"], told["output"]
    return Recording(drive, response, step, *units_told, table.source, notes), taken


def drive(
    table: Table,
    columns: Mapping[str, str | int | None],
    *,
    rate: str | float | None,
    unit: str | None,
    resample: str | float | None,
) -> tuple[np.ndarray, float, str]:
    """The drive of a table, its step [s] and its unit; the table need not hold a response.

    **Arguments** and **raises:** as `recording`, `columns` for time and input only.
    """
    found = _signals(table, columns, rate, {"input": unit}, resample)
    return found.samples["input"], found.step, found.units["input"]


def response(
    table: Table,
    columns: Mapping[str, str | int | None],
    *,
    rate: str | float | None,
    unit: str | None,
    resample: str | float | None,
) -> tuple[np.ndarray, float, str]:
    """The response of a table, its step [s] and its unit; the table need not hold a drive.

    **Arguments** and **raises:** as `recording`, `columns` for time and output only.
    """
    found = _signals(table, columns, rate, {"output": unit}, resample)
    return found.samples["output"], found.step, found.units["output"]


def _signals(
    table: Table,
    columns: Mapping[str, str | int | None],
    rate: str | float | None,
    units: Mapping[str, str | None],
    resample: str | float | None,
) -> _Signals:
    """The signals by role, in uniform steps."""
    hertz = None if rate is None else rate_of(rate, f"{table.source}, --rate")
    wanted = None if resample is None else rate_of(resample, f"{table.source}, --resample")
    chosen = _choose(table, columns)
    told = {role: _unit(table, role, column, units.get(role)) for role, column in chosen.items()}
    samples = {role: table.numbers(column) for role, column in chosen.items() if role != "time"}
    count = len(next(iter(samples.values())))
    require_samples(count, table.source)
    units_told = {role: unit for role, (unit, _) in told.items()}
    if "time" in chosen:
        time, second = chosen["time"], units_told["time"]
        clock = clock_of_time(table, time, second, hertz, uniform=wanted is None)
    else:
        clock = clock_of_rate(table, chosen.values(), count, hertz, _listing(table))
    notes = [note for _, note in told.values()]
    notes += [table.about(column).note for column in chosen.values()] + [clock.note]
    step = clock.step
    if wanted is not None:
        samples, bridged = resampled(clock, samples, wanted, table.source)
        notes, step = [*notes, bridged], 1 / wanted
    taken = {role: table.names[at] if table.names else at for role, at in chosen.items()}
    return _Signals(samples, units_told, step, tuple(note for note in notes if note), taken)


# Columns ------------------------------------------------------------------------------------------


def _choose(table: Table, columns: Mapping[str, str | int | None]) -> dict[str, int]:
    """The index of each role's column: as given, else by name and unit, else by position."""
    chosen = {role: _given(table, role, key) for role, key in columns.items() if key is not None}
    if not table.names and not chosen:
        chosen = _by_position(table, [role for role in columns if role != "time"])
    _require_usable(table, chosen)
    if table.names:
        for role in (role for role in _ROLES if role in columns and role not in chosen):
            if (column := _recognised(table, role, _free(table, chosen))) is not None:
                chosen[role] = column
    signals = [role for role in columns if role != "time"]
    missing = [role for role in signals if role not in chosen]
    if missing:
        options = " and ".join(f"--{role}" for role in missing)
        remedy = f"give {options} as a name or an index from 0"
        if table.width < len(signals):
            remedy = f"put {' and '.join(signals)} into one file, such as an .npz"
        raise InputError.at(
            table.source, f"columns for {' and '.join(missing)}", _listing(table), remedy
        )
    return {role: chosen[role] for role in columns if role in chosen}


def _require_usable(table: Table, chosen: Mapping[str, int]) -> None:
    """Raise `InputError` unless each role has real numbers of its own, all of one length."""
    for role, column in chosen.items():
        if fault := table.about(column).fault:
            raise InputError.at(
                f"{table.source}, {column_label(table.names, column)}",
                "real numbers",
                fault,
                f"give another column as --{role}",
            )
    if len(set(chosen.values())) < len(chosen):
        told = ", ".join(f"--{role} {column}" for role, column in chosen.items())
        raise InputError.at(
            table.source, "a column of its own for each", told, "give different columns"
        )
    lengths = {column: table.about(column).length for column in chosen.values()}
    if len(set(lengths.values())) > 1:
        told = " and ".join(
            f"{length} of {column_label(table.names, column)}" for column, length in lengths.items()
        )
        raise InputError.at(
            table.source, "as many samples in each column", told, "choose columns of one length"
        )


def _free(table: Table, chosen: Mapping[str, int]) -> list[int]:
    """The columns that may join the chosen ones: real numbers, and as long."""
    lengths = {table.about(column).length for column in chosen.values()}
    free = (column for column in range(table.width) if column not in chosen.values())
    return [
        column
        for column in free
        if not (about := table.about(column)).fault and (not lengths or about.length in lengths)
    ]


def _given(table: Table, role: str, key: str | int) -> int:
    """The index of the column that the call names: by name, its last parts, or index from 0."""
    named = [column for column, name in enumerate(table.names) if name == key]
    named = named or [c for c, name in enumerate(table.names) if name.endswith(f"/{key}")]
    if not named and str(key) in map(str, range(table.width)):
        named = [int(key)]
    if len(named) != 1:
        raise InputError.at(
            table.source,
            f'one column "{key}"' if named else f'a column "{key}"',
            _listing(table),
            f"give --{role} as a name or an index from 0 to {table.width - 1}",
        )
    return named[0]


def _recognised(table: Table, role: str, free: list[int]) -> int | None:
    """The one free column whose name, else whose unit, speaks of the role; None without any."""
    by_name = [column for column in free if _roles(_name(table, column)) == {role}]
    by_unit = [
        column
        for column in free
        if not _roles(_name(table, column)) and _points_to(_written(table, column), role)
    ]
    found = by_name or by_unit
    if len(found) > 1:
        raise InputError.at(
            table.source,
            f"one column for {role}",
            _enumerated([quoted(table.names[column]) for column in found]),
            f"choose one with --{role}",
        )
    return found[0] if found else None


def _by_position(table: Table, signals: Sequence[str]) -> dict[str, int]:
    """The signals, such as drive and response, in a nameless file of just them, or after a time.

    Nothing where neither fits.
    """
    if table.width == len(signals):
        return {role: column for column, role in enumerate(signals)}
    if table.width == len(signals) + 1 and 0 in _free(table, {}) and is_time(table.numbers(0)):
        return {role: column for column, role in enumerate(("time", *signals))}
    return {}


def _listing(table: Table) -> str:
    """The columns there are, in words, with their lengths where these differ."""
    if not table.names:
        return f"{table.width} column(s) without names"
    known = [table.about(column) for column in range(table.width)]
    alike = len({about.length for about in known}) == 1
    told = [
        quoted(name)
        + ("" if alike else f" of {about.length}")
        + (f" ({about.fault})" if about.fault else "")
        for name, about in zip(table.names, known, strict=True)
    ]
    return f"{table.width} column(s): {_enumerated(told)}"


def _enumerated(items: Sequence[str]) -> str:
    """The items, or the first of many."""
    more = f" and {len(items) - _LISTED} more" if len(items) > _LISTED else ""
    return ", ".join(items[:_LISTED]) + more


# Names and units ----------------------------------------------------------------------------------


def _split(name: str) -> tuple[str, str]:
    """A column's name without its unit and indices, and the unit as written, or nothing."""
    name = re.sub(r"(\.\d+)+$", "", name)
    for pattern in _WITH_UNIT:
        if parts := pattern.fullmatch(name):
            return parts[1], parts[2]
    return name, ""


def _name(table: Table, column: int) -> str:
    """A column's name without its unit."""
    return _split(table.names[column])[0]


def _written(table: Table, column: int) -> str:
    """A column's unit as the file states it, beside the column or in its name; else nothing."""
    return table.about(column).unit or (_split(table.names[column])[1] if table.names else "")


def _roles(name: str) -> set[str]:
    """The roles that the last part of a path speaks of, else all of it."""

    def spoken(text: str) -> set[str]:
        words = set(re.split(r"[\W_]+", text.casefold()))
        return {role for role, known in _WORDS.items() if words & known}

    return spoken(name.rpartition("/")[2]) or spoken(name)


def _points_to(text: str, role: str) -> bool:
    """Whether a unit as written is of a kind that points to the role."""
    try:
        return any(unit(text).is_compatible_with(kind) for kind in _KINDS[role])
    except InputError:
        return False


def _unit(table: Table, role: str, column: int, stated: str | None) -> tuple[str, str]:
    """A column's unit, as the call states it, as its name does, or assumed; and a note on that."""
    written = _written(table, column)
    place = f"{table.source}, {column_label(table.names, column)}"
    if stated is None and not written:
        return _ASSUMED[role], f"{place}: no unit is written, {_ASSUMED[role]} was assumed."
    if stated is None and role == "time":
        return written, ""
    if stated is None:
        try:
            unit(written)
        except InputError:
            raise InputError.at(
                place, "a unit such as um, mm, V or N", f'"{written}"', f"give --{role}-unit"
            ) from None
        return written, ""
    unit(stated, f"{table.source}, --{role}-unit")
    if written in ("", stated):
        return stated, ""
    source = "file" if table.about(column).unit else "name"
    return stated, f'{place}: {stated} was used as told, though the {source} says "{written}".'
