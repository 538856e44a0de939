"""What the words in a column's name speak of, in the languages that instruments write.

It is kept by name, as files repeat their headers.
"""

import re
from functools import lru_cache

_QUANTITIES = {
    "time": "time times t zeit temps tiempo tempo čas czas tid tijd время timestamp datetime date "
    "uhrzeit zeitstempel clock tout heure hora elapsed seconds",
    "voltage": "voltage volt volts spannung tension voltaje tensione napięcie напряжение u_in vin",
    "current": "current strom courant corriente corrente ток",
    "length": "displacement displacements disp position positions pos deflection stroke extension "
    "elongation weg auslenkung verschiebung dehnweg hub déplacement deplacement "
    "desplazamiento posición posicion spostamento posizione posição przemieszczenie перемещение "
    "положение смещение",
    "force": "force kraft effort fuerza forza сила",
    "charge": "charge ladung polarization polarisation polarización заряд",
    "angle": "angle tilt rotation winkel kippwinkel roll pitch yaw",
    "frequency": "frequency frequenz fréquence",
    "speed": "velocity speed geschwindigkeit vitesse",
    "temperature": "temperature temperatur température temp humidity feuchte",
    "counter": "sample samples index no nr number count counter point points sequence scan record "
    "row n idx num nummer messwert № cnt",
    "remark": "comment comments remark remarks note notes alarm alarms trigger status event events "
    "bemerkung kommentar marker flag flags",
}
_PARTS = {
    "time": "zeit 时间 時間 时刻 時刻 시간 время 秒数",
    "voltage": "spannung voltage 电压 電圧 電壓 전압 напряжен",
    "current": "电流 電流",
    "length": "displacement position auslenkung verschiebung 位移 変位 變位 변위 位置 перемещ",
    "force": "kraft 荷重 力",
    "charge": "电荷 電荷 polari",
    "angle": "角度 winkel",
    "temperature": "温度 溫度 temperatur",
    "counter": "序号 编号 番号 序號 サンプル番号 点数",
    "remark": "备注 コメント",
}
_ROLES = {
    "time": "time",
    "voltage": "input",
    "current": "input",
    "length": "output",
    "force": "output",
    "charge": "output",
    "angle": "output",
    "frequency": "other",
    "speed": "other",
    "temperature": "other",
    "counter": "counter",
    "remark": "other",
}
_COMMANDS = frozenset(
    [
        "command",
        "commanded",
        "cmd",
        "target",
        "setpoint",
        "reference",
        "desired",
        "demand",
        "demanded",
        "soll",
        "sollwert",
        "consigne",
        "指令",
        "目标",
        "目標",
        "设定",
    ]
)
_WIDE_COMMANDS = tuple(word for word in _COMMANDS if not word.isascii())
_SENSORS = frozenset(
    [
        "sensor",
        "sensors",
        "gauge",
        "lvdt",
        "interferometer",
        "vibrometer",
        "fühler",
        "capteur",
        "传感器",
    ]
)
_DIRECTIONS = {
    "input": frozenset(
        [
            "input",
            "drive",
            "excitation",
            "in",
            "actuation",
            "stimulus",
            "eingang",
            "entrée",
            "anregung",
            "输入",
            "入力",
        ]
    ),
    "output": frozenset(
        ["output", "response", "out", "ausgang", "sortie", "antwort", "输出", "出力"]
    ),
}
_ENDS = frozenset(
    [
        "input",
        "output",
        "in",
        "out",
        "eingang",
        "ausgang",
        "entrée",
        "sortie",
        "输入",
        "入力",
        "输出",
        "出力",
    ]
)
_LETTERS = {"u": "input", "x": "output", "y": "output"}
_ABSCISSAS = frozenset(("xvalue", "xaxis", "abscissa", "xdata", "xachse"))
_EITHER = {word: kind for kind, words in _QUANTITIES.items() for word in words.split()}
_WITHIN = [(part, kind) for kind, parts in _PARTS.items() for part in parts.split()]
FOREIGN_WORDS = frozenset(
    word
    for several in (*_QUANTITIES.values(), *_PARTS.values())
    for word in several.split()
    if not word.isascii() and len(word) > 1
)


def _words(text: str) -> list[str]:
    """The words of a name in small letters: parted where its case changes, without digits."""
    parted = re.sub(r"(?<=[a-zäöü])(?=[A-Z])", " ", text)
    bare_words = (word.strip("0123456789") for word in re.split(r"[\W_]+", parted.casefold()))
    return [word for word in bare_words if word]


def _spoken(text: str) -> set[str]:
    """The quantities that a name speaks of."""
    words = _words(text)
    kinds = {_EITHER[word] for word in words if word in _EITHER}
    low = text.casefold()
    kinds |= {kind for part, kind in _WITHIN if part in low}
    if text.strip() in ("#", "No.", "№"):
        kinds.add("counter")
    # "The current position" is no current, and a sampling time no counter.
    for adjective in ("current", "counter", "remark"):
        if len(kinds) > 1:
            kinds.discard(adjective)
    return kinds


@lru_cache(maxsize=1024)
def quantity(text: str) -> str | None:
    """The one quantity that a name speaks of, such as "voltage"; None of none or of several."""
    kinds = _spoken(text)
    return next(iter(kinds)) if len(kinds) == 1 else None


@lru_cache(maxsize=1024)
def role_of(text: str) -> str | None:
    """The role that a name speaks of: time, input, output, counter or other; None of none.

    A command is a drive whatever it commands, and a sensor's signal a response in whatever unit;
    else the quantity decides, else the direction.
    """
    words = _words(text)
    if not {"_".join(words), "".join(words)}.isdisjoint(_ABSCISSAS):
        return "time"
    low = text.casefold()
    spoken = _spoken(text)
    if "time" not in spoken:
        commanded = not _COMMANDS.isdisjoint(words) or any(word in low for word in _WIDE_COMMANDS)
        sensed = not _SENSORS.isdisjoint(words)
        if commanded != sensed:
            return "input" if commanded else "output"
    roles = {_ROLES[kind] for kind in spoken}
    if len(roles - {"counter"}) == 1:
        return next(iter(roles - {"counter"}))
    if roles:
        return "counter" if roles == {"counter"} else None
    directions = {role for role, spoken in _DIRECTIONS.items() if not spoken.isdisjoint(words)}
    if not directions:
        directions = {
            role
            for role, spoken in _DIRECTIONS.items()
            if any(not word.isascii() and word in low for word in spoken)
        }
    return directions.pop() if len(directions) == 1 else None


@lru_cache(maxsize=1024)
def is_direction(text: str) -> bool:
    """Whether a name says no more than that it is an input or an output: of the actuator, or of the
    instrument at its other end."""
    words = set(_words(text))
    return not _spoken(text) and not _ENDS.isdisjoint(words)


@lru_cache(maxsize=1024)
def role_of_letter(text: str) -> str | None:
    """The role of a name with one letter such as u, which says less than a unit does."""
    singles = {_LETTERS[word] for word in _words(text) if word in _LETTERS}
    return singles.pop() if len(singles) == 1 else None
