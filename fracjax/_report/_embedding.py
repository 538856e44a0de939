"""Linked plots as part of a page that needs nothing else: BokehJS, their data, and how they start.

The same plots give the same text.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from bokeh.core.json_encoder import serialize_json
from bokeh.document import Document
from bokeh.resources import Resources
from markupsafe import Markup


def embedded(plots: Sequence[Any]) -> tuple[list[str], Markup]:
    """The id of the element for each plot, and the scripts that fill them."""
    document = Document()
    for plot in plots:
        document.add_root(plot)
    ids = [plot.id for plot in plots]
    text = serialize_json(document.to_json(deferred=False))
    # Bokeh numbers everything that a process ever makes.
    numbers: dict[str, str] = {}
    text = re.sub(r'"p(\d+)"', lambda m: f'"p{numbers.setdefault(m[1], str(len(numbers)))}"', text)
    elements = [f"p{numbers[name[1:]]}" for name in ids]
    start = [{"docid": "plots", "roots": {name: name for name in elements}, "root_ids": elements}]
    page = files("fracjax._report").joinpath("page.js").read_text("utf-8")
    scripts = (
        f"<script>{Resources('inline', components=['bokeh']).js_raw[0]}</script>\n"
        f'<script type="application/json" id="plots">{_safe(text)}</script>\n'
        f"<script>const START = {json.dumps(start)}\n{page}</script>"
    )
    return elements, Markup(scripts)


def _safe(text: str) -> str:
    """A script's text that does not end its element."""
    return text.replace("</", "<\\/")
