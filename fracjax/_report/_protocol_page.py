"""The sheet of a designed drive: what to record, what each part is for, and what it will show."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl

from .._protocol import Protocol, draw_drive, draw_shown
from .._show import figure, pretty_unit, quantity
from .._show.drawing import STYLE, canvas, svg
from ._text import download


def protocol_content(protocol: Protocol) -> dict[str, Any]:
    """The template's content."""
    unit, limits = protocol.units[0], protocol.limits
    headers, rows = protocol.table()
    hidden = {one.effect: one.reason for one in protocol.shows}
    facts = [
        ["samples", f"{protocol.drive.values.size} at {figure(1 / protocol.drive.step, 6)} Hz"],
        ["range", f"{figure(limits.low, 4)} to {quantity(limits.high, unit)}"],
        ["fastest change allowed", quantity(limits.slew, f"{unit}/s")],
        ["begins and ends at", quantity(limits.start, unit)],
        ["tones up to", quantity(protocol.top, "Hz")],
        ["noise assumed", f"{quantity(protocol.noise, protocol.units[1])} rms"],
    ]
    if limits.code:
        facts.append(["in steps of", quantity(limits.code, unit)])
    return {
        "title": f"Protocol{' after ' + protocol.source if protocol.after else ''}",
        "sentence": protocol.sentence,
        "badge": "to be recorded",
        "verdict": "none",
        "facts": facts,
        "warnings": protocol.warnings,
        "drive": _drive(protocol),
        "parts": protocol.timetable()[1],
        "shown": svg(draw_shown(protocol.shows, protocol.stroke)),
        "headers": headers,
        "rows": [[*row, hidden[row[0]]] for row in rows],
        "unit": pretty_unit(protocol.units[1]),
        "after": protocol.after,
        "downloads": [download("protocol.json", protocol.to_dict())],
    }


@mpl.rc_context(STYLE)
def _drive(protocol: Protocol):
    """The drive over time with its parts."""
    drawing, axes = canvas(3.6)
    draw_drive(protocol.drive, protocol.units[0], axes[0, 0])
    return svg(drawing)
