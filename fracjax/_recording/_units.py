"""Units and quantities written with them: the common ones by a table, all others by pint.

pint takes .4 s to load, most files hold nothing but V, ms and um.
"""

import re
import threading
from collections.abc import Iterator
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

from fracjax._recording._errors import InputError

UNSTATED = {"drive": "drive units", "response": "response units"}
"""The unit of a signal of which nobody said one: it is that of no other quantity."""

_NUMBER = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*", re.DOTALL | re.ASCII
)
_LETTER = "A-Za-zµμΩΩÅÅ"
_NONE = "|".join(UNSTATED.values())
_FACTOR = rf"(?:{_NONE}|[{_LETTER}][{_LETTER}0-9_]*(?:(?:\*\*|\^)-?[0-9]|[²³])?)"
_UNIT = re.compile(rf"(?:1\s*/\s*)?{_FACTOR}(?:\s*[*/·]\s*{_FACTOR})*|[%°]")
_PART = re.compile(
    r"([*/·]?)\s*(drive units|response units|1|[^\W\d][^\W\d_]*)((?:\*\*|\^)-?\d)?\s*"
)
_PREFIXES = {"": 0, "p": -12, "n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "k": 3, "M": 6, "G": 9}
_SYMBOLS: dict[str, tuple[int, dict[str, int]]] = {
    "s": (0, {"second": 1}),
    "Hz": (0, {"second": -1}),
    "m": (0, {"meter": 1}),
    "A": (0, {"ampere": 1}),
    "C": (0, {"ampere": 1, "second": 1}),
    "V": (0, {"kilogram": 1, "meter": 2, "second": -3, "ampere": -1}),
    "N": (0, {"kilogram": 1, "meter": 1, "second": -2}),
    "Pa": (0, {"kilogram": 1, "meter": -1, "second": -2}),
    "J": (0, {"kilogram": 1, "meter": 2, "second": -2}),
    "W": (0, {"kilogram": 1, "meter": 2, "second": -3}),
    "T": (0, {"kilogram": 1, "second": -2, "ampere": -1}),
    "rad": (0, {"radian": 1}),
}
"""By symbol, the power of ten and the base units, as pint calls them; a test holds them to pint."""
_SIMPLE = {
    f"{prefix}{symbol}": (power + ten, base)
    for symbol, (ten, base) in _SYMBOLS.items()
    for prefix, power in _PREFIXES.items()
} | {name: (0, {name: 1}) for name in UNSTATED.values()}
_SIMPLE |= {f"{prefix}Nm": (power, _SYMBOLS["J"][1]) for prefix, power in _PREFIXES.items()}
PREFIXED = frozenset(_SIMPLE)
"""The common units with their prefixes."""

_ONE_AT_A_TIME = threading.Lock()
"""pint reads its definitions on first use; a second thread would find half of them."""


class Unit(NamedTuple):
    """A unit: how much of its base units it is."""

    scale: Fraction
    base: frozenset[tuple[str, Fraction]]
    """Base units and their powers."""

    def is_compatible_with(self, other: "Unit") -> bool:
        """Whether one can be converted to the other."""
        return self.base == other.base


def unit(text: str, where: str = "unit") -> Unit:
    """The unit called `text`, such as "um", "µm", "V", "kHz" or "V/um".

    Raises InputError, placed at `where`, for a unit that pint does not know.
    """
    read = _simple(text.strip()) or _by_pint(text.strip())
    if read is None:
        raise InputError.at(
            where, "a unit such as um, mm, V, N, s, ms, Hz or kHz", f'"{text}"', "correct the unit"
        )
    return read


def conversion(written: str, wanted: str) -> float | None:
    """What brings numbers from one unit to another; None where they measure different things.

    Raises InputError for a unit that pint does not know.
    """
    one, other = unit(written), unit(wanted)
    return float(one.scale / other.scale) if one.is_compatible_with(other) else None


@lru_cache(maxsize=1024)
def _simple(name: str) -> Unit | None:
    """A product of units of the table; None where some factor is not in it."""
    scale, powers, end = Fraction(1), dict[str, int](), 0
    for part in _PART.finditer(name):
        if part.start() != end or (end == 0) == bool(part[1]):
            return None
        end = part.end()
        if part[2] == "1" and not part[3]:
            continue
        if part[2] not in _SIMPLE:
            return None
        power = int((part[3] or "1").lstrip("*^")) * (-1 if part[1] == "/" else 1)
        ten, base = _SIMPLE[part[2]]
        scale *= Fraction(10) ** (ten * power)
        for each, exponent in base.items():
            powers[each] = powers.get(each, 0) + exponent * power
    if end < len(name) or name == "1" or not name:
        return None
    return Unit(scale, frozenset((each, Fraction(p)) for each, p in powers.items() if p))


def _by_pint(name: str) -> Unit | None:
    """Any other unit, None where pint has none."""
    if not any(_UNIT.fullmatch(spelling) for spelling in _spellings(name)):
        return None
    import pint

    registry = pint.get_application_registry()
    return _read(name, registry, id(registry.get()))


def _spellings(name: str) -> Iterator[str]:
    """A name, and in small letters where these can mean nothing else: Nm is no nm."""
    alike = sum(each.lower() == name.lower() for each in PREFIXED)
    return iter((name, name.lower()) if alike < 2 else (name,))


@lru_cache(maxsize=1024)
def _read(name: str, registry: Any, version: int) -> Unit | None:
    """The unit called `name` in a registry, None where it has none; kept, as files repeat units.

    `version` is another for another registry behind the application's.
    """
    import pint

    for spelling in _spellings(name):
        text = re.sub(r"^1\s*/", "dimensionless/", spelling.replace("·", "*"))
        try:
            if _UNIT.fullmatch(spelling):
                with _ONE_AT_A_TIME:
                    scale, base = registry.get_base_units(registry.Unit(text), check_nonmult=False)
                    return Unit(
                        Fraction(str(scale)),
                        frozenset((each, Fraction(str(p))) for each, p in base._units.items()),
                    )
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
    name = parts[2] or default
    written, wanted = unit(name, where), unit(default)
    if not written.is_compatible_with(wanted):
        remedy = "correct the unit"
        for signal, unstated in UNSTATED.items():
            if unstated in default:
                remedy = f"leave its unit out, or say with --unit {signal}=UNIT what the file is in"
        raise InputError.at(where, f"a value in {default} or a multiple of it", f'"{text}"', remedy)
    try:
        return float(Fraction(parts[1]) * written.scale / wanted.scale)
    except OverflowError:
        raise InputError.at(where, "a finite value", f'"{text}"', "correct it") from None
