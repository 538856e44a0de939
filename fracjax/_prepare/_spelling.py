"""The options of parameters and samples as they are written on the command line."""

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
    """The keywords of `fit` from the texts of the command line.

    Raises InputError where a text has another form.
    """
    options: dict[str, Any] = {
        "fixed": dict(_fixed(text) for text in fix),
        "bounds": dict(_bounds(text) for text in bound),
        "priors": dict(_prior(text) for text in prior),
        "tied": dict(_tie(text) for text in tie),
        "own": tuple(own),
        "mask": tuple(_span(text) for text in mask),
        "loss": loss if loss != "least_squares" else None,
    }
    return {name: value for name, value in options.items() if value}


_BY_NAME = ("fixed", "bounds", "priors", "tied")


def options_for(
    options: dict[str, Any], names: Collection[str], all_names: Collection[str]
) -> dict:
    """The part of the options that concerns a model with parameters of these names.

    If several models are fitted, each takes the options of its own parameters.  An option that
    concerns none of `all_names` is kept, so that the fit refuses it.
    """

    def concerns(name: str) -> bool:
        """Whether the model has this parameter, or no model has it."""
        return name in names or name not in all_names

    selected = dict(options)
    for key in _BY_NAME:
        if key in options:
            selected[key] = {n: value for n, value in options[key].items() if concerns(n)}
    for key in ("own", "profiled"):
        if key in options:
            selected[key] = tuple(n for n in options[key] if concerns(n))
    return selected


def _match(option: str, pattern: str, example: str, text: str) -> re.Match:
    """The parts of an option's text.  Raises InputError where it does not match the pattern."""
    match = re.fullmatch(rf"\s*({_NAME})\s*=\s*{pattern}\s*", text)
    if match is None:
        raise InputError.at(f"--{option}", f'a text such as "{example}"', f'"{text}"', "correct it")
    return match


def _fixed(text: str) -> tuple[str, float]:
    """A name and the value at which it is fixed."""
    match = _match("fix", f"({_NUMBER})", "alpha=0.1", text)
    return match[1], float(match[2])


def _bounds(text: str) -> tuple[str, tuple[float, float]]:
    """A name and its lower and upper bound."""
    match = _match("bound", rf"({_NUMBER})\s*\.\.\s*({_NUMBER})", "alpha=0.05..0.2", text)
    return match[1], (float(match[2]), float(match[3]))


def _prior(text: str) -> tuple[str, Normal]:
    """A name and its normal prior."""
    match = _match("prior", rf"({_NUMBER})\s*(?:±|\+-|\+/-)\s*({_NUMBER})", "alpha=0.1±0.02", text)
    return match[1], Normal(float(match[2]), float(match[3]))


def _tie(text: str) -> tuple[str, tuple[str, float]]:
    """A name, and the name and factor that it is tied to."""
    match = _match("tie", rf"(?:({_NUMBER})\s*\*\s*)?({_NAME})", "creep.mu=2*foh.alpha", text)
    return match[1], (match[3], float(match[2] or 1))


def _span(text: str) -> tuple[float, float]:
    """Start and end [s] of a time that is left out."""
    first, dots, last = text.partition("..")
    if not dots:
        raise InputError.at("--mask", 'a time such as "3 s..4 s"', f'"{text}"', "correct it")
    return parse_quantity(first, "s", "--mask"), parse_quantity(last, "s", "--mask")
