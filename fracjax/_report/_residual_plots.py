"""Plots of the tests of a residual: its distribution, correlations, and level over time."""

from __future__ import annotations

import numpy as np

from .._fit import ResidualAnalysis
from .._show import COLOURS
from ._bokehjs import Field, Model
from ._plot import MEASURED, draw, draw_band, draw_line, one, plot_to_enlarge, table

PLOTS = 4
"""Plots of one residual."""
_HEIGHT = 240


def residual_plots(analysis: ResidualAnalysis) -> list[Model]:
    """The plots of one recording's residual, in units of the noise."""
    lags = analysis.autocorrelation.size
    return [
        _distribution(analysis),
        _correlation(
            "autocorrelation",
            np.arange(1, lags + 1),
            analysis.autocorrelation,
            analysis.band,
        ),
        _correlation(
            "correlation with the drive, which leads at positive lags",
            np.arange(-lags, lags + 1),
            analysis.cross_correlation,
            analysis.cross_band,
        ),
        _level(analysis),
    ]


def _distribution(analysis: ResidualAnalysis) -> Model:
    """The histogram, and the density of the normal distribution."""
    plot = plot_to_enlarge(_HEIGHT, ("residual over noise", "density"), "distribution")
    edges, densities = analysis.histogram()
    bars = table({"left": edges[:-1], "right": edges[1:], "top": densities})
    sides = {side: Field(side) for side in ("left", "right", "top")}
    draw(
        plot, bars, Model("Quad", **sides, **one(bottom=0, fill_color=COLOURS[1], line_color=None))
    )
    normal = table({"x": edges, "y": np.exp(-(edges**2) / 2) / np.sqrt(2 * np.pi)})
    draw_line(plot, normal, "x", "y", {"line_color": MEASURED, "line_width": 1.6})
    return plot


def _correlation(title: str, lags: np.ndarray, values: np.ndarray, band: float) -> Model:
    """Correlations (L,) over lags (L,), with the band of ± `band`."""
    plot = plot_to_enlarge(_HEIGHT, ("lag [samples]", ""), title)
    top = 1.15 * max(float(np.abs(values).max()), 2 * band)
    plot.y_range = Model("Range1d", start=-top, end=top)
    draw_band(plot, -band, band)
    stems = table({"lag": lags.astype(float), "zero": np.zeros(lags.size), "value": values})
    ends = {"x0": "lag", "x1": "lag", "y0": "zero", "y1": "value"}
    fields = {end: Field(column) for end, column in ends.items()}
    draw(plot, stems, Model("Segment", **fields, **one(line_color=COLOURS[1], line_width=2)))
    return plot


def _level(analysis: ResidualAnalysis) -> Model:
    """The standard deviation in stretches of time."""
    title = "standard deviation over time, in units of the noise"
    plot = plot_to_enlarge(_HEIGHT, ("time [s]", ""), title)
    low, high = analysis.spread_band()
    draw_band(plot, low, high)
    highest = float(np.nanmax([high, *analysis.spreads]))
    plot.y_range = Model("Range1d", start=0, end=1.2 * highest)
    times = np.repeat(analysis.edges, 2)[1:-1]
    stairs = table({"time": times, "level": np.repeat(analysis.spreads, 2)})
    draw_line(plot, stairs, "time", "level", {"line_color": COLOURS[1], "line_width": 2})
    return plot
