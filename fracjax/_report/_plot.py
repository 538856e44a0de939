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


def empty_plot(height: int, labels: tuple[str, str], x_range: Model) -> Model:
    """An empty plot as wide as the page; `height` in pixels, `labels` of both axes."""
    x, y = (
        Model(
            "LinearAxis",
            axis_label=label,
            axis_label_text_font_size="13px",
            major_label_text_font_size="12px",
            # Millivolts and nanometres reach 10^5, which are read more easily than 2.000e+4.
            formatter=Model("BasicTickFormatter", power_limit_high=7),
        )
        for label in labels
    )
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
    )


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
    plot.center.append(
        Model(
            "BoxAnnotation",
            bottom=low,
            top=high,
            level="underlay",
            fill_color=MEASURED,
            line_color=MEASURED,
            fill_alpha=0.2,
            line_dash="dashed",
        )
    )


def one(**values: Any) -> dict[str, Value]:
    """Properties of a glyph that are the same for all rows."""
    return {name: Value(value) for name, value in values.items()}
