"""Steps, rates, units and names that a file states beside its columns."""

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from fracjax._io._table import Fact
from fracjax._io._units import is_compatible, readable, stripped, titled
from fracjax._io._words import role_of
from fracjax._recording import InputError, parse_quantity

_KEYS = {
    "step": "dt ts tinterval wfincrement sampleinterval samplinginterval sampletime samplingtime "
    "sampleperiod samplingperiod timestep timeincrement deltax deltat xincrement xinc xincr xdelta "
    "dx horizontalinterval horizinterval hinterval increment interval timeperpoint tinc tstep "
    "recordinginterval measurementinterval measuringinterval loggingrateperiod abtastintervall "
    "abtastzeit abtastperiode samplingrateperiod pasdetemps périodedéchantillonnage "
    "périodeéchantillonnage 采样间隔 采样周期 采样时间 サンプリング間隔 サンプリング周期 "
    "サンプル間隔 記録間隔 интервал шаг",
    "rate": "fs rate samplerate samplingrate samplefrequency samplingfrequency samplefreq "
    "samplingfreq fsample fsamp scanrate scanfrequency acquisitionrate acquisitionfrequency "
    "datarate framerate samplespersecond abtastrate abtastfrequenz fréquencedéchantillonnage "
    "fréquencedacquisition frecuenciademuestreo frequenzadicampionamento 采样率 采样频率 采样速率 "
    "サンプリング周波数 サンプリングレート サンプリング速度 частотадискретизации",
    "unit": "vunit unit units unitstring yunitlabel yunit yunits verticalunits verticalunit "
    "einheit "
    "einheiten unité unités unidad unidades unità 单位 単位 единица единицы ynunits physicalunit "
    "engineeringunits inputunit outputunit dimension",
    "xunit": "xunit xunits hunit horizontalunits horizontalunit timeunit",
    "name": "tracename name names channelname channelnames signalname label labels title "
    "longname "
    "kanalname kanal signal channel channels columns column 名称 信号名",
    "start": "wfstarttime t0 starttime",
    "shift": "wfstartoffset",
    "scale": "scalefactor",
    "offset": "addoffset",
    "missing": "fillvalue missingvalue",
    "unapplied": "gain sensitivity calibration calibrationfactor slope multiplier scale scaling "
    "ymult conversionfactor lsb",
}
_KIND = {key: kind for kind, keys in _KEYS.items() for key in keys.split()}
_MARKS = re.compile(r"^[\s#%;!*/'$&@|]+")
_PAIR = re.compile(r"\s*([^:=]+?)\s*[:=]\s*(.*?)\s*")
_NUMBERED = re.compile(r"(.*?)[\s_]*(\d+)")


class Said(NamedTuple):
    """A line above a table that says something: a key and what stands behind it."""

    key: str
    values: tuple[str, ...]
    at: tuple[int, ...]
    """In which cells of the line the values stand."""


def kind_of(key: str) -> str | None:
    """What a key tells: "step", "rate", "unit", "name" and so on; None where nobody knows it."""
    return _KIND.get(re.sub(r"[\W_]+", "", titled(key).name.casefold()))


def said_in(line: str, cells: Sequence[str]) -> list[Said]:
    """What a line says: key and values in cells of their own, or as `key: value` or `key = value`.

    `cells`: the line cut by the table's separator.
    """
    bare = _MARKS.sub("", line).strip()
    first = _MARKS.sub("", cells[0]).strip().strip('"').rstrip(":=").strip() if cells else ""
    statements = []
    rest = [(cell, at) for at, cell in enumerate(cells) if at > 0]
    if len(cells) > 1 and first and any(cell for cell, _ in rest) and not _PAIR.fullmatch(first):
        statements.append(Said(first, tuple(c for c, _ in rest), tuple(at for _, at in rest)))
    pairs = [cell for cell in cells if _PAIR.fullmatch(cell)]
    for text in (bare.rstrip(",;|\t "), *(pairs if len(pairs) > 1 else ())):
        if pair := _PAIR.fullmatch(_MARKS.sub("", text).strip('"')):
            statements.append(Said(pair[1], (pair[2].strip('"'),), (0,)))
    if not statements and (parts := re.fullmatch(r"(\S.*?)(?:\t+|\s{2,})(\S.*)", bare)):
        statements.append(Said(parts[1], (parts[2],), (0,)))
    if not statements and (
        parts := re.fullmatch(r"(\D*?\S)\s+([-+.\d]\S*(?:\s*[A-Za-zµ/]+)?)", bare)
    ):
        statements.append(Said(parts[1], (parts[2],), (0,)))
    return statements


def fact(
    name: str, value: str, kind: str, decimal: str = ".", *, key: str | None = None
) -> Fact | None:
    """A step or a rate as `Fact`, None where what stands there is none.

    The unit stands behind the value, or in the key, which is the name unless stated, as in
    `Sampling interval (ms)`.
    """
    text = re.sub(r"^[A-Za-z]\w*:\s*", "", value.strip().strip('"'))
    if decimal == "," or re.match(r"[-+]?0,\d", text):
        text = text.replace(",", ".")
    text = re.sub(r"(?<=\d),(?=\d{3}(?!\d))", "", text)
    default = "s" if kind == "step" else "Hz"
    parts = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)", text)
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
    units: dict[int, str]
    clocks: dict[int, tuple[Fact, ...]]
    """By column; of all columns under -1."""


def beside(
    lines: Iterable[Said], data: Sequence[int], names: Sequence[str], decimal: str
) -> Beside:
    """What lines say of the columns `data`, which hold numbers.

    A value in the cell above a column speaks of that column, one value alone of all of them, and
    a key with a number of that channel, counted from 0 or 1 as the keys are.
    """
    facts = Beside({}, {}, {})
    numbered: dict[str, dict[int, str]] = {"name": {}, "unit": {}}
    for said in lines:
        kind = kind_of(said.key)
        if kind in ("step", "rate"):
            _take_clocks(facts.clocks, said, kind, data, decimal)
        elif kind == "unit":
            _take_units(facts.units, said, data, names)
        elif kind == "name" and not names:
            for at, text in _spread(said, data):
                facts.names.setdefault(at, text)
        elif kind is None and (parts := _NUMBERED.fullmatch(said.key)):
            kind = kind_of(parts[1])
            if kind in numbered and said.values[0].strip():
                numbered[kind].setdefault(int(parts[2]), said.values[0].strip())
    for kind, into in (("name", facts.names), ("unit", facts.units)):
        texts = numbered[kind]
        base = 0 if 0 in texts else 1
        if texts and all(0 <= number - base < len(data) for number in texts):
            for number, text in texts.items():
                into.setdefault(data[number - base], text if kind == "name" else stripped(text))
    for said in lines:
        if kind_of(said.key) == "xunit" and data and len(facts.units) in (1, len(data) - 1):
            facts.units.setdefault(data[0], stripped(said.values[0]))
    return facts


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


def _take_clocks(
    clocks: dict[int, tuple[Fact, ...]], said: Said, kind: str, data: Sequence[int], decimal: str
) -> None:
    """Add the steps or rates of a line: one for all, or one in the cell above each column."""
    cells = [
        (at, fact(said.key, value, kind, decimal))
        for at, value in zip(said.at, said.values, strict=True)
    ]
    # A value and its unit in cells of their own.
    if len(said.values) > 1 and readable(said.values[1]):
        joined = fact(said.key, f"{said.values[0]} {said.values[1]}", kind, decimal)
        cells = [(said.at[0], joined)] if joined else cells
    good = [(at, each) for at, each in cells if each is not None]
    if len({each.value for _, each in good}) == 1:
        clocks[-1] = tuple(dict.fromkeys((*clocks.get(-1, ()), good[0][1])))
    elif len(good) == len(cells):
        by_text = {each.value: each for _, each in good}
        for at, text in _spread(said._replace(values=tuple(e.value for _, e in good)), data):
            clocks[at] = (*clocks.get(at, ()), by_text[text])


def _take_units(
    units: dict[int, str], said: Said, data: Sequence[int], names: Sequence[str]
) -> None:
    """Add the units of a line: in the cell above each column, by its name, or one for the last."""
    pairs = [pair for value in said.values for pair in re.findall(r"(\S+?):(\S+)", value)]
    if pairs:
        for name, text in pairs:
            for column in data:
                if column < len(names) and names[column].casefold() == name.casefold():
                    units.setdefault(column, stripped(text))
        return
    for at, text in _spread(said, data, names):
        units.setdefault(at, stripped(text))
    filled = [value for value in said.values if value.strip()]
    if len(filled) == 1 and len(data) in (1, 2):
        units.setdefault(data[-1], stripped(filled[0]))
