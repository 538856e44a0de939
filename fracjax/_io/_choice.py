"""Which column is the time, the drive and the response."""

import shlex
from collections.abc import Collection, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fracjax._io._declared import finer_column, title_of, written_unit
from fracjax._io._even import filled, is_counter, is_time
from fracjax._io._table import Table, column_key, column_label, enumerated, quoted
from fracjax._io._units import is_compatible, readable, titled
from fracjax._io._words import is_command, is_direction, quantity, role_of, role_of_letter
from fracjax._recording import MINIMUM_SAMPLES, InputError

_KINDS = {
    "time": ("s",),
    "input": ("V", "A", "V/m", "A/m"),
    "output": ("m", "N", "rad", "C", "C/m**2", "T"),
}
"""What units point to a role where no name does."""


class Chosen(NamedTuple):
    """The columns that were chosen."""

    signals: dict[str, int]
    """By role, "input" and "output"."""
    times: dict[str, int]
    """By role, that of its time; none where there is no such column."""
    note: str = ""
    """What was assumed of columns that nothing names."""


def choose(
    table: Table,
    columns: Mapping[str, str | int | None],
    *,
    has_rate: bool,
    stated: Collection[str] = (),
) -> Chosen:
    """The columns of each role: as given, else by name and unit, else by position.

    `columns`: name or index by role where the call gives it; `has_rate`, whether it
    gives a rate, so that a column may count samples; `stated`, the roles whose unit it gives.

    Raises InputError for a column that is missing, ambiguous or holds no numbers.
    """
    _require_one_kind(table)
    chosen = {role: _given(table, role, key) for role, key in columns.items() if key is not None}
    signals = [role for role in columns if role != "time"]
    note = ""
    if not chosen and (not table.names or _is_one_matrix(table)):
        chosen = _by_position(table, signals, has_rate)
        note = _assumed_order(table, signals, chosen) if len(signals) > 1 and chosen else ""
    _require_usable(table, chosen)
    if table.names:
        for role in signals:
            if role not in chosen and (column := _recognised(table, role, chosen)) is not None:
                chosen[role] = column
        _take_the_last(table, signals, chosen, stated)
    missing = [role for role in signals if role not in chosen]
    if missing:
        raise _nothing_for(table, missing, chosen)
    picked = {role: chosen[role] for role in signals}
    if "time" in chosen:
        return Chosen(picked, dict.fromkeys(signals, chosen["time"]), note)
    times = {role: _time_for(table, column, picked) for role, column in picked.items()}
    return Chosen(picked, {role: at for role, at in times.items() if at is not None}, note)


def listing(table: Table) -> str:
    """The columns there are, in words, with their lengths where these differ."""
    columns = [table.about(column) for column in range(table.width)]
    if not table.names:
        faults = {about.fault for about in columns}
        fault = f" ({faults.pop()})" if len(faults) == 1 and "" not in faults else ""
        return f"{table.width} column(s) without names{fault}"
    alike = len({about.length for about in columns}) == 1
    labels = [
        quoted(name or "")
        + ("" if alike else f" of {about.length}")
        + (f" ({about.fault})" if about.fault else "")
        for name, about in zip(table.names, columns, strict=True)
    ]
    return f"{table.width} column(s): {enumerated(labels)}"


def role(table: Table, column: int) -> str | None:
    """The role that a column's name speaks of: its own, else words of the path to it.

    Where "Sequence" stands for a unit, samples are counted.
    """
    unit = table.about(column).unit
    if len(unit) > 2 and quantity(unit) == "counter":
        return "counter"
    name = titled(title_of(table, column)).name
    own = role_of(name)
    opposite = {"input": "output", "output": "input"}.get(own or "")
    if opposite and is_direction(name) and _points_to(written_unit(table, column), opposite):
        # The output of an amplifier is the actuator's input: that is for the call to say.
        return "other"
    if own is not None or not table.names:
        return own
    path = table.names[column].rpartition("/")[0]
    return role_of(path.replace("/", " ")) if path else None


def _points_to(text: str, role: str) -> bool:
    """Whether a unit as written is of a kind that points to the role."""
    read = readable(text) if text else None
    return read is not None and is_compatible(read, *_KINDS[role])


def _speaks_of(table: Table, column: int, wanted: str) -> bool:
    """Whether a column is of the role by its unit, its name saying nothing."""
    return role(table, column) is None and _points_to(written_unit(table, column), wanted)


def _letter(table: Table, column: int) -> str | None:
    """The role of a letter, where neither words nor the unit say another."""
    unit = written_unit(table, column)
    if role(table, column) is not None or any(_points_to(unit, each) for each in _KINDS):
        return None
    return role_of_letter(titled(title_of(table, column)).name)


def _usable(table: Table, chosen: Mapping[str, int]) -> list[int]:
    """The columns that may join the chosen ones: real numbers, and none chosen."""
    free = (column for column in range(table.width) if column not in chosen.values())
    return [column for column in free if not table.about(column).fault]


def _fitting(table: Table, column: int, chosen: Mapping[str, int]) -> bool:
    """Whether a column may stand beside the chosen ones: as long, or with a clock of its own."""
    about = table.about(column)
    others = [table.about(each) for each in chosen.values()]
    return all(
        about.length == other.length
        or bool(about.clocks and other.clocks)
        or about.start is not None
        for other in others
    )


def _require_usable(table: Table, chosen: Mapping[str, int]) -> None:
    """Raise `InputError` unless each role has real numbers of its own."""
    for role, column in chosen.items():
        about = table.about(column)
        if fault := about.fault or ("dates" if about.stamps and role != "time" else ""):
            raise InputError.at(
                f"{table.source}, {column_label(table.names, column)}",
                "real numbers",
                fault,
                about.remedy or f"give another column as --{role}",
            )
    if len(set(chosen.values())) < len(chosen):
        options = ", ".join(f"--{role} {column}" for role, column in chosen.items())
        raise InputError.at(
            table.source, "a column of its own for each", options, "give different columns"
        )


def _given(table: Table, role: str, key: str | int) -> int:
    """The index of the column that the call names: by name, its last parts, or index from 0."""
    named = [column for column, name in enumerate(table.names) if name == key]
    named = named or [c for c, name in enumerate(table.names) if name.endswith(f"/{key}")]
    named = named or [c for c in range(table.width) if key and title_of(table, c) == key]
    if not named and isinstance(key, str):
        named = [c for c in range(table.width) if titled(title_of(table, c)).name == key]
    if not named and str(key) in map(str, range(table.width)):
        named = [int(key)]
    if len(named) != 1:
        raise InputError.at(
            table.source,
            f'one column "{key}"' if named else f'a column "{key}"',
            listing(table),
            f"give --{role} as a name or an index from 0 to {table.width - 1}",
        )
    return named[0]


def _recognised(table: Table, wanted: str, chosen: Mapping[str, int]) -> int | None:
    """The one free column whose name, else whose unit, speaks of the role; None without any."""
    free = [c for c in _usable(table, chosen) if _fitting(table, c, chosen)]
    free = [c for c in free if not table.about(c).stamps]
    candidates = [c for c in free if role(table, c) == wanted]
    if wanted == "input" and candidates and all(is_command(table.names[c]) for c in candidates):
        # Behind a command its amplifier may be measured as well.
        candidates += [c for c in free if _speaks_of(table, c, wanted)]
    candidates = candidates or [c for c in free if _speaks_of(table, c, wanted)]
    candidates = candidates or [c for c in free if _letter(table, c) == wanted]
    if len(candidates) > 1:
        first, *others = (table.numbers(c) for c in candidates)
        alike = all(np.array_equal(first, each, equal_nan=True) for each in others)
        ways = f"give --{wanted} " + f" or --{wanted} ".join(
            column_key(table.names, c) for c in candidates[:3]
        )
        others = {"input", "output"} - {wanted, *chosen}
        rest = [c for c in free if c not in candidates and role(table, c) in (None, *others)]
        rest = [c for c in rest if not (is_time(table.numbers(c)) or _speaks_of(table, c, "time"))]
        if others and not rest and len(candidates) == 2:
            ways = f"give {_each_way(table, ['input', 'output'], candidates)}"
        raise InputError.at(
            table.source,
            f"one column for {wanted}",
            enumerated(
                [f"{quoted(table.names[c])} {_thumbnail(table.numbers(c))}" for c in candidates]
            )
            + (", the same sample by sample" if alike else ""),
            ways,
        )
    return candidates[0] if candidates else None


def _thumbnail(values: np.ndarray) -> str:
    """How a signal runs, in a few characters, and from where to where."""
    shown = values[np.linspace(0, len(values) - 1, min(len(values), 160)).astype(int)]
    shown = np.nan_to_num(shown[np.isfinite(shown)])
    if not shown.size or np.ptp(shown) == 0:
        return "(constant)"
    levels = np.interp(
        np.linspace(0, len(shown) - 1, 24),
        np.arange(len(shown)),
        (shown - shown.min()) / np.ptp(shown),
    )
    line = "".join("▁▂▃▄▅▆▇█"[int(7.999 * level)] for level in levels)
    return f"({line} {np.nanmin(values):.4g} to {np.nanmax(values):.4g})"


def _take_the_last(
    table: Table, signals: list[str], chosen: dict[str, int], stated: Collection[str]
) -> None:
    """Add the one remaining column beside the time and the other signal, if its unit is stated."""
    missing = [role for role in signals if role not in chosen]
    if len(missing) != 1 or len(signals) < 2 or not any(role in chosen for role in signals):
        return
    rest = [
        column
        for column in _usable(table, chosen)
        if _fitting(table, column, chosen)
        and not table.about(column).stamps
        and (role(table, column) in (None, missing[0]) or _is_of_motion(table, column))
        and not any(_points_to(written_unit(table, column), each) for each in ("time", *chosen))
    ]
    if len(rest) == 1 and (missing[0] in stated or readable(written_unit(table, rest[0]) or "?")):
        chosen[missing[0]] = rest[0]


def _is_of_motion(table: Table, column: int) -> bool:
    return quantity(titled(title_of(table, column)).name) in ("speed", "acceleration")


_KINDS_OF_ROWS = 8


def _require_one_kind(table: Table) -> None:
    """Raise `InputError` where rows of several kinds stand in turn, as a word in each says."""
    for at, about in enumerate(table.columns):
        if about.texts is None or about.fault != "text" or about.length < 2 * MINIMUM_SAMPLES:
            continue
        cells = [f"{cell}".strip() for cell in about.texts()]
        words = dict.fromkeys(cells)
        turns = sum(a != b for a, b in pairwise(cells))
        if not 1 < len(words) <= _KINDS_OF_ROWS or turns < len(cells) / 10 or "" in words:
            continue
        parts = " and ".join(
            f"grep -F {shlex.quote(word)} {shlex.quote(table.source)} > {number}.csv"
            for number, word in enumerate(words, 1)
        )
        raise InputError.at(
            f"{table.source}, {column_label(table.names, at)}",
            "rows of one kind",
            f"{len(words)} in turn, {', '.join(map(quoted, words))}",
            f"part them ({parts}) and give --drive 1.csv --response 2.csv",
        )


def _is_one_matrix(table: Table) -> bool:
    """Whether all columns are those of one nameless matrix, such as a To File block writes."""
    stems = {name.rpartition(".")[0] for name in table.names}
    indexed = all(name.rpartition(".")[2].isdigit() for name in table.names)
    return indexed and len(stems) == 1 and not any(role(table, c) for c in range(table.width))


def _by_position(table: Table, signals: list[str], has_rate: bool) -> dict[str, int]:
    """The signals, such as drive and response, in a nameless file of just them, or after a time.

    Nothing where neither fits.
    """
    usable = _usable(table, {})
    stamps = [column for column in usable if table.about(column).stamps]
    if len(usable) == len(signals) + 1 and usable[0] in stamps:
        return dict(zip(("time", *signals), usable, strict=True))
    if not usable or stamps or len({table.about(c).length for c in usable}) > 1:
        return {}
    runs = is_time(first := table.numbers(usable[0]))
    if len(usable) == len(signals) + 1 and runs:
        # What counts 0, 1, 2 may count samples or seconds.
        counts = is_counter(first) and (has_rate or bool(table.about(usable[0]).clocks))
        roles = (*signals,) if counts else ("time", *signals)
        return dict(zip(roles, usable[1:] if counts else usable, strict=True))
    if len(usable) == len(signals) and not (runs and len(signals) > 1):
        return dict(zip(signals, usable, strict=True))
    return {}


def _assumed_order(table: Table, signals: list[str], chosen: Mapping[str, int]) -> str:
    """What is said of columns that were taken in order, and how to take them in the other."""
    first, second = (chosen[role] for role in signals)
    return (
        f"{table.source}: nothing names the columns, so {first} was taken for the drive and "
        f"{second} for the response; if it is the other way round, give --input {second} and "
        f"--output {first}."
    )


def _nothing_for(table: Table, missing: list[str], chosen: Mapping[str, int]) -> InputError:
    """The refusal of a table in which signals were not recognised."""
    options = " and ".join(f"--{role}" for role in missing)
    remedy = f"give {options} as a name or an index from 0"
    usable = [c for c in _usable(table, chosen) if not table.about(c).stamps]
    cures = [cure for c in range(table.width) if (cure := table.about(c).remedy)]
    alone = [c for c in usable if role(table, c) not in ("time", "counter", "other")]
    if not alone and len(missing) == 1:
        alone = [c for c in usable if _points_to(written_unit(table, c), missing[0])]
    both = {"input": "--drive", "output": "--response"}
    # A column that runs in even steps, of a name that says nothing, is hardly a signal.
    runs = [c for c in alone if len(alone) == len(missing) + 1 and is_time(table.numbers(c))]
    alone = [c for c in alone if c not in runs] if len(runs) == 1 else alone
    if len(alone) == len(missing):
        time = f"--time {column_key(table.names, runs[0])} and " if len(runs) == 1 else ""
        remedy = f"give {time}{_each_way(table, missing, alone, time)}"
    timed = any(role(table, c) == "time" or _speaks_of(table, c, "time") for c in usable)
    if len(missing) == 2 and not timed and any(_are_frequencies(table, c) for c in usable):
        shown = shlex.quote(table.source)
        remedy = (
            f"fit it as what it is: fracjax fit {shown} --model 'gain >> resonance' "
            "--frequency-response"
        )
    elif cures and len(usable) < len(missing):
        remedy = cures[0]
    elif table.width < len(missing):
        names = " and ".join(missing)
        remedy = (
            f"put {names} into one file, such as an .npz, or give two as --drive and --response"
        )
    elif len(missing) == 1 and not alone:
        other = both["input" if missing[0] == "output" else "output"]
        remedy += f", or this file as {other} and that of the other as {both[missing[0]]}"
    elif (
        len(missing) == 2
        and len(usable) == 2
        and not table.names
        and is_time(table.numbers(usable[0]))
    ):
        return InputError.at(
            table.source,
            "a drive and a response",
            f"one signal (column {usable[1]}) beside its time (column {usable[0]})",
            "give the files of both as --drive FILE and --response FILE",
        )
    elif len(missing) == 2 and len(alone) < 2:
        remedy += ", or the files of both as --drive and --response"
    return InputError.at(
        table.source, f"columns for {' and '.join(missing)}", listing(table), remedy
    )


def _are_frequencies(table: Table, column: int) -> bool:
    """Whether a column is that of a frequency response: frequencies that rise."""
    read = readable(written_unit(table, column) or "")
    if read is None or not is_compatible(read, "Hz"):
        return False
    return bool((np.diff(table.numbers(column)) > 0).all())


def _each_way(table: Table, missing: list[str], columns: list[int], time: str = "") -> str:
    """The options that take as many columns as signals are missing, in either order; `time`, the
    option for the time, which the second way repeats."""
    names = [column_key(table.names, c) for c in columns]
    orders = [names] if len(names) == 1 else [names, names[::-1]]
    return f", or {time}".join(
        " and ".join(f"--{role} {name}" for role, name in zip(missing, order, strict=True))
        for order in orders
    )


def _time_for(table: Table, signal: int, signals: Mapping[str, int]) -> int | None:
    """The time of a signal: the one column of times that is as long, the nearest by its path."""
    if not table.names and not any(table.about(c).stamps for c in range(table.width)):
        return None
    length = table.about(signal).length
    free = [c for c in _usable(table, signals) if table.about(c).length == length]
    named = [c for c in free if table.about(c).stamps or role(table, c) == "time"]
    candidates = named or [c for c in free if _speaks_of(table, c, "time")]
    if len(candidates) > 1:
        shared = {c: _shared(table.names[c], table.names[signal]) for c in candidates}
        candidates = [c for c in candidates if shared[c] == max(shared.values())]
    if len(candidates) > 1:
        candidates = [c for c in candidates if finer_column(table, c) is not None] or candidates
    if len(candidates) > 1:
        running = [c for c in candidates if is_time(filled(table.numbers(c)))]
        if not running and table.about(signal).clocks:
            return None
        candidates = running or candidates
    if len(candidates) > 1:
        first = table.numbers(candidates[0])
        preceding = [column for column in candidates if column < signal]
        if (
            preceding
            and candidates[0] < min(signals.values())
            and _are_in_turn(candidates, signals)
        ):
            return preceding[-1]
        if any(
            written_unit(table, c) != written_unit(table, candidates[0]) for c in candidates
        ) or not all(np.array_equal(first, table.numbers(c)) for c in candidates[1:]):
            raise InputError.at(
                table.source,
                "one column for time",
                enumerated([quoted(table.names[c]) for c in candidates]),
                "choose one with --time",
            )
    return candidates[0] if candidates else None


def _are_in_turn(times: list[int], signals: Mapping[str, int]) -> bool:
    """Whether between any two signals a time stands, as in X1, Y1, X2, Y2."""
    ends = sorted(signals.values())
    return all(any(a < time < b for time in times) for a, b in pairwise(ends))


def _shared(path: str, other: str) -> int:
    """How many groups two paths have in common."""
    pairs = zip(path.split("/")[:-1], other.split("/")[:-1], strict=False)
    count = 0
    for one, two in pairs:
        if one != two:
            break
        count += 1
    return count
