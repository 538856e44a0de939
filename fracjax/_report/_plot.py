"""An empty BokehJS plot in the page's colours, light or dark."""

from __future__ import annotations

from typing import Any

from bokeh.models import BasicTickFormatter, DataRange1d, Range1d, Title
from bokeh.plotting import figure as bokeh_figure

MEASURED = "#8A8F98"
BRUSHED = "#E6007E"
_BESIDE = 66
"""Pixels on the left of a plot, so that those below each other begin at one line."""
# The page's colours reach the plots as CSS variables.
_STYLESHEET = """
:host {
  --bk-background-fill-color: transparent; --bk-border-fill-color: transparent;
  --bk-outline-line-color: transparent; --bk-grid-line-color: var(--line);
  --bk-axis-line-color: var(--soft); --bk-major-tick-line-color: var(--soft);
  --bk-minor-tick-line-color: transparent; --bk-major-label-text-color: var(--ink);
  --bk-axis-label-text-color: var(--ink); --bk-axis-label-text-font-style: normal;
  --bk-text-color: var(--ink);
}
"""


def empty_plot(height: int, labels: tuple[str, str], x_range: DataRange1d | Range1d) -> Any:
    """An empty plot as wide as the page; `height` in pixels, `labels` of both axes."""
    plot: Any = bokeh_figure(
        height=height,
        sizing_mode="stretch_width",
        x_range=x_range,
        y_range=DataRange1d(only_visible=True),
        x_axis_label=labels[0],
        y_axis_label=labels[1],
        title=Title(text="", text_font_size="13px", text_font_style="normal"),
        tools="",
        toolbar_location="right",
        stylesheets=[_STYLESHEET],
        min_border_left=_BESIDE,
        min_border_right=12,
    )
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    plot.axis.axis_label_text_font_size = "13px"
    plot.axis.major_label_text_font_size = "12px"
    # Millivolts and nanometres reach 10^5, which are read more easily than 2.000e+4.
    plot.axis.formatter = BasicTickFormatter(power_limit_high=7)
    return plot
