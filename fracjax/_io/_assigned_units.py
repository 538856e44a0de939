"""The unit of each chosen column: stated by the file or by the call, else none."""

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from fracjax._io._declared import declared_units, title_of
from fracjax._io._table import SIGNALS, Stated, Table, column_label
from fracjax._io._units import (
    contradicts,
    factored,
    is_unknowable,
    likely,
    of_capitals,
    readable,
    titled,
    unread,
)
from fracjax._recording import UNSTATED, InputError, conversion, unit

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_EXAMPLES = {"time": "s, ms or us", "input": "V, mV or A", "output": "um, mm, V or N"}


_MULTIPLE = re.compile(
    r"[*×]\s*\d|(?<!\w)[\d.]+\s*[*×]|\bx\s?10+\b|\b10+\s?x\b"
    r"|\d\s*[^\W\d]+\s*=\s*[\d.]|(?<!\w)[\d.]+\s*[^\W\d]+\s*(?:/|per)\s*[^\W\d]|/\s*10+\b"
)
"""A factor in a name, of which nobody knows whether it is in the numbers."""


class Scale(NamedTuple):
    """What brings the numbers in a file to a quantity: that times a factor, and an offset."""

    factor: float
    offset: float
    unit: str


_SCALE = re.compile(
    rf"\s*(?:[^\W\d]+\s*[*×·]\s*)?({_NUMBER})\s*([-+]\s*{_NUMBER})?\s*([^\d\s].*?)?\s*"
)


def scale_of(text: str, where: str) -> Scale:
    """What a call says of counts, such as "counts*0.0305 mV" or "counts*0.005 - 10 V".

    Raises InputError where it says anything else.
    """
    parts = _SCALE.fullmatch(text)
    name = re.sub(r"/(count|counts|lsb|bit|digit)s?$", "", parts[3] or "") if parts else ""
    if parts is None or not float(parts[1]) or (name and readable(name) is None):
        raise InputError.at(where, 'such as "drive=counts*0.0305 mV"', f'"{text}"', "correct it")
    offset = float((parts[2] or "0").replace(" ", ""))
    return Scale(float(parts[1]), offset, readable(name) or "" if name else "")


class Unit(NamedTuple):
    """The unit of a column."""

    name: str
    scale: float
    """What brings the column's numbers to it."""
    note: str = ""
    offset: float = 0.0
    is_stated: bool = True


def option_for(role: str, unit: str) -> str:
    """The option that states a unit."""
    return f"--clock {unit}" if role == "time" else f"--unit {SIGNALS[role]}={unit}"


def unit_of(
    table: Table, role: str, column: int, stated: str | None, scale: Scale | None = None
) -> Unit:
    """The unit of a column in its role; `stated` and `scale`, what the call says.

    What the call states is what the numbers come out in: they are converted where the file states
    another unit of the same kind, unless it states several.

    Raises InputError for a unit that is not understood, cannot be that of what the name speaks of,
    or contradicts the call or another of the file; and for counts with a factor beside them.
    """
    name = titled(title_of(table, column)).name
    place = f"{table.source}, {column_label(table.names, column)}"
    if scale is not None:
        raw_unit = scale.unit or stated or UNSTATED[SIGNALS[role]]
        wanted = _of_call(stated or raw_unit, role, table.source, name)
        factor = conversion(raw_unit, wanted)
        if factor is None:
            raise InputError.at(
                f"{table.source}, --scale", f"a unit like {wanted}", raw_unit, "correct it"
            )
        return Unit(wanted, scale.factor * factor, "", scale.offset * factor)
    declared = _in_case(table, role, column, stated)
    places = {read.text: read for read in declared if readable(read.text)}
    distinct = dict.fromkeys(unit(readable(text) or "") for text in places)
    wanted = None if stated is None else _of_call(stated, role, table.source, name)
    if wanted is not None and unit(wanted) in distinct and len(distinct) > 1:
        return Unit(wanted, 1.0)
    if len(distinct) > 1:
        units = [next(t for t in places if unit(readable(t) or "") == each) for each in distinct]
        raise InputError.at(
            place,
            "one unit",
            " and ".join(f'"{text}" in {places[text].place}' for text in units),
            f"give {' or '.join(option_for(role, readable(text) or text) for text in units)}",
        )
    written = declared[0].text if declared else ""
    if wanted is None and _MULTIPLE.search(name):
        one = "ms or --clock s" if role == "time" else readable(written) or "V"
        raise InputError.at(
            place,
            "a name without a factor",
            f'"{name}"',
            f"give {option_for(role, one)}, the unit of the numbers in the file",
        )
    counts = factored(written, of_time=role == "time") if not places else None
    if counts is not None:
        to = conversion(counts[1], wanted or counts[1])
        if to is not None:
            note = f'{place}: its numbers were taken in "{written}", as {declared[0].place} says.'
            return Unit(wanted or counts[1], counts[0] * to, note)
    read = readable(written) if written else None
    if wanted is None:
        if not written:
            none = "s" if role == "time" else UNSTATED[SIGNALS[role]]
            words = unread(title_of(table, column))
            note = f'{place}: "{words}" is no unit that is known, and none was taken.'
            if not words and re.search(r"[\W_]in$", title_of(table, column)):
                words, note = "in", f'{place}: "in" may be inches or an input, and none was taken.'
            return Unit(none, 1.0, note if words else "", is_stated=False)
        if read is None:
            raise InputError.at(
                place,
                f"a unit such as {_EXAMPLES[role]}",
                f'"{written}"',
                f"give {option_for(role, _EXAMPLES[role].split(',')[0])}, or what it is",
            )
        if contradicts(name, read):
            option = option_for(role, likely(name, read))
            remedy = f"give {option}, or what it is, or another column as --{role}"
            raise InputError.at(place, f'a unit of what "{name}" speaks of', f'"{read}"', remedy)
        return Unit(read, 1.0)
    if not written or (read is not None and unit(read) == unit(wanted)):
        return Unit(wanted, 1.0)
    if read is None or role == "time":
        note = f'{place}: {wanted} was used as given, though {declared[0].place} says "{written}".'
        return Unit(wanted, 1.0, note)
    factor = conversion(read, wanted)
    if factor is None:
        raise InputError.at(
            place,
            f'a unit of the same kind as "{written}", which {declared[0].place} says',
            f'"{stated}" in the call',
            "correct it, or the file",
        )
    return Unit(wanted, factor, f"{place}: converted from {written} to {wanted} as given.")


def _in_case(table: Table, role: str, column: int, stated: str | None) -> list[Stated]:
    """The units that the file states of a column, those in capitals as what they mean.

    Raises InputError for one that may mean two units, where the call does not say which.
    """
    title, declared = title_of(table, column), []
    for each in declared_units(table, column):
        meant = of_capitals(title, each.text)
        if len(meant) > 1 and stated is None:
            raise InputError.at(
                f"{table.source}, {column_label(table.names, column)}",
                "a unit in capitals and small letters",
                f'"{each.text}" in a header of capitals alone',
                f"give {' or '.join(option_for(role, unit) for unit in meant)}",
            )
        if not is_unknowable(each.text):
            declared.append(each._replace(text=meant[0]) if len(meant) == 1 else each)
    return declared if stated is None else [e for e in declared if not of_capitals(title, e.text)]


def _of_call(stated: str, role: str, source: str, name: str) -> str:
    place = f"{source}, {option_for(role, stated)}"
    wanted = readable(stated)
    if wanted is None:
        unit(stated, place)
        wanted = stated
    if contradicts(name, wanted):
        raise InputError.at(
            place, f'a unit of what "{name}" speaks of', f'"{wanted}"', "correct it"
        )
    return wanted


def require_scaled(
    tables: Mapping[str, Table], columns: Mapping[str, int], scales: Mapping[str, Scale]
) -> None:
    """Raise `InputError` for whole numbers beside which a factor stands that is not in them."""
    counts = {
        role: table.about(columns[role])
        for role, table in tables.items()
        if role not in scales and table.about(columns[role]).scales
    }
    counts = {role: about for role, about in counts.items() if _are_whole(about.numbers)}
    if not counts:
        return
    options = []
    for role, about in counts.items():
        first = about.scales[0].text
        numbers = [float(number) for number in re.findall(_NUMBER, first)]
        *offset, factor = numbers if len(numbers) == 2 else numbers[:1] or [1.0]
        written = re.search(r"([^\W\d]+)\s*(?:/|per)", first)
        unit = written[1] if written and readable(written[1]) else ""
        unit = unit or readable(next((each.text for each in about.units), "-")) or ""
        shift = f" {offset[0]:+g}" if offset and offset[0] else ""
        options.append((SIGNALS[role], f"{factor:g}{shift} {unit}".strip(), unit))
    role, about = next(iter(counts.items()))
    scaled = " ".join(f'--scale "{signal}=counts*{factor}"' for signal, factor, _ in options)
    plain = " ".join(f'--scale "{signal}=counts*1 {unit}"' for signal, _, unit in options)
    table = tables[role]
    raise InputError.at(
        f"{table.source}, {column_label(table.names, columns[role])}",
        "values of a quantity",
        f"whole numbers, beside which {about.scales[0].place} states {about.scales[0].text}",
        f"give {scaled} if they are counts, or {plain} if that is in them",
    )


def _are_whole(values: np.ndarray) -> bool:
    finite = values[np.isfinite(values)]
    return bool(np.all(finite == np.round(finite)))
