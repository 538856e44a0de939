"""What the page says of an inverse in a loop."""

from types import SimpleNamespace

import numpy as np

from fracjax import Recording, blocks, fit, write
from fracjax._app._page import _Page
from fracjax._app._workspace import Workspace
from fracjax._models import Model

TIMES = 0.01 * np.arange(400)
DRIVE = 50 - 50 * np.cos(2 * np.pi * TIMES)


def ended(page: _Page) -> None:
    """Wait for the computation, and take its result."""
    assert page.job is not None
    page.job._thread.join(60)
    assert not page.job.running
    page._look()


def test_a_fit_has_its_promise_on_the_page(tmp_path):
    columns = {"time_s": TIMES, "voltage_V": DRIVE, "displacement_um": 0.1 * DRIVE}
    write(tmp_path / "loop.csv", columns)
    page = _Page(Workspace(tmp_path))
    assert page.in_a_loop.disabled
    noise = 1e-3 * np.random.default_rng(1).standard_normal(TIMES.size)
    recording = Recording(DRIVE, 0.1 * DRIVE + noise, 0.01, "V", "um", source="loop.csv")
    page._take(fit(Model(blocks.Gain(0.1), "gain"), recording, starts=1))
    assert not page.in_a_loop.disabled
    page.slew.value = "5 V/ms"
    page._begin("promise")
    ended(page)
    assert "misses a sine by" in page.promise.object
    assert "followed up to 15.9 Hz" in page.promise.object
    page.slew.value = "5 um"
    page._begin("promise")
    assert page.message.visible
    assert "slew limit: expected a value in V/s" in page.message.object
    assert page.job is None
    page.slew.value, page.loop_step.value = "", "0 s"
    page._begin("promise")
    ended(page)
    assert "a time above 0 s" in page.stage.value


def test_an_upload_of_a_name_that_is_taken_asks(tmp_path):
    (tmp_path / "loop.csv").write_bytes(b"first")
    page = _Page(Workspace(tmp_path))
    page._upload(SimpleNamespace(new={"loop.csv": "second", "other.csv": b"third"}))
    assert (tmp_path / "loop.csv").read_bytes() == b"first"
    assert (tmp_path / "other.csv").read_bytes() == b"third"
    assert page.replace.visible
    assert "Replace loop.csv" in page.replace.label
    page.replace.clicks += 1
    assert (tmp_path / "loop.csv").read_bytes() == b"second"
    assert not page.replace.visible
