"""What the words in a column's name speak of, in the languages that instruments write.

It is kept by name, as files repeat their headers.
"""

import re
from functools import lru_cache

from fracjax._io._lexicon import WORDS, by_word

_SIGNALS = {kind: frozenset(words) for kind, words in WORDS["signals"].items()}
_WIDE_COMMANDS = tuple(word for word in _SIGNALS["commands"] if not word.isascii())
_LETTERS = {"u": "input", "x": "output", "y": "output"}
_EITHER = by_word("quantities")
_WITHIN = by_word("parts")
_ROLES = by_word("roles")
FOREIGN_WORDS = frozenset(
    word for word in (*_EITHER, *_WITHIN) if not word.isascii() and len(word) > 1
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
    kinds |= {kind for part, kind in _WITHIN.items() if part in low}
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
    if not {"_".join(words), "".join(words)}.isdisjoint(_SIGNALS["abscissas"]):
        return "time"
    low = text.casefold()
    spoken = _spoken(text)
    if "time" not in spoken:
        commanded = is_command(text)
        sensed = not _SIGNALS["sensors"].isdisjoint(words)
        if commanded != sensed:
            return "input" if commanded else "output"
    roles = {_ROLES[kind] for kind in spoken}
    if len(roles - {"counter"}) == 1:
        return next(iter(roles - {"counter"}))
    if roles:
        return "counter" if roles == {"counter"} else None
    ends = {role: _SIGNALS[role] for role in ("input", "output")}
    directions = {role for role, spoken in ends.items() if not spoken.isdisjoint(words)}
    if not directions:
        directions = {
            role
            for role, spoken in ends.items()
            if any(not word.isascii() and word in low for word in spoken)
        }
    return directions.pop() if len(directions) == 1 else None


@lru_cache(maxsize=1024)
def is_command(text: str) -> bool:
    """Whether a name speaks of what was commanded."""
    wide = any(word in text.casefold() for word in _WIDE_COMMANDS)
    return wide or not _SIGNALS["commands"].isdisjoint(_words(text))


@lru_cache(maxsize=1024)
def is_direction(text: str) -> bool:
    """Whether a name says no more than that it is an input or an output: of the actuator, or of the
    instrument at its other end."""
    words = set(_words(text))
    return not _spoken(text) and not _SIGNALS["ends"].isdisjoint(words)


@lru_cache(maxsize=1024)
def role_of_letter(text: str) -> str | None:
    """The role of a name with one letter such as u, which says less than a unit does."""
    singles = {_LETTERS[word] for word in _words(text) if word in _LETTERS}
    return singles.pop() if len(singles) == 1 else None
