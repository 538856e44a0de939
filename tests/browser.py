"""A headless browser for tests of pages, offline, in which any error of a page fails the test."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

_PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
_OPTIONS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def require_browser() -> str:
    """The path of a browser; skips the test where there is none, unless FRACJAX_BROWSER asks for
    it, as `.ci/run` does."""
    path = next(filter(None, map(shutil.which, _PROGRAMS)), None)
    if path is None and os.environ.get("FRACJAX_BROWSER") != "required":
        pytest.skip(f"needs one of {', '.join(_PROGRAMS)} on the path")
    assert path is not None
    return path


@contextmanager
def opened(width: int, *, dark: bool = False, offline: bool = True) -> Iterator:
    """An empty page of Playwright; at the end the console must hold no error."""
    program = require_browser()
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    complaints: list[str] = []

    def complain(text: str, kind: str = "error") -> None:
        if kind in ("error", "warning"):
            complaints.append(text)

    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=list(_OPTIONS))
        context = browser.new_context(
            viewport={"width": width, "height": 900},
            color_scheme="dark" if dark else "light",
            offline=offline,
        )
        page = context.new_page()
        page.on("pageerror", lambda error: complain(str(error)))
        page.on("console", lambda said: complain(said.text, said.type))
        yield page
        browser.close()
    assert complaints == []
