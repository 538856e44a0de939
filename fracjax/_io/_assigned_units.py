"""The unit of each chosen column: stated by the file, by the call, or assumed aloud."""

from typing import NamedTuple

import pint

from fracjax._io._choice import title_of, written_unit
from fracjax._io._table import Table, column_label
from fracjax._io._units import contradicts, readable, titled
from fracjax._io._words import quantity
from fracjax._recording import InputError, unit

_ASSUMED = {
    "time": {None: "s", "time": "s"},
    "input": {None: "V", "voltage": "V"},
    "output": {None: "um", "length": "um"},
}
"""By role and by the quantity that the name speaks of."""
_EXAMPLES = {"time": "s, ms or us", "input": "V, mV or A", "output": "um, mm, V or N"}


class Unit(NamedTuple):
    """The unit of a column."""

    name: str
    scale: float
    """What brings the column's numbers to it."""
    note: str
    is_assumed: bool = False


def unit_of(table: Table, role: str, column: int, stated: str | None) -> Unit:
    """The unit of a column in its role; `stated`, what the call says.

    What the call states is what the numbers come out in: they are converted where the file states
    another unit of the same kind.

    Raises InputError for a unit that is not understood, cannot be that of what the name
    speaks of, or contradicts the call; and where none is written for what is no voltage or
    displacement.
    """
    written = written_unit(table, column)
    name = titled(title_of(table, column)).name
    place = f"{table.source}, {column_label(table.names, column)}"
    read = readable(written) if written else None
    wanted = None if stated is None else _of_call(stated, role, table.source, name)
    if wanted is None:
        if not written:
            return _assumed(role, name, place)
        if read is None:
            raise InputError.at(
                place, f"a unit such as {_EXAMPLES[role]}", f'"{written}"', f"give --{role}-unit"
            )
        _check(place, name, read, f"give --{role}-unit, or another column as --{role}")
        return Unit(read, 1.0, "")
    if not written:
        return Unit(wanted, 1.0, "")
    source = "file" if table.about(column).unit else "name"
    if read is None:
        return Unit(
            wanted,
            1.0,
            f'{place}: {wanted} was used as given, though the {source} says "{written}".',
        )
    if unit(read) == unit(wanted):
        return Unit(wanted, 1.0, "")
    if not unit(wanted).is_compatible_with(unit(read)):
        raise InputError.at(
            place,
            f'a unit of the same kind as "{written}", which the {source} says',
            f'--{role}-unit "{stated}"',
            "correct it, or the file",
        )
    scale = pint.get_application_registry().Quantity(1.0, unit(read)).to(unit(wanted)).magnitude
    return Unit(wanted, float(scale), f"{place}: converted from {written} to {wanted} as given.")


def _of_call(stated: str, role: str, source: str, name: str) -> str:
    wanted = readable(stated)
    if wanted is None:
        unit(stated, f"{source}, --{role}-unit")
        wanted = stated
    _check(f"{source}, --{role}-unit", name, wanted, "correct it")
    return wanted


def _check(place: str, name: str, read: str, remedy: str) -> None:
    if contradicts(name, read):
        raise InputError.at(place, f'a unit of what "{name}" speaks of', f'"{read}"', remedy)


def _assumed(role: str, name: str, place: str) -> Unit:
    spoken = quantity(name)
    units_by_word = _ASSUMED[role]
    if spoken not in units_by_word and spoken not in (None, "counter", "remark"):
        raise InputError.at(
            place, f"a unit such as {_EXAMPLES[role]}", "none", f"give --{role}-unit"
        )
    assumed = units_by_word.get(spoken, units_by_word[None])
    return Unit(assumed, 1.0, f"{place}: no unit is written, {assumed} was assumed.", True)
