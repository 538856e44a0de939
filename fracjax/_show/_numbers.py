"""Numbers, shares and units as they are printed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from math import floor, inf, isfinite, log10

_NEGLIGIBLE = 1e-6
"""Share of the largest number of an axis below which another is printed as 0."""


def figure(value: float | None, digits: int = 3) -> str:
    """A number to this many significant digits; a dash for None."""
    if value is None:
        return "–"
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.{digits}g}"


def p_value(p: float) -> str:
    """A p-value, with a lower limit of 1e-12."""
    return "p < 1e-12" if p < 1e-12 else f"p = {p:.2g}"


def percent(share: float | None) -> str:
    """A share in per cent; 100 % only if it is exactly 1."""
    if share is None:
        return "–"
    return "> 99.9 %" if 0.9995 <= share < 1 else f"{100 * share:.3g} %"


def pretty_unit(unit: str) -> str:
    """A unit as it is printed: µm for um, V·s for V*s, nothing for 1."""
    spelt = re.sub(r"\bu(?=[mVANs]\b)", "µ", unit).replace("**", "^").replace("^2", "²")
    spelt = spelt.replace("*", "·")
    return "" if spelt == "1" else spelt


def quantity(value: float | None, unit: str) -> str:
    """A number with its unit."""
    return f"{figure(value)} {pretty_unit(unit)}".strip()


def percentage(share: float) -> str:
    """A share in per cent, to one digit, and whole from 1 % on."""
    return f"{100 * share:.1g}" if share < 0.01 else f"{100 * share:.0f}"


def rounded(value: float, error: float) -> str:
    """A value rounded to two significant digits of its error."""
    if not (isfinite(value) and 0 < error < inf) or value == 0:
        return figure(value)
    digits = max(1, floor(log10(abs(value))) - floor(log10(error)) + 2)
    return figure(float(f"{value:.{digits}g}"), digits)


def rounded_edges(edges: Sequence[float]) -> list[str]:
    """The ascending edges of bins as texts, each to two digits of the narrower bin beside it.

    What is negligible beside the largest is 0, so that only such neighbours are equal.
    """
    largest = max(abs(edge) for edge in edges)
    exact = [0.0 if abs(edge) < _NEGLIGIBLE * largest else float(edge) for edge in edges]
    widths = [high - low or largest for low, high in pairwise(exact)]
    texts = []
    for edge, before, after in zip(exact, [largest, *widths], [*widths, largest], strict=True):
        decimals = 1 - floor(log10(min(before, after)))
        texts.append(f"{round(edge, decimals) + 0.0:.7g}".replace("-", "−"))
    return texts
