"""The page in a browser: from a dropped file through its plots and a diagnosis to the report."""

import threading

import pytest

from fracjax import write
from fracjax._io import read_drive
from tests.browser import opened, require_browser
from tests.results import diagnosis_of, small_fit


@pytest.fixture(scope="module")
def diagnosis():
    require_browser()
    return diagnosis_of(small_fit())


def test_from_a_file_to_the_report(served, diagnosis, tmp_path, monkeypatch):
    recording = diagnosis.base.preparation.takes[0].recording
    file = tmp_path / "loop.csv"
    write(
        file,
        {
            "time_s": recording.times,
            "voltage_V": recording.drive,
            "displacement_um": recording.response,
        },
    )
    go_on, given = threading.Event(), {}

    def diagnose(model, recordings, *, progress, **options):
        given.update(options, model=model, recordings=recordings)
        progress("testing the residual")
        while not go_on.wait(0.05):
            progress("testing the residual")
        return diagnosis

    monkeypatch.setattr("fracjax._diagnose.diagnose", diagnose)
    with opened(1100, offline=False) as page:
        page.set_default_timeout(20_000)
        addresses = []
        page.on(
            "request",
            lambda request: addresses.append(request.url),
        )
        page.goto(served.address)
        page.set_input_files("input[type=file]", file)
        page.get_by_text("400 samples at 100 Hz").wait_for()
        assert not page.get_by_text("fracjax is starting.").is_visible()
        assert (served.folder / "loop.csv").read_bytes() == file.read_bytes()

        # A stretch is brushed and left out.
        plot = page.locator(".bk-Figure").first
        plot.wait_for()
        box = plot.bounding_box()
        page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        page.mouse.down()
        page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"], steps=4)
        page.mouse.up()
        page.get_by_text("Leave out what is brushed").click()
        page.get_by_text("left out:").wait_for()

        # A diagnosis is stopped, and another ends.
        page.get_by_role("button", name="Diagnose").click()
        page.get_by_text("testing the residual").wait_for()
        page.get_by_role("button", name="Stop").click()
        page.get_by_text("stopped", exact=True).wait_for()
        go_on.set()
        page.get_by_role("button", name="Diagnose").click()
        page.get_by_text("foh leaves out creep").wait_for()
        ((start, stop),) = given["mask"]
        assert 1.5 < start < stop < 3
        assert page.get_by_text("× noise").count() == 2
        page.locator(".bk-Figure").nth(5 + len(diagnosis.axes) - 1).wait_for()

        page.get_by_role("button", name="Save report").click()
        page.get_by_text("written:").wait_for()
        text = (served.folder / "report.html").read_text(encoding="utf-8")
        assert "fracjax diagnose loop.csv --model foh --mask" in text
        with page.expect_download() as download:
            page.get_by_text("Download next drive").click()
        download.value.save_as(tmp_path / "next.csv")
        assert all(url.startswith((f"http://{served.host}", "data:", "blob:")) for url in addresses)
    drive = read_drive(tmp_path / "next.csv")[0]
    assert drive == pytest.approx(diagnosis.next_experiment.drive.values)
