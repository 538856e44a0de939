"""Pictures of a designed drive, and of what a recording can show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from .._path import LARGEST, Visible
from .._show import pretty_unit, quantity
from .._show.drawing import BAND, COLOURS, MEASURED, STYLE, Drawing, canvas, thinned
from ._drive import Drive

_ROW = 0.3
"""Height of a bar [inch]."""
_WIDE = 0.1
"""The share of a drive from which a part has room for its name."""


@mpl.rc_context(STYLE)
def draw_protocol(
    drive: Drive, shown: Mapping[str, Sequence[Visible]], stroke: float, unit: str
) -> Drawing:
    """Draw a drive [unit] over time with its parts, the fastest of them once more, and what is
    shown of a response of some stroke."""
    rows = len(next(iter(shown.values())))
    drawing, axes = canvas(
        5.6 + _ROW * rows, 3, 1, gridspec_kw={"height_ratios": (3, 2, 0.8 + _ROW * rows)}
    )
    whole, part, bars = axes[:, 0]
    _draw_drive(drive, unit, whole)
    _draw_fastest(drive, unit, part)
    _draw_visible(shown, stroke, bars)
    return drawing


def _draw_drive(drive: Drive, unit: str, panel: Axes) -> None:
    """Draw a drive over time with its parts."""
    panel.plot(*thinned(drive.times, drive.values), color=COLOURS[0], lw=0.9)
    whole = float(drive.times[-1])
    for number, part in enumerate(drive.parts):
        if number % 2:
            panel.axvspan(part.start, part.stop, color=BAND, alpha=0.5, lw=0, zorder=0)
        wide = part.stop - part.start > _WIDE * whole
        panel.annotate(
            part.name, (0.5 * (part.start + part.stop), 1.02), xycoords=("data", "axes fraction"),
            rotation=0 if wide else 35, ha="center" if wide else "left", va="bottom", fontsize=9,
        )  # fmt: skip
    panel.set(xlabel="time [s]", ylabel=f"drive [{pretty_unit(unit)}]")
    panel.set_xlim(0, whole)


def _draw_fastest(drive: Drive, unit: str, panel: Axes) -> None:
    """Draw some of the tones closer, or of the fast path where there are none."""
    parts = {part.name: part for part in drive.parts}
    part = parts.get("tones") or parts["fast path"]
    length = part.stop - part.start
    # Of the first level's tones, behind the way there.
    own = (drive.times >= part.start + 0.1 * length) & (drive.times < part.start + 0.16 * length)
    panel.plot(drive.times[own], drive.values[own], color=COLOURS[1], lw=0.8)
    panel.set(xlabel="time [s]", ylabel=f"{part.name} [{pretty_unit(unit)}]")


def _draw_visible(shown: Mapping[str, Sequence[Visible]], span: float, panel: Axes) -> None:
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
    smallest = min(size for own in shown.values() for one in own if (size := one.size or largest))
    panel.set_xlim(0.5 * smallest, 4 * largest)
    panel.set_xlabel(f"smallest size that would be named [{pretty_unit(unit)} peak to peak]")
    if len(shown) > 1:
        panel.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0)
