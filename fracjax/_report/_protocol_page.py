"""The sheet of a designed drive: what to record, what each part is for, and what it will show."""

from __future__ import annotations

from typing import Any

from .._protocol import Protocol
from .._show import figure, pretty_unit, quantity
from . import _figures
from ._embedding import embedded, placed
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
    figures = {
        "drive": _figures.drive(protocol.drive, unit),
        "shown": _figures.shown(protocol.shows, protocol.stroke),
    }
    elements, scripts = embedded([plot for figure in figures.values() for plot in figure.plots])
    return {
        "title": f"Protocol{' after ' + protocol.source if protocol.after else ''}",
        "sentence": protocol.sentence,
        "badge": "to be recorded",
        "verdict": "none",
        "facts": facts,
        "warnings": protocol.warnings,
        "figures": placed(figures, elements),
        "scripts": scripts,
        "parts": protocol.timetable()[1],
        "headers": headers,
        "rows": [[*row, hidden[row[0]]] for row in rows],
        "unit": pretty_unit(protocol.units[1]),
        "after": protocol.after,
        "downloads": [download("protocol.json", protocol.to_dict())],
    }
