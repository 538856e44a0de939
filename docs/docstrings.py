"""Docstrings as reStructuredText: their equations are indented, and stars and bars no markup."""

from __future__ import annotations

import re
from collections.abc import Sequence

SECTION = re.compile(r"(Args|Attributes|Raises|Returns|Yields):$")
CODE = re.compile(r"(`+[^`]*`+)")
SPECIAL = re.compile(r"([*|]|(?<=\w)_(?!\w))")
NAMED = re.compile(r" +\*+\w+:")
"""An argument such as `**options:`, whose stars napoleon reads."""


def as_rst(lines: Sequence[str]) -> list[str]:
    """A docstring's lines with indented equations as literal blocks, and with all else that would
    be markup, outside code, as text."""
    rst, literal, section = [], False, False
    for before, line in zip(["", *lines], lines, strict=False):
        indented = line.startswith("    ")
        if line and not indented:
            literal, section = False, bool(SECTION.match(line))
        if indented and not (section or before or literal):
            rst += ["::", ""]
            literal = True
        rst.append(line if literal or NAMED.match(line) else as_text(line))
    return rst


def as_text(line: str) -> str:
    """A line without markup outside its code."""
    parts = CODE.split(line)
    parts[::2] = [SPECIAL.sub(r"\\\1", text) for text in parts[::2]]
    return "".join(parts)
