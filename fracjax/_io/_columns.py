"""Which column is the time, the drive and the response, and what unit each is written in."""

import re
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from fracjax._recording import InputError, Recording, parse_quantity, require_samples, unit

_WORDS = {
    "time": {"time", "t", "zeit"},
    "input": {"drive", "voltage", "volt", "volts", "input", "command", "excitation", "u"},
    "output": {"response", "output", "displacement", "disp", "position", "pos", "deflection"}
    | {"stroke", "extension", "force", "x", "y"},
}
_KINDS = {"time": ("s",), "input": ("V", "A"), "output": ("m", "N")}
"""What units point to a role where no name does."""
_ASSUMED = {"time": "s", "input": "V", "output": "um"}
_UNIFORM = 1e-3
"""Largest departure of a step from the median step, and of a rate from the time column's."""

_WITH_UNIT = (
    re.compile(r"(.*?)[\s_]*[\[(]\s*([^\])]*?)\s*[\])]"),
    re.compile(r"(.*?)\s+/\s+(\S+)"),
    re.compile(r"(.*)_([numkµμ]?[VAmNs]|sec|microns?|volts?)"),
)


class Table(Protocol):
    """What the reader of a format hands over: columns, named or not, and where they stand."""

    @property
    def source(self) -> str:
        """The file, as messages name it."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """The column names, empty where the file has none."""
        ...

    @property
    def width(self) -> int:
        """How many columns there are."""
        ...

    def numbers(self, column: int) -> np.ndarray:
        """Column `column`, shape (N,), float64; `InputError` where a cell is no finite number."""
        ...

    def place(self, row: int, column: int) -> str:
        """Where a cell stands, such as `loop.csv, line 17, column "voltage_V"`."""
        ...


def column_label(names: tuple[str, ...], column: int) -> str:
    """What messages call a column: its name, or its index from 0 where it has none."""
    return f'column "{names[column]}"' if names else f"column {column}"


def recording(
    table: Table,
    columns: Mapping[str, str | int | None],
    *,
    rate: str | float | None,
    units: Mapping[str, str | None],
) -> Recording:
    """The recording in a table.

    **Arguments:** `columns`, name or index of the time, input and output column where the call
    gives it; `rate` [Hz]; `units` of input and output, likewise.

    **Raises:** `InputError` for a column or rate that is missing, ambiguous or contradictory, an
    unknown unit, a time that does not run in uniform steps, or a signal no `Recording` takes.
    """
    signals, step, told = _signals(table, columns, rate, units)
    drive, response = signals["input"], signals["output"]
    return Recording(
        drive,
        response,
        step,
        told["input"][0],
        told["output"][0],
        table.source,
        tuple(note for _, note in told.values() if note),
    )


def drive(
    table: Table,
    columns: Mapping[str, str | int | None],
    *,
    rate: str | float | None,
    unit: str | None,
) -> tuple[np.ndarray, float, str]:
    """The drive of a table, its step [s] and its unit; the table need not hold a response.

    **Arguments** and **raises:** as `recording`, `columns` for time and input only.
    """
    signals, step, told = _signals(table, columns, rate, {"input": unit})
    return signals["input"], step, told["input"][0]


def _signals(
    table: Table,
    columns: Mapping[str, str | int | None],
    rate: str | float | None,
    units: Mapping[str, str | None],
) -> tuple[dict[str, np.ndarray], float, dict[str, tuple[str, str]]]:
    """The signals by role, their step [s], and each role's unit with a note on it."""
    hertz = None if rate is None else _rate(table, rate)
    chosen = _choose(table, columns)
    told = {role: _unit(table, role, column, units.get(role)) for role, column in chosen.items()}
    signals = {role: table.numbers(column) for role, column in chosen.items() if role != "time"}
    require_samples(len(signals["input"]), table.source)
    if "time" in chosen:
        step = _step_of_time(table, chosen["time"], told["time"][0], hertz)
    else:
        step = _step_of_rate(table, hertz)
    return signals, step, told


# Columns ------------------------------------------------------------------------------------------


def _choose(table: Table, columns: Mapping[str, str | int | None]) -> dict[str, int]:
    """The index of each role's column: as given, else by name and unit, else by position."""
    chosen = {role: _given(table, role, key) for role, key in columns.items() if key is not None}
    if table.names:
        for role in columns:
            free = [c for c in range(table.width) if c not in chosen.values()]
            if role not in chosen and (column := _recognised(table, role, free)) is not None:
                chosen[role] = column
    elif not chosen:
        chosen = _by_position(table, [role for role in columns if role != "time"])
    missing = [role for role in columns if role != "time" and role not in chosen]
    if missing:
        options = " and ".join(f"--{role}" for role in missing)
        raise InputError.at(
            table.source,
            f"columns for {' and '.join(missing)}",
            _listing(table),
            f"give {options} as a name or an index from 0",
        )
    if len(set(chosen.values())) < len(chosen):
        told = ", ".join(f"--{role} {column}" for role, column in chosen.items())
        raise InputError.at(
            table.source, "a column of its own for each", told, "give different columns"
        )
    return chosen


def _given(table: Table, role: str, key: str | int) -> int:
    """The index of the column that the call names, by name or index from 0."""
    named = [column for column, name in enumerate(table.names) if name == key]
    if len(named) == 1:
        return named[0]
    if not named and str(key) in map(str, range(table.width)):
        return int(key)
    raise InputError.at(
        table.source,
        f'one column "{key}"' if named else f'a column "{key}"',
        _listing(table),
        f"give --{role} as a name or an index from 0 to {table.width - 1}",
    )


def _recognised(table: Table, role: str, free: list[int]) -> int | None:
    """The one free column whose name, else whose unit, speaks of the role; None without any."""
    parts = {column: _split(table.names[column]) for column in free}
    by_name = [column for column in free if _roles(parts[column][0]) == {role}]
    by_unit = [c for c in free if not _roles(parts[c][0]) and _points_to(parts[c][1], role)]
    found = by_name or by_unit
    if len(found) > 1:
        several = ", ".join(f'"{table.names[column]}"' for column in found)
        raise InputError.at(
            table.source, f"one column for {role}", several, f"choose one with --{role}"
        )
    return found[0] if found else None


def _by_position(table: Table, signals: Sequence[str]) -> dict[str, int]:
    """The signals, such as drive and response, in a nameless file of just them, or after a time.

    Nothing where neither fits.
    """
    if table.width == len(signals):
        return {role: column for column, role in enumerate(signals)}
    if table.width == len(signals) + 1:
        steps = np.diff(table.numbers(0))
        if len(steps) and _uniform(steps).all():
            return {role: column for column, role in enumerate(("time", *signals))}
    return {}


def _listing(table: Table) -> str:
    """The columns there are, in words."""
    if not table.names:
        return f"{table.width} column(s) without names"
    return f"{table.width} column(s): " + ", ".join(f'"{name}"' for name in table.names)


# Names and units ----------------------------------------------------------------------------------


def _split(name: str) -> tuple[str, str]:
    """A column's name without its unit, and the unit as written, empty where there is none."""
    for pattern in _WITH_UNIT:
        if parts := pattern.fullmatch(name):
            return parts[1], parts[2]
    return name, ""


def _roles(name: str) -> set[str]:
    """The roles that the words of a name speak of."""
    words = set(re.split(r"[\W_]+", name.casefold()))
    return {role for role, known in _WORDS.items() if words & known}


def _points_to(text: str, role: str) -> bool:
    """Whether a unit as written is of a kind that points to the role."""
    try:
        return any(unit(text).is_compatible_with(kind) for kind in _KINDS[role])
    except InputError:
        return False


def _unit(table: Table, role: str, column: int, stated: str | None) -> tuple[str, str]:
    """A column's unit, as the call states it, as its name does, or assumed; and a note on that."""
    written = _split(table.names[column])[1] if table.names else ""
    place = f"{table.source}, {column_label(table.names, column)}"
    if stated is None and not written:
        return _ASSUMED[role], f"{place}: no unit is written, {_ASSUMED[role]} was assumed."
    if stated is None:
        unit(written, place)
        return written, ""
    unit(stated, f"{table.source}, --{role}-unit")
    if written in ("", stated):
        return stated, ""
    return stated, f'{place}: {stated} was used as told, though the name says "{written}".'


# Time ---------------------------------------------------------------------------------------------


def _uniform(steps: np.ndarray) -> np.ndarray:
    """Which of the steps, shape (N - 1,), are positive and agree with their median."""
    usual = np.median(steps)
    return (steps > 0) & (np.abs(steps - usual) <= _UNIFORM * usual)


def _rate(table: Table, rate: str | float) -> float:
    """The sampling rate [Hz] that the call gives."""
    hertz = parse_quantity(rate, "Hz", f"{table.source}, --rate")
    if hertz <= 0:
        raise InputError.at(
            f"{table.source}, --rate", "a positive rate", f'"{rate}"', "give one such as 200Hz"
        )
    return hertz


def _step_of_rate(table: Table, rate: float | None) -> float:
    """The step [s] of a table without a time column, by its rate [Hz]."""
    if rate is None:
        raise InputError.at(
            table.source,
            "a time column or a rate",
            f"neither in {_listing(table)}",
            "give --rate such as 200Hz, or --time as a name or an index from 0",
        )
    return 1 / rate


def _step_of_time(table: Table, column: int, written: str, rate: float | None) -> float:
    """The step [s] of a time column, which is uniform and agrees with the rate [Hz], if any."""
    label = f"{table.source}, {column_label(table.names, column)}"
    second = parse_quantity(f"1 {written}", "s", label)
    times = table.numbers(column)
    steps = np.diff(times)
    wrong = ~_uniform(steps)
    if wrong.any():
        row = int(wrong.argmax()) + 1
        before, now = times[row - 1 : row + 1]
        expected, remedy = "time to increase", "correct or delete that line"
        if now > before:
            expected = f"a step of {np.median(steps):.6g} {written}"
            remedy = "resample it to a uniform step first"
        raise InputError.at(
            table.place(row, column), expected, f"{now:.9g} after {before:.9g}", remedy
        )
    step = second * float(times[-1] - times[0]) / len(steps)
    if rate is not None and abs(step * rate - 1) > _UNIFORM:
        raise InputError.at(
            label, f"a step of {1 / rate:g} s by --rate", f"{step:g} s", "leave out --rate"
        )
    return step
