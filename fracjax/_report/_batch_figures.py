"""The figure of a batch: every parameter of every recording."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from .._batch import Spread
from .._show import pretty_unit
from .._show.drawing import COLOURS, MEASURED, STYLE, canvas, svg

_HEIGHT = 1.6
"""Height of a panel [inch]."""


def distributions(spreads: Sequence[Spread], listed: np.ndarray) -> Markup:
    """Values over the recordings' numbers, one panel each, next to their distribution.

    Each point links to the recording's row, whose anchor is `row-` and its number; outliers are
    coloured.  `listed` are the recordings that have such a row.
    """
    if not spreads:
        return Markup("")
    with mpl.rc_context(STYLE):
        drawing, panels = canvas(
            _HEIGHT * len(spreads), len(spreads), 2, width_ratios=(4, 1), sharey="row"
        )
        for (panel, side), each in zip(panels, spreads, strict=True):
            _draw(panel, side, each, listed[np.isfinite(each.values[listed])])
        panels[-1, 0].set_xlabel("recording")
        # Recordings are numbered, and there is none and a half.
        panels[-1, 0].xaxis.get_major_locator().set_params(integer=True)
        panels[-1, 1].set_xlabel("recordings")
        return svg(drawing)


def _draw(panel: Axes, side: Axes, each: Spread, shown: np.ndarray) -> None:
    """One parameter of the recordings `shown` (R,), and next to it the distribution of all."""
    values, half = each.values[shown], 1.96 * each.errors[shown]
    panel.errorbar(shown, values, half, fmt="none", ecolor="#BBBBBB", lw=0.7)
    colours = np.where(each.outlying[shown], COLOURS[0], MEASURED)
    points = panel.scatter(shown, values, s=9, c=list(colours), zorder=3)
    points.set_urls([f"#row-{at}" for at in shown])
    panel.set_title(f"{each.name} [{pretty_unit(each.unit) or '1'}]")
    # An offset such as 1e-8 + 1.08e-2 would hide that the values are alike.
    panel.ticklabel_format(axis="y", useOffset=False)
    every = each.values[np.isfinite(each.values)]
    # Values that are alike but for rounding span no thirty bins.
    alike = np.ptp(every) <= 1e-9 * np.abs(every).max() if every.size else True
    side.hist(every, 1 if alike else 30, orientation="horizontal", color=COLOURS[1])
