"""A BokehJS plot in the page's colours, light or dark, and what is drawn in it."""

from __future__ import annotations

from typing import Any

from ._bokehjs import Field, Model, Value

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
_SEEN_FAINTLY = 0.1
"""Opacity of a line beside what is brushed of it."""


def table(data: dict[str, Any], name: str | None = None) -> Model:
    """The columns that glyphs draw."""
    return Model("ColumnDataSource", name=name, data=data, selected=Model("Selection"))


def empty_plot(
    height: int, labels: tuple[str, str], x_range: Model, logarithmic: str = ""
) -> Model:
    """An empty plot as wide as the page.

    `height` in pixels, `labels` of both axes; `logarithmic`: "x", "y", "xy", or none of them.
    """
    x, y = (_axis(label, name in logarithmic) for name, label in zip("xy", labels, strict=True))
    return Model(
        "Figure",
        height=height,
        sizing_mode="stretch_width",
        x_range=x_range,
        y_range=Model("DataRange1d", only_visible=True),
        below=[x],
        left=[y],
        center=[Model("Grid", axis=x), Model("Grid", axis=y, dimension=1)],
        renderers=[],
        title=Model("Title", text="", text_font_size="13px", text_font_style="normal"),
        toolbar=Model("Toolbar", tools=[], logo=None, autohide=True),
        toolbar_location="right",
        stylesheets=[_STYLESHEET],
        min_border_left=_BESIDE,
        min_border_right=12,
        **{f"{name}_scale": Model("LogScale") for name in logarithmic},
    )


def _axis(label: str, is_logarithmic: bool) -> Model:
    """An axis with its label."""
    texts = {"axis_label_text_font_size": "13px", "major_label_text_font_size": "12px"}
    if is_logarithmic:
        return Model("LogAxis", axis_label=label, **texts)
    # Millivolts and nanometres reach 10^5, which are read more easily than 2.000e+4.
    formatter = Model("BasicTickFormatter", power_limit_high=7)
    return Model("LinearAxis", axis_label=label, formatter=formatter, **texts)


def plot_to_enlarge(
    height: int, labels: tuple[str, str], title: str = "", logarithmic: str = ""
) -> Model:
    """An empty plot that can be enlarged."""
    plot = empty_plot(height, labels, Model("DataRange1d"), logarithmic)
    plot.title.text = title
    plot.toolbar.tools += map(Model, ("BoxZoomTool", "PanTool", "ResetTool", "SaveTool"))
    return plot


def draw_line(
    plot: Model, source: Model, x: str, y: str, style: dict[str, Any], **shown: Any
) -> Model:
    """Draw a column over another as a line; `style`: its properties, `shown`: the renderer's."""
    glyph = Model("Line", x=Field(x), y=Field(y), **style)
    return draw(
        plot, source, glyph, nonselection_glyph=glyph.like(line_alpha=_SEEN_FAINTLY), **shown
    )


def draw(plot: Model, source: Model, glyph: Model, **shown: Any) -> Model:
    """Draw each row of a table as a glyph, and return the renderer; `shown`: its properties."""
    renderer = Model(
        "GlyphRenderer", data_source=source, glyph=glyph, view=Model("CDSView"), **shown
    )
    plot.renderers.append(renderer)
    return renderer


def draw_reach(
    plot: Model, source: Model, x: str, ends: tuple[str, str], colour: str, name: str
) -> None:
    """Draw the area between two columns over another, behind everything else."""
    low, high = map(Field, ends)
    area = Model("VArea", x=Field(x), y1=low, y2=high, **one(fill_color=colour))
    draw(plot, source, area.like(fill_alpha=_SEEN_FAINTLY), name=name, level="underlay")


def draw_band(plot: Model, low: float, high: float) -> None:
    """Draw the band between two levels of what noise alone causes."""
    band = {"fill_alpha": 0.2, "line_color": MEASURED, "line_dash": "dashed"}
    _draw_box(plot, bottom=low, top=high, **band)


def draw_stretch(plot: Model, start: float, stop: float) -> None:
    """Draw a stretch along the x axis."""
    _draw_box(plot, left=start, right=stop, fill_alpha=0.12, line_color=None)


def _draw_box(plot: Model, **properties: Any) -> None:
    """Draw a box below all else; `properties` are its own."""
    plot.center.append(Model("BoxAnnotation", level="underlay", fill_color=MEASURED, **properties))


def draw_level(plot: Model, level: float, dimension: str) -> None:
    """Draw a level as a dashed line in the colour of the page's text, along the plot's "width" or
    its "height"."""
    ink = {"--bk-line-color": "var(--ink)"}
    line = Model("Span", location=level, dimension=dimension, line_dash="dashed", css_variables=ink)
    plot.center.append(line)


def one(**values: Any) -> dict[str, Value]:
    """Properties of a glyph that are the same for all rows."""
    return {name: Value(value) for name, value in values.items()}
