"""Units, by pint, and quantities written with them."""

import math
import re
import threading
from functools import lru_cache
from typing import Any

import pint

from fracjax._recording._errors import InputError

_NUMBER = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*", re.DOTALL | re.ASCII
)
_LETTER = "A-Za-zµμΩΩÅÅ"
_FACTOR = rf"[{_LETTER}][{_LETTER}0-9_]*((\*\*|\^)-?[0-9]|[²³])?"
_UNIT = re.compile(rf"{_FACTOR}(\s*[*/·]\s*{_FACTOR})*|[%°]")

_ONE_AT_A_TIME = threading.Lock()
"""pint reads its definitions on first use; a second thread would find half of them."""


def unit(text: str, where: str = "unit") -> pint.Unit:
    """The unit called `text`, such as "um", "µm", "V", "kHz" or "V/um".

    Raises InputError, placed at `where`, for a unit that pint does not know.
    """
    registry = pint.get_application_registry()
    read = _read(text.strip(), registry, id(registry.get()))
    if read is None:
        raise InputError.at(
            where, "a unit such as um, mm, V, N, s, ms, Hz or kHz", f'"{text}"', "correct the unit"
        )
    return read


@lru_cache(maxsize=1024)
def _read(name: str, registry: Any, version: int) -> pint.Unit | None:
    """The unit called `name` in a registry, None where it has none; kept, as files repeat units.

    `version` is another for another registry behind the application's.
    """
    for spelling in (name, name.lower()):
        try:
            if _UNIT.fullmatch(spelling):
                with _ONE_AT_A_TIME:
                    return registry.Unit(spelling.replace("·", "*"))
        except (pint.PintError, ValueError):
            continue
    return None


def parse_quantity(text: str | float, default: str, where: str = "quantity") -> float:
    """The value of "200 Hz" or "0.07um" in the unit `default`; a plain number is already in it.

    Raises InputError, placed at `where`: no finite number, unknown unit, wrong dimension.
    """
    parts = _NUMBER.fullmatch(str(text))
    if parts is None:
        raise InputError.at(where, f'a value such as "20 {default}"', f'"{text}"', "correct it")
    number, name = float(parts[1]), parts[2] or default
    try:
        written, wanted = unit(name, where), unit(default)
        if written is wanted:
            value = number
        else:
            quantity = pint.get_application_registry().Quantity(number, written)
            value = float(quantity.to(wanted).magnitude)
    except pint.PintError:
        raise InputError.at(
            where, f"a value in {default} or a multiple of it", f'"{text}"', "correct the unit"
        ) from None
    if not math.isfinite(value):
        raise InputError.at(where, "a finite value", f'"{text}"', "correct it")
    return value
