"""Steps, rates, units and names that a file states beside its columns."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from fracjax._io._lexicon import WORDS, by_word
from fracjax._io._table import Fact, Stated
from fracjax._io._units import (
    contradicts,
    is_compatible,
    is_spelled_unit,
    readable,
    stripped,
    titled,
)
from fracjax._io._words import quantity, role_of
from fracjax._recording import InputError, parse_quantity

_KIND = by_word("keys")
_MARKS = re.compile(r"^[\s#%;!*/'$&@|]+")
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_PAIR = re.compile(r"\s*([^:=]+?)\s*[:=]\s*(.*?)\s*")
_PER_COUNT = re.compile(r"\d\s*[^\W\d]+\s*(?:/|per)\s*(?:count|lsb|bit|digit)s?\b", re.IGNORECASE)
_NUMBERED = re.compile(r"(.*?)[\s_]*(\d+)")
_FACTORS = {kind: frozenset(words) for kind, words in WORDS["factors"].items()}


class Said(NamedTuple):
    """A line above a table that says something: a key and what stands behind it."""

    key: str
    values: tuple[str, ...]
    at: tuple[int, ...]
    """In which cells of the line the values stand."""
    place: str
    text: str
    """The whole line."""
    column: str = ""
    """Of the unit of a column whose name stands in a line above, that name."""


def kind_of(key: str) -> str | None:
    """What a key tells: "step", "rate", "unit", "name" and so on; None where nobody knows it."""
    return _KIND.get(re.sub(r"[\W_]+", "", titled(key).name.casefold()))


def said_in(line: str, cells: Sequence[str], place: str) -> list[Said]:
    """What a line says: key and values in cells of their own, or as `key: value` or `key = value`,
    one or the same key again and again.

    `cells`: the line cut by the table's separator.
    """
    bare = _MARKS.sub("", line).strip()
    if bare.startswith("{") and (pairs := _pairs_in(bare)):
        return [Said(key, values, tuple(range(len(values))), place, bare) for key, values in pairs]
    first = _MARKS.sub("", cells[0]).strip().strip('"').rstrip(":=").strip() if cells else ""
    statements: list[tuple[str, tuple[str, ...], tuple[int, ...]]] = []
    rest = [(cell, at) for at, cell in enumerate(cells) if at > 0]
    if len(cells) > 1 and first and any(cell for cell, _ in rest) and not _PAIR.fullmatch(first):
        statements.append((first, tuple(c for c, _ in rest), tuple(at for _, at in rest)))
    pairs = [cell for cell in cells if _PAIR.fullmatch(cell)]
    for text in (bare.rstrip(",;|\t "), *(pairs if len(pairs) > 1 else ())):
        if pair := _PAIR.fullmatch(_MARKS.sub("", text).strip('"')):
            key = pair[1].strip("\"'{ ").removeprefix("- ")
            values = [v.strip(" \"'},") for v in bare.split(f"{pair[1]}:")[1:]]
            if len(values) < 2:
                listed = re.fullmatch(r"\[(.*)\]", pair[2]) or re.fullmatch(
                    r"(.*[,;|\t].*)", pair[2]
                )
                values = (
                    re.split(r"[,;|\t]", listed[1])
                    if listed and kind_of(key) == "unit"
                    else [pair[2]]
                )
            values = [value.strip().strip("\"'},").strip() for value in values]
            statements.append((key, tuple(values), tuple(range(len(values)))))
    if not statements and (parts := re.fullmatch(r"(\S.*?)(?:\t+|\s{2,})(\S.*)", bare)):
        statements.append((parts[1], (parts[2],), (0,)))
    if not statements and (
        parts := re.fullmatch(r"(\D*?\S)\s+([-+.\d]\S*(?:\s*[A-Za-zµ/]+)?)", bare)
    ):
        statements.append((parts[1], (parts[2],), (0,)))
    return [Said(*each, place, bare) for each in statements or [(bare, ("",), (0,))] if bare]


def _pairs_in(text: str) -> list[tuple[str, tuple[str, ...]]]:
    """The keys of an object of JSON, each with its values as text; none of any other text."""
    try:
        items = json.loads(text).items()
    except (ValueError, AttributeError):
        return []
    listed = [(key, each if isinstance(each, list) else [each]) for key, each in items]
    return [
        (key, tuple(v if isinstance(v, str) else json.dumps(v) for v in values))
        for key, values in listed
        if values
    ]


def with_columns(lines: Sequence[Said]) -> list[Said]:
    """The same, a unit in a line of its own with the name that stands in the line above it."""
    joined, name = [], ""
    for said in lines:
        kind = kind_of(said.key)
        if kind == "name" and len(said.values) == 1:
            name = said.values[0]
        elif kind is None and said.values in (("",), ("{",)):
            name = said.key.strip("\"'{: ")
        elif kind == "unit" and len(said.values) == 1 and name:
            said = said._replace(column=name)
        joined.append(said)
    return joined


def fact(
    name: str, value: str, kind: str, decimal: str = ".", *, key: str | None = None
) -> Fact | None:
    """A step or a rate as `Fact`, None where what stands there is none.

    The unit stands behind the value, or in the key, which is the name unless stated, as in
    `Sampling interval (ms)`.
    """
    text = re.sub(r"^[A-Za-z]\w*:\s*", "", value.strip().strip('"'))
    if decimal == "," or re.match(r"[-+]?0,\d", text):
        text = re.sub(r"\.(?=\d{3}[.,])", "", text).replace(",", ".")
    text = re.sub(r"(?<=\d),(?=\d{3}(?!\d))", "", text)
    default = "s" if kind == "step" else "Hz"
    parts = re.fullmatch(rf"({NUMBER})\s*(.*)", text)
    if parts is None:
        return None
    written = stripped(parts[2]) or titled(key or name).unit
    read = readable(written) if written else default
    if read is None:
        return None
    try:
        # "500 Hz" for an interval, or "2 ms" for a rate, are understood all the same.
        flip = is_compatible(read, "Hz") != (kind == "rate")
        clock = Fact(name, f"{parts[1]} {read}" if written else parts[1], _other(default, flip))
        return clock if step_of(clock, name) > 0 else None
    except (InputError, ZeroDivisionError):
        return None


def _other(default: str, flip: bool) -> str:
    return {"s": "Hz", "Hz": "s"}[default] if flip else default


def step_of(clock: Fact, where: str) -> float:
    """The step [s] that a file states as a step or a rate.

    Raises InputError for one that is not above zero.
    """
    parts = re.fullmatch(r"\s*(\S+)\s+(.*\S)\s*", clock.value)
    written = readable(parts[2]) if parts else None
    text = f"{parts[1]} {written}" if parts and written else clock.value
    value = parse_quantity(text, clock.unit, where)
    if value <= 0:
        kind = "a positive rate" if clock.unit == "Hz" else "a positive step"
        raise InputError.at(where, kind, clock.value, "give --rate such as 200Hz")
    return 1 / value if clock.unit == "Hz" else value


class Beside(NamedTuple):
    """What lines above or beside a table say of its columns."""

    names: dict[int, str]
    units: dict[int, list[Stated]]
    scales: dict[int, list[Stated]]
    clocks: dict[int, tuple[Fact, ...]]
    """By column; of all columns under -1."""
    used: set[str]
    """The places of lines that were understood."""


def beside(
    lines: Sequence[Said], data: Sequence[int], names: Sequence[str], decimal: str
) -> Beside:
    """What lines say of the columns `data`, which hold numbers.

    A value in the cell above a column speaks of that column, one value alone of all of them, a
    key with a number of that channel, counted from 0 or 1 as the keys are, and a line with the
    name of a column of that one, also by the line of its unit below.
    """
    facts = Beside({}, {}, {}, {}, set())
    numbered: dict[str, dict[int, tuple[str, str]]] = {"name": {}, "unit": {}}
    lines = _with_units_of_clocks(lines, facts)
    for said in lines:
        kind = kind_of(said.key)
        if kind in ("step", "rate"):
            _take_clocks(facts, said, kind, data, decimal)
        elif kind == "unit" and not said.column:
            _take_units(facts, said, data, names)
        elif kind in ("scale", "offset", "unapplied"):
            _take_factors(facts, said, data, names)
        elif kind == "name" and not names:
            for at, text in _spread(said, data):
                facts.names.setdefault(at, text)
        elif kind is None and (parts := _NUMBERED.fullmatch(said.key)):
            kind = kind_of(parts[1])
            if kind in numbered and said.values[0].strip():
                numbered[kind].setdefault(int(parts[2]), (said.values[0].strip(), said.place))
    for kind, by_number in numbered.items():
        base = 0 if 0 in by_number else 1
        if by_number and all(0 <= number - base < len(data) for number in by_number):
            for number, (text, place) in by_number.items():
                if kind == "name":
                    facts.names.setdefault(data[number - base], text)
                else:
                    _state(facts, data[number - base], text, place)
    for said in lines:
        if kind_of(said.key) == "xunit" and data and len(facts.units) in (1, len(data) - 1):
            _state(facts, data[0], said.values[0], said.place)
        elif kind_of(said.key) == "xunit" and len(set(said.values)) == 1:
            for at in data:
                if at < len(names) and role_of(names[at]) == "time":
                    _state(facts, at, said.values[0], said.place)
    titles = names or [facts.names.get(at, "") for at in range(max(data, default=-1) + 1)]
    own = {at: titled(title).name for at, title in enumerate(titles) if title and at in data}
    whole = {at: title for at, title in enumerate(titles) if at in own and title != own[at]}
    for said in lines:
        _take_named(facts, said, own)
        _take_named(facts, said, whole)
    return facts


def _with_units_of_clocks(lines: Sequence[Said], facts: Beside) -> list[Said]:
    """The lines, the unit of a step or a rate behind it where a line of its own states it."""
    units = {
        stem.casefold(): said
        for said in lines
        if (stem := re.sub(r"[\W_]*units?$", "", said.key, flags=re.IGNORECASE)) != said.key
        and len(said.values) == 1
        and is_spelled_unit(said.values[0])
    }
    joined = []
    for said in lines:
        beside = units.get(said.key.casefold())
        if beside and kind_of(said.key) in ("step", "rate") and len(said.values) == 1:
            facts.used.add(beside.place)
            said = said._replace(values=(f"{said.values[0]} {beside.values[0]}",))
        joined.append(said)
    return joined


def _state(facts: Beside, column: int, text: str, place: str) -> None:
    """Add the unit of a column, whose line is thereby understood."""
    facts.used.add(place)
    stated = Stated(stripped(text), place)
    if stated.text and stated not in facts.units.get(column, ()):
        facts.units.setdefault(column, []).append(stated)


def _take_named(facts: Beside, said: Said, names: Mapping[int, str]) -> None:
    """Add what a line says of the columns whose names stand in it: units and factors."""
    for column, name in names.items():
        if said.column and said.column.casefold() == name.casefold():
            _state(facts, column, said.values[0], said.place)
            continue
        if said.key.casefold() == name.casefold() and _PER_COUNT.search(said.values[0]):
            facts.scales.setdefault(column, []).append(Stated(said.values[0], said.place))
        rest = said.key.casefold().removeprefix(name.casefold()).strip(" _-.")
        if rest != said.key.casefold() and kind_of(rest) in ("unapplied", "scale", "offset"):
            facts.scales.setdefault(column, []).append(Stated(said.values[0], said.place))
    for column, text in units_by_name(said.text, names).items():
        _state(facts, column, text, said.place)


def units_by_name(text: str, names: Mapping[int, str]) -> dict[int, str]:
    """The unit of each column whose name stands in a line, where one unit stands behind it, before
    the name of the next: `voltage: kV`, `{name: time, unit: min}`, `displacement (in nm)`."""
    places = sorted(
        (match.start(), match.end(), column)
        for column, name in names.items()
        if name and len(name) < 60
        for match in re.finditer(rf"(?<!\w){re.escape(name)}(?!\w)", text, re.IGNORECASE)
    )
    units: dict[int, str] = {}
    for at, (_, end, column) in enumerate(places):
        stop = places[at + 1][0] if at + 1 < len(places) else len(text)
        words = dict.fromkeys(
            word for word in units_in(text[end:stop]) if not contradicts(names[column], word)
        )
        if len(words) == 1 and column not in units:
            units[column] = next(iter(words))
    return units


_WORD = re.compile(r"[^\s,;:=\[\](){}\"'|]+")
_LEADS = frozenset(("in", "unit", "units"))


def units_in(text: str) -> Iterator[str]:
    """The words of a line that are units: no quantity's, as behind a number, and a letter alone
    only behind a colon, a bracket, or "in"."""
    before = ""
    for match in _WORD.finditer(text):
        word = match[0].rstrip(".!?")
        if not is_spelled_unit(word) and is_spelled_unit(titled(word).unit):
            # A name with its unit, such as time/ms.
            word, before = titled(word).unit, ""
        ahead, behind = text[: match.start()].rstrip(" \"'"), text[match.end() :].lstrip(" \"'")
        lead = before.casefold() in _LEADS or ahead.endswith((":", "=", "[", "("))
        if (
            not re.fullmatch(r"[-+.\d]+(?:[eE][-+]?\d+)?", before)
            and not re.match(r"[:=]|[-+]?\d", behind)
            and (lead or len(word) > 1)
            and (word.casefold() not in _LEADS)
            and is_spelled_unit(word)
        ):
            yield word
        before = word


def speaks(text: str) -> bool:
    """Whether a line that nobody understood holds a unit, a factor, a rate or a start."""
    pairs = re.findall(r"(?<![\w.])[-+]?\d[\d.]*(?:[eE][-+]?\d+)?\s*([^\W\d][^\s,;)\]\"']*)", text)
    return (
        any(units_in(text))
        or any(map(is_spelled_unit, pairs))
        or bool(_PER_COUNT.search(text))
        or not _words_of(text).isdisjoint(_FACTORS["factor"])
        or is_decimated(text)
    )


def is_decimated(text: str) -> bool:
    """Whether a line says that fewer samples were kept than its rate took."""
    several = bool(re.search(r"[2-9]|\d\d", text))
    return several and not _words_of(text).isdisjoint(_FACTORS["decimation"])


def speaks_of_sampling(text: str) -> bool:
    """Whether a line speaks of how often samples were taken, and of all that were."""
    return not (_words_of(text).isdisjoint(_FACTORS["sampling"]) or is_decimated(text))


def scales_time(text: str) -> bool:
    """Whether a line speaks of a factor of times, as `time_scale = 0.001` does."""
    words = _words_of(text)
    return not words.isdisjoint(_FACTORS["factor"]) and any(quantity(w) == "time" for w in words)


def _words_of(text: str) -> set[str]:
    """The words of a line in small letters, parted where its case changes."""
    parted = re.sub(r"(?<=[a-zäöü])(?=[A-Z])", " ", text)
    return set(re.findall(r"[^\W\d_]+", parted.casefold()))


def _spread(said: Said, data: Sequence[int], names: Sequence[str] = ()) -> list[tuple[int, str]]:
    """The values of a line by column: one for each, or one for each but the times, or one for each
    but the first, which is the time, or those in the cells above them."""
    cells = [(at, v.strip()) for at, v in zip(said.at, said.values, strict=True) if v.strip()]
    texts = [text for _, text in cells]
    signals = [at for at in data if at < len(names) and role_of(names[at]) != "time"]
    if len(texts) > 1 and len(texts) == len(signals):
        return list(zip(signals, texts, strict=True))
    if len(texts) > 1 and len(texts) in (len(data), len(data) - 1):
        return list(zip(data[len(data) - len(texts) :], texts, strict=True))
    return cells if len(cells) > 1 and all(at in data for at, _ in cells) else []


def _take_clocks(facts: Beside, said: Said, kind: str, data: Sequence[int], decimal: str) -> None:
    """Add the steps or rates of a line: one for all, or one in the cell above each column."""
    clocks = facts.clocks
    cells = [
        (at, fact(said.key, value, kind, decimal))
        for at, value in zip(said.at, said.values, strict=True)
    ]
    # A value and its unit in cells of their own.
    if len(said.values) > 1 and readable(said.values[1]):
        joined = fact(said.key, f"{said.values[0]} {said.values[1]}", kind, decimal)
        cells = [(said.at[0], joined)] if joined else cells
    good = [(at, each) for at, each in cells if each is not None]
    if good:
        facts.used.add(said.place)
    if len({each.value for _, each in good}) == 1:
        clocks[-1] = tuple(dict.fromkeys((*clocks.get(-1, ()), good[0][1])))
    elif len(good) == len(cells):
        by_text = {each.value: each for _, each in good}
        for at, text in _spread(said._replace(values=tuple(e.value for _, e in good)), data):
            clocks[at] = (*clocks.get(at, ()), by_text[text])


def _take_factors(facts: Beside, said: Said, data: Sequence[int], names: Sequence[str]) -> None:
    """Add the factors, or what is added, in the cell above each column, but for those that change
    nothing."""
    for at, text in _spread(said, data, names):
        facts.used.add(said.place)
        if re.search(r"\d", text) and not re.fullmatch(r"[01](\.0*)?", text):
            facts.scales.setdefault(at, []).append(Stated(text, said.place))


def _take_units(facts: Beside, said: Said, data: Sequence[int], names: Sequence[str]) -> None:
    """Add the units of a line: in the cell above each column, or one for the last; those of a
    mapping stand behind the columns' names."""
    if said.values[0].startswith("{"):
        return
    for at, text in _spread(said, data, names):
        _state(facts, at, text, said.place)
    filled = [value for value in said.values if value.strip()]
    # The unit of a rate or a step stands in a line of its own as well.
    of_clock = len(filled) == 1 and is_compatible(readable(stripped(filled[0])) or "V", "s", "Hz")
    if len(filled) == 1 and len(data) in (1, 2) and not of_clock:
        _state(facts, data[-1], filled[0], said.place)
