"""Linked plots as part of a page that needs nothing else: BokehJS, their data, and how they start.

The same plots give the same text.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from markupsafe import Markup

from ._bokehjs import Model, document_of


class PlottedFigure(NamedTuple):
    """Plots side by side, and below them what their lines and bars are: name, colour, and how such
    a line is drawn in CSS."""

    plots: Sequence[Model]
    legend: Sequence[tuple[str, str, str]] = ()


def embedded(plots: Sequence[Model]) -> tuple[list[str], Markup]:
    """The id of the element for each plot, and the scripts that fill them."""
    elements = [f"p{index}" for index in range(len(plots))]
    start = [{"docid": "plots", "roots": {name: name for name in elements}, "root_ids": elements}]
    page = files("fracjax._report").joinpath("page.js").read_text("utf-8")
    scripts = (
        f"<script>{_library()}</script>\n"
        f'<script type="application/json" id="plots">{_safe(document_of(plots, "p"))}</script>\n'
        f"<script>const START = {json.dumps(start)}\n{page}</script>"
    )
    return elements, Markup(scripts)


def placed(figures: Mapping[str, PlottedFigure], elements: Iterable[str]) -> dict[str, Any]:
    """By name the elements of a figure's plots, of those of all in their order, and its legend."""
    each = iter(elements)
    return {
        name: {"elements": [*islice(each, len(figure.plots))], "legend": figure.legend}
        for name, figure in figures.items()
    }


def _library() -> str:
    """BokehJS, which is part of Bokeh's distribution; it is read without importing that."""
    bokeh = find_spec("bokeh")
    assert bokeh is not None
    assert bokeh.origin is not None
    folder = Path(bokeh.origin).parent / "server" / "static" / "js"
    return folder.joinpath("bokeh.min.js").read_text("utf-8")


def _safe(text: str) -> str:
    """A script's text that does not end its element."""
    return text.replace("</", "<\\/")
