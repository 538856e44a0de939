"""The report: self-contained, complete, and honest about what is not known."""

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import jax
import matplotlib as mpl
import numpy as np
import pytest

from fracjax._blocks import FOH
from fracjax._diagnose import (
    Axis,
    Candidate,
    Diagnosis,
    Drive,
    HeldOut,
    NamedEffect,
    NextExperiment,
)
from fracjax._fit import Estimate, Fit, fit
from fracjax._models import Model
from fracjax._operators import Grid
from fracjax._recording import Recording
from fracjax._report import write_report
from fracjax._report._text import (
    estimate_row,
    figure,
    key_figures,
    noise_of,
    pretty_unit,
    rank_fits,
)

STEP = 0.01
CYCLE = np.arange(100) / 100
VOID = {"meta", "br", "hr", "img", "link", "input"}


@pytest.fixture(scope="module")
def fitted() -> Fit:
    """FOH fitted to its own response over four periods, with noise."""
    drive = 50 - 45 * np.cos(2 * np.pi * np.tile(CYCLE, 4))
    with jax.enable_x64(True):
        response = np.asarray(FOH(0.05, 0.05)(jax.numpy.asarray(drive), Grid(STEP)))
    noise = np.random.default_rng(1).normal(0, 0.01, drive.size)
    recording = Recording(drive, response + noise, STEP, source="loop <1>.csv")
    return fit(Model(FOH(), "foh"), recording, starts=2)


@pytest.fixture(scope="module")
def diagnosis(fitted: Fit) -> Diagnosis:
    """A diagnosis as `diagnose` gives it, put together by hand."""
    names = ("creep", "drive_lag", "resonance", "saturation")
    scores = (12.0, 11.5, 3.0, 0.4)
    return Diagnosis(
        verdict="confusable",
        sentence="foh leaves out creep & <something>, or an effect that this drive cannot "
        "distinguish from it.",
        base=fitted,
        extended=replace(fitted, model=Model(fitted.model.block, "foh >> creep")),
        effects=(
            NamedEffect(
                name="creep",
                site="response",
                probability=0.7,
                explained_fraction=0.95,
                parameters=(Estimate("mu", 0.012, 0.001, "1", True, False),),
                confusable_with=("drive_lag",),
            ),
        ),
        candidates=tuple(
            Candidate(
                name=name,
                site="response",
                score=score,
                log_evidence=score**2 / 2,
                detectable_amplitude=0.01 * (k + 1),
                concealment=0.9 - 0.2 * k,
                reason=f"reason {k}",
                delta_bic=100.0 if k < 2 else None,
            )
            for k, (name, score) in enumerate(zip(names, scores, strict=True))
        ),
        axes=(
            Axis("time", "s", np.linspace(0, 4, 9), np.arange(8.0), 3.5, ((2.0, 4.0),), 1e-20),
            Axis("frequency", "Hz", np.geomspace(0.1, 50, 6), np.ones(5), 3.0, (), 0.4),
            Axis("harmonics", "1", np.arange(5) + 0.5, np.arange(4.0), 2.0, ((2.5, 3.5),), 1e-3),
        ),
        where="The mismatch stands out along time, at 2 to 4 s.",
        noise=noise_of(fitted),
        numerics=0.02,
        p_value=0.0,
        held_out=HeldOut(
            "stretches set aside in turn", 0.03, 0.011, (0.02, 0.04), (0.01, 0.012), ""
        ),
        next_experiment=NextExperiment(
            "Record steps both ways.",
            ("creep", "drive_lag"),
            0.9,
            Drive("steps", np.repeat([0.0, 40.0], 50), 1e-3),
        ),
        warnings=("The response is clipped.",),
    )


def test_a_diagnosis_shows_itself(diagnosis):
    text = repr(diagnosis)
    assert len(text.splitlines()) < 20
    assert text.startswith("confusable: foh leaves out creep & <something>")
    assert "reason 3" not in text
    assert "reason 3" in diagnosis.summary()
    assert "creep &amp; &lt;something&gt;" in diagnosis._repr_html_()
    assert diagnosis.to_dataframe().loc["creep", "score"] == 12.0
    before, after, scores = diagnosis.plot().axes
    assert before.get_title("left").startswith("foh: ")
    assert after.get_title("left").startswith("foh >> creep: ")
    assert [bar.get_width() for bar in scores.patches] == [12.0, 11.5, 3.0, 0.4]
    assert len(diagnosis.plot_residuals().axes) == 4
    drive = diagnosis.base.preparation.takes[0].recording.drive
    assert np.array_equal(diagnosis.predict(drive), diagnosis.extended.predict(drive))


class Page(HTMLParser):
    """A page's text and links, once its tags are seen to balance."""

    def __init__(self, path: Path):
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []
        self.pieces: list[str] = []
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)
        assert self.open == []
        self.text = " ".join(" ".join(self.pieces).split())

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)
        self.links += [v or "" for key, v in attrs if key.split(":")[-1] in ("href", "src")]

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.pieces.append(data)


def page_of(result, folder: Path) -> Page:
    write_report(result, folder / "report.html")
    return Page(folder / "report.html")


def test_a_diagnosis_is_told_whole(diagnosis, tmp_path):
    page = page_of(diagnosis, tmp_path)
    assert diagnosis.sentence in page.text
    assert "physics missing, several explanations" in page.text
    for candidate in diagnosis.candidates:
        assert candidate.name in page.text
        assert candidate.reason in page.text
    for said in (
        *(diagnosis.where, "Record steps both ways.", "The response is clipped.", "0.012"),
        *("RMSE, held-out data", "noise floor", "loop <1>.csv", "p < 1e-12", "stretches set aside"),
    ):
        assert said in page.text


def test_every_axis_has_its_unit(diagnosis, tmp_path):
    text = page_of(diagnosis, tmp_path).text
    for label in (
        *("drive [V]", "response [µm]", "measured − simulated [µm]", "time [s]", "frequency [Hz]"),
        *(
            "smallest detectable change of the response [µm rms]",
            "RMSE [µm]",
            "harmonic of the drive",
        ),
    ):
        assert label in text


def test_look_alikes_share_a_bracket(diagnosis, tmp_path):
    source = page_of(diagnosis, tmp_path).source
    brackets = re.findall(r'<td class="bracket" rowspan="(\d)">(<span>)?', source)
    assert brackets == [("2", "<span>"), ("2", "")]


@pytest.mark.parametrize("verdict", ["none", "unexplained", "missing"])
def test_other_verdicts(diagnosis, tmp_path, verdict):
    found = replace(diagnosis.effects[0], confusable_with=())
    held_out = replace(diagnosis.held_out, extended_rmse=None, extended_folds=())
    changed = replace(
        diagnosis,
        verdict=verdict,
        effects=(found,) if verdict == "missing" else (),
        extended=diagnosis.extended if verdict == "missing" else None,
        held_out=diagnosis.held_out if verdict == "missing" else held_out,
        next_experiment=None,
    )
    text = page_of(changed, tmp_path).text
    assert "What could still be hidden" in text
    assert ("What is missing" in text) == (verdict == "missing")
    assert "Next experiment" not in text


def test_what_the_model_takes_up_whole_has_no_number(diagnosis, tmp_path):
    """A change larger than the whole response is none that a recording could show."""
    first, *others = diagnosis.candidates
    told = page_of(diagnosis, tmp_path).text.count("not detectable")  # the legend
    beyond = 2 * diagnosis.base.preparation.setting.response_span
    whole = replace(first, concealment=1.0, detectable_amplitude=beyond)
    text = page_of(replace(diagnosis, candidates=(whole, *others)), tmp_path).text
    assert "concealed, not detectable" in text  # the figure
    assert text.count("not detectable") == told + 2  # and the table


def test_a_page_needs_nothing_else_and_carries_its_data(diagnosis, tmp_path):
    page = page_of(diagnosis, tmp_path)
    outside = [link for link in page.links if not link.startswith(("data:", "#"))]
    assert outside == []
    assert "<script" not in page.source
    head, _, data = page.links[-3].partition(",")
    assert head == "data:application/json;base64"
    assert json.loads(base64.b64decode(data)) == json.loads(json.dumps(diagnosis.to_dict()))


def test_fits_and_their_comparison(fitted, tmp_path):
    assert "foh describes loop <1>.csv, with an error of 0.0" in page_of(fitted, tmp_path).text
    worse = replace(
        fitted,
        model=Model(fitted.model.block, "worse"),
        scores=replace(fitted.scores, bic=fitted.scores.bic + 1, rmse=1.0),
        converged=False,
    )
    page = page_of([worse, fitted], tmp_path)
    assert "foh describes loop <1>.csv best of 2 models by BIC" in page.text
    assert "not converged" in page.text
    assert key_figures([fitted, worse])[0] == ["", "foh", "worse"]


def test_without_measured_noise_models_are_ranked_by_what_they_leave(fitted):
    takes = tuple(
        replace(take, noise=replace(noise_of(fitted), method="residual"))
        for take in fitted.preparation.takes
    )
    best = replace(fitted, preparation=replace(fitted.preparation, takes=takes))
    worse = replace(best, scores=replace(best.scores, rmse=2 * best.scores.rmse, bic=0.0))
    assert [found for found, _ in rank_fits([worse, best])] == [best, worse]
    count = len(fitted.simulations[0])
    (_, first), (_, second) = rank_fits([worse, best])
    assert second - first == pytest.approx(2 * count * np.log(2))


def test_long_recordings_make_small_pages(fitted, tmp_path):
    count = 300_000
    drive = np.sin(np.arange(count) / 50)
    noise = np.random.default_rng(0).normal(0, 0.01, count)
    take = fitted.preparation.takes[0]
    recording = replace(take.recording, drive=drive, response=drive + noise)
    long = replace(take, recording=recording, used=np.ones(count, bool))
    preparation = replace(fitted.preparation, takes=(long,) * 5)
    page = page_of(replace(fitted, preparation=preparation, simulations=(drive,) * 5), tmp_path)
    assert len(page.source) < 3_000_000
    assert "2 more recording(s)" in page.text


def test_drawing_leaves_matplotlib_as_it_was(diagnosis, tmp_path):
    before = dict(mpl.rcParams)
    write_report(diagnosis, tmp_path / "report.html")
    first = (tmp_path / "report.html").read_bytes()
    write_report(diagnosis, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_bytes() == first
    assert dict(mpl.rcParams) == before


# Words --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("estimate", "value", "interval", "remark"),
    [
        (Estimate("a", 0.123456, 0.0012, "1", True, False), "0.1235", "0.1211 to 0.1258", ""),
        (Estimate("a", 1234.5, 100.0, "V", True, False), "1230", "1040 to 1430", ""),
        (Estimate("a", 0.123456, 2.0, "1", False, False), "about 0.1", "–", "not identified"),
        (Estimate("a", 2.0, 0.1, "1", True, True), "2", "1.8 to 2.2", "on its bound"),
        (Estimate("a", 2.0, np.inf, "1", False, True), "about 2", "–", "not identified"),
    ],
)
def test_no_false_digits(estimate, value, interval, remark):
    row = estimate_row(estimate)
    assert (row["value"], row["interval"]) == (value, interval)
    assert remark in row["remark"]


@pytest.mark.parametrize(
    ("unit", "pretty"),
    [("um", "µm"), ("um/V*s^alpha", "µm/V·s^alpha"), ("1", ""), ("V**2", "V²"), ("unit", "unit")],
)
def test_units_as_printed(unit, pretty):
    assert pretty_unit(unit) == pretty


@pytest.mark.parametrize(
    ("value", "text"), [(None, "–"), (1313.4, "1313"), (0.012345, "0.0123"), (2e7, "2e+07")]
)
def test_figures(value, text):
    assert figure(value) == text
