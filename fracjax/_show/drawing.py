"""Pictures: one style, and the parts that several of them use.  It needs matplotlib."""

from __future__ import annotations

import io
import re
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ._colours import CANDIDATES as CANDIDATES
from ._colours import COLOURS as COLOURS
from ._colours import MEASURED as MEASURED

BAND = "#DDDDDD"
WIDTH = 10.4
DENSE = 4000
"""Longer recordings are drawn as pixels, which keep the file small."""
MOST_POINTS = 20_000
"""Most points of a loop."""
STYLE: dict[Any, Any] = {
    "font.size": 11,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#EEEEEE",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "svg.fonttype": "none",
    "svg.hashsalt": "fracjax",
}


class Drawing(Figure):
    """A matplotlib figure that a notebook shows, and that `show` opens in a window.

    pyplot does not know it until then, so that a notebook does not show it twice and a script that
    draws many need not close them.
    """

    def _repr_png_(self) -> bytes:
        """What a notebook shows."""
        file = io.BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()

    def show(self, warn: bool = True) -> None:
        """Open the figure in a window, if there is a display.

        Args:
            warn: As in matplotlib.
        """
        import matplotlib.pyplot as plt

        plt.figure(self)
        super().show(warn)


def canvas(height: float, rows: int = 1, columns: int = 1, **shared) -> tuple[Drawing, np.ndarray]:
    """An empty figure of this height [inch] and its axes, shape (rows, columns)."""
    drawing = Drawing(figsize=(WIDTH, height), layout="constrained", dpi=150)
    FigureCanvasAgg(drawing)
    return drawing, drawing.subplots(rows, columns, squeeze=False, **shared)


def svg(drawing: Figure) -> Markup:
    """The figure as an <svg> element that scales with the page."""
    file = io.StringIO()
    with mpl.rc_context(STYLE):
        drawing.savefig(file, format="svg", metadata={"Date": None})
    text = file.getvalue()
    return Markup(re.sub(r"\s+", " ", text[text.index("<svg") :]))


def thinned(x: np.ndarray, y: np.ndarray, bins: int = 1500) -> tuple[np.ndarray, np.ndarray]:
    """A long series (N,) reduced to the extremes of its bins, which looks the same on a screen."""
    if x.size <= 2 * bins:
        return x, y
    starts = np.linspace(0, x.size, bins, endpoint=False).astype(int)
    pieces = np.split(y, starts[1:])
    lowest = starts + [piece.argmin() for piece in pieces]
    highest = starts + [piece.argmax() for piece in pieces]
    chosen = np.unique([lowest, highest])
    return x[chosen], y[chosen]


def noise_band(axes: Axes, sigma: float) -> None:
    """Draw the band of ±2 standard deviations of the noise."""
    axes.axhspan(-2 * sigma, 2 * sigma, color=BAND, lw=0)
    for edge in (-2 * sigma, 2 * sigma):
        axes.axhline(edge, color=MEASURED, lw=0.8, ls="--", zorder=3)
