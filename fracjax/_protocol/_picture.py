"""Pictures of a designed drive, and of what a recording can show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from .._path import LARGEST, Visible
from .._show import pretty_unit, quantity
from .._show.drawing import BAND, COLOURS, MEASURED, STYLE, Drawing, canvas, thinned

if TYPE_CHECKING:
    from ._result import Protocol

_ROW = 0.3
"""Height of a bar [inch]."""


@mpl.rc_context(STYLE)
def draw_protocol(protocol: Protocol) -> Drawing:
    """Draw a drive over time with its parts, the fastest of them once more, and what it will
    show."""
    rows = len(protocol.shows)
    drawing, axes = canvas(
        5.6 + _ROW * rows, 3, 1, gridspec_kw={"height_ratios": (3, 2, 0.8 + _ROW * rows)}
    )
    whole, part, bars = axes[:, 0]
    draw_drive(protocol, whole)
    _draw_fastest(protocol, part)
    before = {"before": protocol.before} if protocol.before else {}
    draw_visible({**before, "with this drive": protocol.shows}, protocol.stroke, bars)
    return drawing


def draw_drive(protocol: Protocol, panel: Axes) -> None:
    """Draw a drive over time with its parts."""
    drive = protocol.drive
    panel.plot(*thinned(drive.times, drive.values), color=COLOURS[0], lw=0.9)
    for number, part in enumerate(drive.parts):
        if number % 2:
            panel.axvspan(part.start, part.stop, color=BAND, alpha=0.5, lw=0, zorder=0)
        wide = part.stop - part.start > 0.1 * protocol.duration
        panel.annotate(
            part.name, (0.5 * (part.start + part.stop), 1.02), xycoords=("data", "axes fraction"),
            rotation=0 if wide else 35, ha="center" if wide else "left", va="bottom", fontsize=9,
        )  # fmt: skip
    panel.set(xlabel="time [s]", ylabel=f"drive [{pretty_unit(protocol.units[0])}]")
    panel.set_xlim(0, protocol.duration)


def _draw_fastest(protocol: Protocol, panel: Axes) -> None:
    """Draw the tones closer, or the fast path where there are none."""
    parts = {part.name: part for part in protocol.drive.parts}
    part = parts.get("tones") or parts["fast path"]
    times, values = protocol.drive.times, protocol.drive.values
    # The first level's tones, without the way there.
    length = (part.stop - part.start) / (3 if part.name == "tones" else 1)
    own = (times >= part.start + 0.3 * length) & (times < part.start + 0.5 * length)
    panel.plot(times[own], values[own], color=COLOURS[1], lw=0.8)
    panel.set(xlabel="time [s]", ylabel=f"{part.name} [{pretty_unit(protocol.units[0])}]")


@mpl.rc_context({**STYLE, "axes.grid.axis": "x"})
def draw_shown(shown: Sequence[Visible], span: float) -> Drawing:
    """Draw the smallest visible size of each effect, on a response of some span."""
    drawing, axes = canvas(1.0 + _ROW * len(shown))
    draw_visible({"": shown}, span, axes[0, 0])
    return drawing


def draw_visible(shown: Mapping[str, Sequence[Visible]], span: float, panel: Axes) -> None:
    """Draw the smallest visible size of each effect as bars, which end at the largest credible size
    where none is; of several designs one beside the other."""
    names = [one.effect for one in next(iter(shown.values()))]
    unit = next(iter(shown.values()))[0].unit
    largest = LARGEST * span
    height = 0.8 / len(shown)
    at = np.arange(len(names))
    colours = (BAND, COLOURS[0]) if len(shown) > 1 else (COLOURS[0],)
    for number, ((label, own), colour) in enumerate(zip(shown.items(), colours, strict=True)):
        sizes = {one.effect: one.size for one in own}
        ends = [sizes.get(name) or largest for name in names]
        places = at + (number - 0.5 * (len(shown) - 1)) * height
        hidden = [sizes.get(name) is None for name in names]
        panel.barh(
            places, ends, height=0.9 * height, label=label,
            color=["none" if none else colour for none in hidden],
            edgecolor=[MEASURED if none else colour for none in hidden],
            hatch=["///" if none else "" for none in hidden], lw=0.6,
        )  # fmt: skip
        for place, end, none, name in zip(places, ends, hidden, names, strict=True):
            text = "not at any size" if none else quantity(sizes[name] or 0.0, unit)
            panel.annotate(
                text, (end, place), (4, 0), textcoords="offset points", va="center", fontsize=9,
                bbox={"color": "white", "pad": 0.5},
            )  # fmt: skip
    panel.set_xscale("log")
    panel.set_yticks(at, names)
    panel.invert_yaxis()
    panel.grid(visible=False, axis="y")
    panel.set_xlim(right=4 * largest)
    panel.set_xlabel(f"smallest size that would be named [{pretty_unit(unit)} peak to peak]")
    if len(shown) > 1:
        panel.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0)
