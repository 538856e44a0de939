"""The report of a cross-check."""

from __future__ import annotations

from typing import Any

from .._crosscheck import Crosscheck
from ._fit_page import fit_content
from ._text import crosscheck_figures, crosscheck_sentence, download, sources


def crosscheck_content(crosscheck: Crosscheck) -> dict[str, Any]:
    """The content of the report of the gradient fit, with the table of methods as key figures."""
    content = fit_content([crosscheck.fit])
    headers, rows = crosscheck_figures(crosscheck)
    attached = download("crosscheck.json", crosscheck.to_dict())
    changes = {
        "title": f"Cross-check of {sources(crosscheck.fit)}",
        "sentence": crosscheck_sentence(crosscheck),
        "headers": headers,
        "rows": rows,
        "downloads": [attached, *content["downloads"]],
    }
    if crosscheck.warning is not None:
        changes |= {"badge": "not at the optimum", "verdict": "unexplained"}
    return content | changes
