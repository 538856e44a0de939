"""The strips of a diagnosis: along each axis, in equal bins, how strong the mismatch is."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from bokeh.models import (
    BoxSelectTool,
    ColumnDataSource,
    FixedTicker,
    HoverTool,
    Range1d,
    TapTool,
)

from .._diagnose import Axis
from .._show import p_value, pretty_unit, rounded_edges
from .._show.drawing import COLOURS
from ._plot import BRUSHED, MEASURED, empty_plot

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

    plot: Any
    bins: ColumnDataSource


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
    bins = ColumnDataSource(
        {
            "start": np.arange(count, dtype=np.float32),
            "stop": np.arange(1, count + 1, dtype=np.float32),
            "strength": axis.strength.astype(np.float32),
            "shade": np.clip(axis.strength / strongest, 0, 1).astype(np.float32),
            "span": spans,
        },
        name=axis.axis,
    )
    plot = empty_plot(86, ("", ""), Range1d(start=0, end=count))
    plot.title.text = f"{label}, {p_value(axis.p_value)}"
    plot.y_range = Range1d(start=-0.02, end=1.45)
    plot.yaxis.visible = plot.grid.visible = False
    plot.min_border_left = plot.min_border_right = 24
    _draw(plot, bins, label)
    for interval in axis.intervals:
        low, high = np.interp(interval, axis.edges, np.arange(count + 1))
        corners = [low + 0.08, low + 0.08, high - 0.08, high - 0.08]
        plot.line(corners, [1.12, 1.32, 1.32, 1.12], line_color=COLOURS[0], line_width=2)
    _label(plot, places, texts)
    return Strip(plot, bins)


def _draw(plot: Any, bins: ColumnDataSource, label: str) -> None:
    """Draw the bins, and let them be brushed and pointed at."""
    quads = plot.quad(
        left="start", right="stop", bottom=0, top=1, source=bins,
        fill_color=COLOURS[1], fill_alpha="shade", line_color=MEASURED, line_alpha=0.6,
    )  # fmt: skip
    quads.nonselection_glyph = quads.glyph.clone()
    quads.selection_glyph = quads.glyph.clone(line_color=BRUSHED, line_width=3, line_alpha=1)
    select = BoxSelectTool(dimensions="width", renderers=[quads])
    hover = HoverTool(renderers=[quads], tooltips=[(label, "@span"), ("|z|", "@strength{0.0}")])
    plot.add_tools(select, TapTool(renderers=[quads]), hover)
    plot.toolbar.active_drag = select
    plot.toolbar_location = None


def _label(plot: Any, places: np.ndarray, texts: Sequence[str]) -> None:
    """Write texts below a strip at places (n,), no more than fit and none twice."""
    every = -(-len(texts) // _MOST_LABELS)
    labels: dict[float, str] = {}
    for place, text in list(zip(places.tolist(), texts, strict=True))[::every]:
        if text not in labels.values():
            labels[place] = text
    plot.xaxis.ticker = FixedTicker(ticks=list(labels))
    plot.xaxis.major_label_overrides = labels
    plot.xaxis.axis_line_color = None
