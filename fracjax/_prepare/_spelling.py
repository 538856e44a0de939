"""What a call asks of parameters and samples, as it is written on the command line."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from typing import Any

from .._recording import InputError, parse_quantity
from ._normal import Normal

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NAME = r"[A-Za-z_][\w.]*"


def options_of(
    *,
    fix: Iterable[str] = (),
    bound: Iterable[str] = (),
    prior: Iterable[str] = (),
    tie: Iterable[str] = (),
    own: Iterable[str] = (),
    mask: Iterable[str] = (),
    loss: str = "least_squares",
) -> dict[str, Any]:
    """The keywords of `fit` that say the same.  Raises InputError for what is written otherwise."""
    found: dict[str, Any] = {
        "fixed": dict(_fixed(text) for text in fix),
        "bounds": dict(_bounds(text) for text in bound),
        "priors": dict(_prior(text) for text in prior),
        "tied": dict(_tie(text) for text in tie),
        "own": tuple(own),
        "mask": tuple(_span(text) for text in mask),
        "loss": loss if loss != "least_squares" else None,
    }
    return {name: value for name, value in found.items() if value}


_BY_NAME = ("fixed", "bounds", "priors", "tied")


def options_for(asked: dict[str, Any], names: Collection[str], all_names: Collection[str]) -> dict:
    """What of `options_of` concerns a model with these parameters' names.

    Of several models each takes what speaks of its own parameters; what speaks of none of
    `all_names` is left in, and the fit refuses it.
    """

    def concerns(name: str) -> bool:
        return name in names or name not in all_names

    told = dict(asked)
    for key in _BY_NAME:
        if key in asked:
            told[key] = {n: value for n, value in asked[key].items() if concerns(n)}
    for key in ("own", "profiled"):
        if key in asked:
            told[key] = tuple(n for n in asked[key] if concerns(n))
    return told


def _read(option: str, pattern: str, example: str, text: str) -> re.Match:
    found = re.fullmatch(rf"\s*({_NAME})\s*=\s*{pattern}\s*", text)
    if found is None:
        raise InputError.at(f"--{option}", f'a text such as "{example}"', f'"{text}"', "correct it")
    return found


def _fixed(text: str) -> tuple[str, float]:
    found = _read("fix", f"({_NUMBER})", "alpha=0.1", text)
    return found[1], float(found[2])


def _bounds(text: str) -> tuple[str, tuple[float, float]]:
    found = _read("bound", rf"({_NUMBER})\s*\.\.\s*({_NUMBER})", "alpha=0.05..0.2", text)
    return found[1], (float(found[2]), float(found[3]))


def _prior(text: str) -> tuple[str, Normal]:
    found = _read("prior", rf"({_NUMBER})\s*(?:±|\+-|\+/-)\s*({_NUMBER})", "alpha=0.1±0.02", text)
    return found[1], Normal(float(found[2]), float(found[3]))


def _tie(text: str) -> tuple[str, tuple[str, float]]:
    found = _read("tie", rf"(?:({_NUMBER})\s*\*\s*)?({_NAME})", "second.mu=2*first.alpha", text)
    return found[1], (found[3], float(found[2] or 1))


def _span(text: str) -> tuple[float, float]:
    first, dots, last = text.partition("..")
    if not dots:
        raise InputError.at("--mask", 'a time such as "3 s..4 s"', f'"{text}"', "correct it")
    return parse_quantity(first, "s", "--mask"), parse_quantity(last, "s", "--mask")
