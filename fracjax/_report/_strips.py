"""The strips of a diagnosis: along each axis, in equal bins, how strong the mismatch is."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .._show import COLOURS, p_value, pretty_unit, rounded_edges
from ._bokehjs import Field, Model
from ._plot import BRUSHED, MEASURED, draw, draw_line, empty_plot, one, table

if TYPE_CHECKING:
    from .._diagnose import Axis

_MOST_LABELS = 7
"""Most numbers below a strip, which fit on a phone."""
_NAMES = {
    "time": "time",
    "phase": "phase of the cycle",
    "frequency": "frequency",
    "level": "drive",
    "rate": "rate of the drive",
    "reversal": "time since reversal",
    "harmonics": "harmonic of the drive",
}


class Strip(NamedTuple):
    """The strip of an axis and the table of its bins, which has the axis' name."""

    plot: Model
    bins: Model


def strips(axes: Sequence[Axis]) -> list[Strip]:
    """One strip per axis, darker where the mismatch is stronger.

    Brackets mark the intervals where it is significant.
    """
    strongest = max(float(axis.strength.max()) for axis in axes)
    return [_strip(axis, strongest) for axis in axes]


def _strip(axis: Axis, strongest: float) -> Strip:
    """One strip; its darkest bins would have the strength `strongest`."""
    count, unit = axis.strength.size, pretty_unit(axis.unit)
    label = _NAMES[axis.axis] + (f" [{unit}]" if unit else "")
    if axis.axis == "harmonics":
        texts = [f"{order:.0f}" for order in axis.edges[:-1] + 0.5]
        places, spans = np.arange(count) + 0.5, texts
    else:
        texts = rounded_edges(axis.edges.tolist())
        places = np.arange(count + 1.0)
        spans = [f"{low} to {high} {unit}" for low, high in pairwise(texts)]
    bins = table(
        {
            "start": np.arange(count, dtype=np.float32),
            "stop": np.arange(1, count + 1, dtype=np.float32),
            "strength": axis.strength.astype(np.float32),
            "shade": np.clip(axis.strength / strongest, 0, 1).astype(np.float32),
            "span": spans,
        },
        axis.axis,
    )
    plot = empty_plot(86, ("", ""), Model("Range1d", start=0, end=count))
    plot.title.text = f"{label}, {p_value(axis.p_value)}"
    plot.y_range = Model("Range1d", start=-0.02, end=1.45)
    for hidden in (*plot.left, *plot.center):
        hidden.visible = False
    plot.min_border_left = plot.min_border_right = 24
    _draw(plot, bins, label)
    for interval in axis.intervals:
        low, high = np.interp(interval, axis.edges, np.arange(count + 1)).tolist()
        corners = [low + 0.08, low + 0.08, high - 0.08, high - 0.08]
        bracket = table({"x": corners, "y": [1.12, 1.32, 1.32, 1.12]})
        draw_line(plot, bracket, "x", "y", {"line_color": COLOURS[0], "line_width": 2})
    _label(plot, places, texts)
    return Strip(plot, bins)


def _draw(plot: Model, bins: Model, label: str) -> None:
    """Draw the bins, and let them be brushed and pointed at."""
    quad = Model(
        "Quad",
        left=Field("start"),
        right=Field("stop"),
        fill_alpha=Field("shade"),
        **one(bottom=0, top=1, fill_color=COLOURS[1], line_color=MEASURED, line_alpha=0.6),
    )
    brushed = quad.like(**one(line_color=BRUSHED, line_width=3, line_alpha=1))
    quads = draw(plot, bins, quad, selection_glyph=brushed, nonselection_glyph=quad.like())
    select = Model("BoxSelectTool", dimensions="width", renderers=[quads])
    said = [(label, "@span"), ("|z|", "@strength{0.0}")]
    hover = Model("HoverTool", renderers=[quads], tooltips=said)
    plot.toolbar.tools += [select, Model("TapTool", renderers=[quads]), hover]
    plot.toolbar.active_drag = select
    plot.toolbar_location = None


def _label(plot: Model, places: np.ndarray, texts: Sequence[str]) -> None:
    """Write texts below a strip at places (n,), no more than fit and none twice."""
    every = -(-len(texts) // _MOST_LABELS)
    labels: dict[float, str] = {}
    for place, text in list(zip(places.tolist(), texts, strict=True))[::every]:
        if text not in labels.values():
            labels[place] = text
    (below,) = plot.below
    below.ticker = Model("FixedTicker", ticks=list(labels), minor_ticks=[])
    below.major_label_overrides = labels
    below.axis_line_color = None
