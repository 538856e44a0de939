"""The report of an inverse for a loop: what it promises by frequency and height."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup

from .._show import quantity
from .._show.drawing import COLOURS, MEASURED, STYLE, canvas, svg
from .._streaming import Promise, Promised
from ._text import download

_NAME = "promise.json"


def promise_content(promise: Promise) -> dict[str, Any]:
    """The template's content."""
    headers, rows = promise.table()
    return {
        "title": f"The inverse of {promise.model} in a loop",
        "sentence": promise.sentence,
        "failures": promise.failures,
        "headers": headers,
        "rows": rows,
        "errors": _errors(promise),
        "downloads": [download(_NAME, promise.to_dict())],
    }


@mpl.rc_context(STYLE)
def _errors(promise: Promise) -> Markup:
    """Promised and simulated errors over frequency, by height."""
    drawing, axes = canvas(3.4)
    panel = axes[0, 0]
    by_height: dict[float, list[Promised]] = {}
    for row in promise.rows:
        by_height.setdefault(row.height, []).append(row)
    for colour, (height, rows) in zip(COLOURS, by_height.items(), strict=False):
        frequencies = [row.frequency for row in rows]
        label = f"simulated, {quantity(height, promise.unit)}"
        panel.loglog(
            frequencies, [100 * row.error for row in rows], "o-", color=colour, label=label
        )
        intervals = [row.interval for row in rows if row.interval is not None]
        if intervals:
            panel.fill_between(
                frequencies, *(100 * np.transpose(intervals)), color=colour, alpha=0.15, lw=0
            )
    linear = sorted({(row.frequency, 100 * row.linear) for row in promise.rows if row.linear})
    if linear:
        panel.loglog(
            *np.transpose(linear), "--", color=MEASURED, label="promised by the linear parts"
        )
    panel.set(xlabel="frequency [Hz]", ylabel="error, rms by the height [%]")
    panel.legend(loc="upper left")
    return svg(drawing)
