"""Units as files write them: in other scripts and spellings, in a name, or in their own row."""

import re
import unicodedata
from functools import lru_cache
from typing import NamedTuple

from fracjax._io._lexicon import WORDS, by_word
from fracjax._io._words import quantity
from fracjax._recording import PREFIXED, InputError, unit

_CANONICAL = by_word("spellings")
_CLOCKS = by_word("clocks")
FOREIGN_UNITS = frozenset(w for w in _CANONICAL if not w.isascii() and len(w) > 1)
_MISREAD = frozenset(WORDS["units"]["misread"])
_UNKNOWABLE = frozenset(WORDS["units"]["unknowable"])
_PREFIX = "(?:[pnumcdkMGµμ]?)"
_PLAIN = (
    rf"(?:{_PREFIX}(?:V|A|m|s|Nm|N|Hz|C|Pa|rad|W|F|T|g|J|eV|Wb)|secs?|(?:nano|micro|milli)?seconds?|[mun]secs?|mins?|hours?"
    r"|volts?|microns?|micrometers?|micrometres?|nanometers?|nanometres?|millimeters?|inch|mils?"
    r"|deg|degrees?|mdeg|arcsec|newtons?|bar|amps?|ohm|Ω|%|ppm|ustrain|microstrain)"
)
_POWER = r"(?:\*\*-?\d|\^-?\d|-?\d)?"
_WEAK = re.compile(rf"{_PLAIN}{_POWER}(?:\s*[*/·]\s*{_PLAIN}{_POWER})*")
_PAIRS = ("[]", "()", "（）", "【】", "〔〕", "{}", "<>", "〈〉", "［］")
_BRACKETS = re.compile(
    "|".join(rf"\{a}\s*([^\{a}\{b}]*?)\s*\{b}" for a, b in (tuple(pair) for pair in _PAIRS))
)
_BEHIND = re.compile(r"(.+?)(?:\s*/\s*|\s*[,，;:]\s*|\s+in\s+|\s+)([^\s/].*)")
_CAMEL = re.compile(r"([A-Za-z]*[a-z])([A-Z][A-Za-z]?)")
_OF_CAMEL = {
    text.lower(): text for text in ("ms", "us", "ns", "nm", "um", "mm", "mV", "kV", "V", "N")
}
_NOTHING = frozenset(("", "-", "--", "none", "n/a", "1", "[]", "()"))
_ELECTRICAL = ("V", "A")
_DIMENSIONS = {
    "time": ("s",),
    "voltage": ("V",),
    "current": ("A",),
    "length": ("m", "rad"),
    "force": ("N",),
    "charge": ("C", "C/m**2"),
    "angle": ("rad", "m"),
    "frequency": ("Hz",),
    "speed": ("m/s", "rad/s"),
    "acceleration": ("m/s**2",),
    "temperature": ("K",),
    "strain": ("%",),
    "counter": (),
}
_SIGNALS = WORDS["units"]["recorded"]
"""Kinds of units that are recorded."""


class Titled(NamedTuple):
    """A name taken apart."""

    name: str
    """Without its unit."""
    unit: str
    """As written; empty where none is."""


def readable(text: str) -> str | None:
    """The unit as `unit` takes it, as written where that will do; None where nobody knows it."""
    return _readable(text.strip())


@lru_cache(maxsize=512)
def _readable(text: str) -> str | None:
    if is_unknowable(text):
        return None
    if text.casefold() in _MISREAD:
        return _CANONICAL[text.casefold()]
    for spelling in (text, *_respelled(text)):
        try:
            unit(spelling)
        except InputError:
            continue
        return spelling
    return None


def _respelled(text: str) -> list[str]:
    """Other spellings of the same: foreign words, powers written on, characters of one width."""
    plain = text.replace("$", "").replace("\\mu", "u")  # as LaTeX writes $\\mu$m
    plain = unicodedata.normalize("NFKC", plain).strip().replace("−", "-").replace("μ", "u")
    plain = re.sub(r"^[\[({<]\s*(.*?)\s*[\])}>]$", r"\1", plain)
    powers = re.sub(r"([A-Za-zµΩ])\s*\^?\s*(-[1-4]|[2-4])(?![\d.])", r"\1**\2", plain)
    powers = re.sub(r"\s*[·⋅∙×]\s*|(?<=[\w)])\s+(?=[A-Za-zµΩ])", "*", powers)
    word = _CANONICAL.get(text.casefold()) or _CANONICAL.get(plain.casefold(), "")
    parts = [_CANONICAL.get(part.strip().casefold(), part) for part in plain.split("/")]
    return [each for each in (word, plain, powers, "/".join(parts)) if each]


_COUNT = r"(?:counts?|cts?|lsb|bits?|digits?)"
_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_FACTORED = re.compile(
    rf"(?:1?\s*{_COUNT}\s*=\s*(?P<each>{_NUMBER})|(?P<per>{_NUMBER})(?=.*/\s*{_COUNT}$)"
    rf"|[×x]?\s*10\s*(?:\^|\*\*)\s*(?P<power>-?\d+)|1\s*/\s*(?P<part>\d+)|[×x]?\s*1(?P<ten>[eE]-?\d+)"
    rf"|(?P<plain>{_NUMBER}))\s*[*·×]?\s*(?P<unit>[^\W\d]+?)(?:\s*/\s*{_COUNT})?",
    re.IGNORECASE,
)


@lru_cache(maxsize=512)
def factored(text: str, *, of_time: bool = False) -> tuple[float, str] | None:
    """A number and a unit that stand for a unit, such as `1/100 mm`, `10^-6 m` or `5 nm/count`.

    Of times any number is one, as in `0.2 ms`; of a signal `10 V` may be its range.
    """
    parts = _FACTORED.fullmatch(unicodedata.normalize("NFKC", text).replace("−", "-").strip())
    read = readable(parts["unit"]) if parts else None
    if parts is None or read is None or (parts["plain"] and not of_time):
        return None
    if parts["power"]:
        return 10.0 ** int(parts["power"]), read
    if parts["part"]:
        return 1 / int(parts["part"]), read
    ten = f"1{parts['ten']}" if parts["ten"] else None
    return float(parts["each"] or parts["per"] or ten or parts["plain"]), read


def of_capitals(title: str, written: str) -> list[str]:
    """What a unit may mean in a header of capitals alone, where case says nothing: MV is mV or MV.

    Nothing of any other header. Nobody records in megametres or megaseconds.
    """
    if written == "Ms":
        return ["Ms", "ms"]
    if not (title.isupper() and written.isupper() and len(re.findall(r"[^\W\d_]", title)) > 4):
        return []
    fitting = cased(title, written)
    return fitting if fitting != [written] else []


def likely(name: str, written: str) -> str:
    """A unit of what a name speaks of, where the written one is of something else: the one that is
    spelled alike, else a usual one; empty where the name speaks of nothing."""
    return [*cased(name, written), *_DIMENSIONS.get(quantity(name) or "", ()), ""][0]


def cased(title: str, written: str) -> list[str]:
    """The common units that differ from a written one at most by capitals, and may be that of what
    a name speaks of."""
    kinds = _DIMENSIONS.get(quantity(title) or "", ()) or _SIGNALS
    low = written.casefold()
    spellings = {spelling for spelling in PREFIXED if spelling.casefold() == low}
    return [s for s in sorted(spellings - {"Mm", "Ms"}) if is_compatible(s, *kinds)]


@lru_cache(maxsize=1024)
def is_compatible(read: str, *kinds: str) -> bool:
    """Whether a unit is one of the same quantity as any of some others."""
    return any(unit(read).is_compatible_with(unit(kind)) for kind in kinds)


@lru_cache(maxsize=512)
def is_unit(text: str) -> bool:
    """Whether a cell of its own is a unit of something that is recorded, or says there is none."""
    inner = re.sub(r"^[\[(（【{<]\s*(.*?)\s*[\])）】}>]$", r"\1", text.strip())
    if inner.casefold() in _NOTHING:
        return True
    read = readable(inner)
    return read is not None and is_compatible(read, *_SIGNALS)


@lru_cache(maxsize=1024)
def is_spelled_unit(text: str) -> bool:
    """Whether a word in a sentence is a unit and hardly anything else."""
    if not _WEAK.fullmatch(text) and (text.isascii() or text.casefold() not in _CANONICAL):
        return False
    return is_unit(text) and text.casefold() not in _NOTHING


@lru_cache(maxsize=512)
def stripped(text: str) -> str:
    """A cell of a row of units without its brackets; empty where it says that there is none."""
    inner = re.sub(r"^[\[(（【{<]\s*(.*?)\s*[\])）】}>]$", r"\1", text.strip())
    return "" if inner.casefold() in _NOTHING else inner


@lru_cache(maxsize=1024)
def titled(title: str) -> Titled:
    """A column's name without its unit and indices, and the unit as written, or nothing.

    In brackets a unit counts as one, and anything else as none.  Behind a stroke, a comma, "in", a
    blank or an underscore it counts where it is one and agrees with what the name speaks of; and
    where the name speaks of a quantity and the rest is no word but a unit nobody knows.
    """
    title = re.sub(r"(\.\d+)+$", "", title).strip()
    for match in reversed([*_BRACKETS.finditer(title)]):
        inner = match[match.lastindex or 0]
        name = f"{title[: match.start()]} {title[match.end() :]}".strip(" _")
        if inner and (
            readable(inner) is not None
            or is_unknowable(inner)
            or of_capitals(title, inner)
            or factored(inner, of_time=quantity(name) == "time")
        ):
            return Titled(name or title, inner)
    if "[" in title or "(" in title:
        return Titled(_BRACKETS.sub("", title).strip(" _") or title, "")
    if (bare := re.fullmatch(r"in\s+(\S+)", title)) and readable(bare[1]):
        return Titled("", bare[1])
    if parts := _BEHIND.fullmatch(title):
        for cut in re.finditer(r"\s*/\s*|\s*[,，;:]\s*|\s+in\s+|\s+", title):
            name, rest = title[: cut.start()], title[cut.end() :]
            # The stroke of field_kV/mm is that of the unit.
            inside = cut[0] == "/" and _WEAK.fullmatch(name.rpartition("_")[2]) and "_" in name
            if name and not inside and _suits(name, rest, blank=cut[0].isspace()):
                return Titled(name, rest)
        name, rest = parts[1], parts[2]
        stroke = title[len(name) : len(title) - len(rest)].strip()
        own = "_" in name and _WEAK.fullmatch(name.rpartition("_")[2])
        if stroke in ("/", "in") and quantity(name) and not (quantity(rest) or own):
            return Titled(name, rest)
    words = [word for word in re.split(r"[_.\-]+", title) if word]
    if len(words) > 1 and quantity(title) and of_capitals(title, words[-1]):
        return Titled("_".join(words[:-1]), words[-1])
    for count in (2, 1):
        name, rest = "_".join(words[:-count]), "/".join(words[-count:])
        if name and _suits(name, rest):
            return Titled(name, rest)
    for at in range(1, len(words) - 1):
        # As in displacement_nm_filtered.
        inner = len(words[at]) > 1 and not _WEAK.fullmatch(words[at + 1])
        if inner and quantity(words[0]) and _suits(words[0], words[at]):
            return Titled("_".join(words[:at] + words[at + 1 :]), words[at])
    if camel := _CAMEL.fullmatch(title):
        # As in positionNm.
        unit = _OF_CAMEL.get(camel[2].lower(), "")
        if unit and quantity(camel[1]) and _suits(camel[1], unit):
            return Titled(camel[1], unit)
    if len(words) > 1 and quantity(words[0]) and is_unknowable(words[-1]):
        return Titled("_".join(words[:-1]), words[-1])
    if unit := _CLOCKS.get(re.split(r"\W|_", title)[-1].casefold()):
        return Titled(title, unit)
    return Titled(title, "")


def is_unknowable(text: str) -> bool:
    """Whether a word in place of a unit says that there is none, such as counts."""
    return text.casefold().strip(" .").replace("a.u", "au") in _UNKNOWABLE


def unread(title: str) -> str:
    """What stands in brackets in a name and is no unit."""
    inner = [match[match.lastindex or 0] for match in _BRACKETS.finditer(title)]
    return next((each for each in inner if each and readable(each) is None), "")


def _suits(name: str, rest: str, *, blank: bool = False) -> bool:
    """Whether what stands behind a name is a unit of the quantity that the name speaks of."""
    foreign = rest.casefold() in _CANONICAL and not rest.isascii()
    if not (_WEAK.fullmatch(rest) or foreign or rest.casefold() in _CANONICAL):
        return False
    read = readable(rest)
    spoken = quantity(name)
    if read is None or (spoken is None and rest in ("A", "C", "F", "T", "g", "W", "J")):
        return False
    if spoken is None and blank and len(rest) == 1 and rest != "V":
        return False
    # A sample rate is no count.
    kinds = ("Hz",) if spoken == "counter" else _DIMENSIONS.get(spoken or "", _SIGNALS)
    electrical = spoken in ("length", "force", "angle", "charge") and not blank
    kinds = (*kinds, "V") if electrical else kinds
    if spoken is None and is_compatible(read, "s"):
        return not blank and rest not in ("s",)
    return is_compatible(read, *kinds)


def contradicts(name: str, read: str) -> bool:
    """Whether a unit cannot be that of what the name speaks of: a voltage in furlongs.

    Any quantity but the time may be written in volts or amperes, as its sensor gives it, or as a
    share.
    """
    spoken = quantity(name) or ""
    kinds, understood = _DIMENSIONS.get(spoken, ()), readable(read)
    others = () if spoken == "time" else (*_ELECTRICAL, "%")
    return bool(kinds) and (understood is None or not is_compatible(understood, *kinds, *others))
