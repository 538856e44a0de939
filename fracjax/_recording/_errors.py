"""What the user gave cannot be used: the error, and what asks for it."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from numbers import Number
from typing import Any, Self, TypeVar

T = TypeVar("T")


class InputError(ValueError):
    """What the user gave cannot be used: one plain sentence, never a traceback."""

    @classmethod
    def at(cls, where: str, expected: str, given: str, remedy: str) -> Self:
        """Say where, what was expected, what was given, and the remedy."""
        return cls(f"{where}: expected {expected}, found {given}; {remedy}.")


def found_in(given: object) -> str:
    """What was given, in a few words."""
    if isinstance(given, str):
        return f'"{given}"'
    if given is None or isinstance(given, Number):
        return f"{given}"
    return f"a {type(given).__name__}"


def closest(name: str, names: Iterable[str]) -> str:
    """The name that was probably meant, as a question in parentheses; "" where none is like it."""
    matches = get_close_matches(name.lower(), list(names), 1)
    return f" (did you mean {matches[0]}?)" if matches else ""


def require_kind(given: Any, kind: type, where: str, remedy: str) -> None:
    """Raise `InputError` where something is not of its kind."""
    if not isinstance(given, kind):
        raise InputError.at(where, f"a {kind.__name__}", found_in(given), remedy)


def item(items: Sequence[T], index: Any, name: str) -> T:
    """One of several.  Raises `InputError` where the index is none of them."""
    if isinstance(index, int) and 0 <= index < len(items):
        return items[index]
    raise InputError.at(
        name, f"a number from 0 to {len(items) - 1}", found_in(index), "choose one of them"
    )


def pair_of(given: Any, where: str, expected: str, remedy: str) -> tuple[float, float]:
    """Two numbers.  Raises `InputError` where something is none such."""
    try:
        first, second = map(float, given)
    except (TypeError, ValueError):
        raise InputError.at(where, expected, found_in(given), remedy) from None
    return first, second
