"""The report in a browser: it draws, brushes and hides, on a phone, in the dark, and on paper."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from fracjax._diagnose import Diagnosis
from fracjax._report import write_report
from tests.browser import opened, require_browser

_STATE = """() => {
  const tables = {}, visible = {}
  for (const plot of Bokeh.documents[0].roots())
    for (const renderer of plot.renderers) {
      const source = renderer.data_source
      const name = source.name ?? (renderer.name === null ? null : "samples")
      if (name) tables[name] = source.selected.indices
      if (renderer.name) visible[renderer.name] = renderer.visible
    }
  return {tables, visible}
}"""


@pytest.fixture(scope="module")
def report(diagnosis: Diagnosis, tmp_path_factory: pytest.TempPathFactory) -> Path:
    require_browser()
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(diagnosis, path)
    return path


@pytest.fixture(params=[(400, False), (1100, True)], ids=["phone", "dark"])
def page(request: pytest.FixtureRequest, report: Path) -> Iterator:
    width, dark = request.param
    with opened(width, dark=dark) as page:
        page.goto(report.as_uri())
        page.wait_for_selector("html[data-plots=drawn]")
        yield page


def drag(page, number: int, start: float, stop: float) -> None:
    """Drag across a plot, from and to shares of its width."""
    plot = page.locator(f"#p{number}")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    middle = box["y"] + 0.5 * box["height"]
    page.mouse.move(box["x"] + start * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + stop * box["width"], middle, steps=4)
    page.mouse.up()
    page.wait_for_timeout(300)


def test_a_brush_shows_everywhere(page):
    """A stretch of time marks its bins, and a bin of a strip its samples; Esc ends the brush."""
    drag(page, 0, 0.5, 0.75)
    tables = page.evaluate(_STATE)["tables"]
    samples = tables["samples"]
    assert 40 < len(samples) < 200
    assert samples == list(range(samples[0], samples[-1] + 1))
    step = 0.01
    assert tables["time"] == sorted({int(i * step / 0.5) for i in samples})
    assert "brushed" in page.evaluate("Bokeh.documents[0].roots()[1].title.text")

    strip = page.locator("#p5")
    strip.scroll_into_view_if_needed()
    box = strip.bounding_box()
    # The third of the eight bins, each of half a second.
    inner = box["width"] - 48
    page.mouse.click(box["x"] + 24 + 2.5 / 8 * inner, box["y"] + 0.55 * box["height"])
    page.wait_for_timeout(300)
    tables = page.evaluate(_STATE)["tables"]
    assert tables["time"] == [2]
    assert tables["samples"] == list(range(100, 150))

    page.keyboard.press("Escape")
    page.wait_for_timeout(300)
    assert page.evaluate(_STATE)["tables"]["samples"] == []


def test_a_box_hides_its_model_in_every_plot(page):
    page.locator("input[data-layer=model_0]").uncheck()
    visible = page.evaluate(_STATE)["visible"]
    models = {"measured": True, "drive": True, "model_0": False, "model_1": True}
    assert visible == models | {f"candidate_{k}": False for k in range(4)}
    page.locator("input[data-layer=candidate_1]").check()
    assert page.evaluate(_STATE)["visible"]["candidate_1"]


def test_nothing_is_wider_than_the_page_and_colours_follow_the_scheme(page):
    width = page.viewport_size["width"]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    ink = page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--ink')")
    dark = page.evaluate("matchMedia('(prefers-color-scheme: dark)').matches")
    assert ink == ("#e4e7eb" if dark else "#1b1f24")


def test_it_prints_on_white_paper(page):
    """Paper gets pictures of the plots, and they go when it is printed."""
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    count = page.locator(".plot").count()
    assert page.locator(".picture").count() == count
    ink = page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--ink')")
    assert ink == "#1b1f24"
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.locator(".picture").count() == 0
