"""Pages from their templates."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2

from .._show import figure, percent, quantity
from ._text import opening


def write_page(template: str, content: dict[str, Any], path: str | Path) -> None:
    """Write a page from its template and content."""
    page = _environment().get_template(template).render(content)
    Path(path).write_text(page, encoding="utf-8")


def _environment() -> jinja2.Environment:
    """The templates, with filters for numbers and units."""
    folder = files("fracjax._report")
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: folder.joinpath(name).read_text("utf-8")),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(figure=figure, opening=opening, percent=percent, quantity=quantity)
    return environment
