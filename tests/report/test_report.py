"""The report: self-contained, complete, and honest about what is not known."""

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import fracjax as fj
from fracjax._fit import Estimate, Predicted, compare_fits
from fracjax._models import Model
from fracjax._report import write_report
from fracjax._report._text import (
    estimate_row,
    figure,
    key_figures,
    noise_of,
    pretty_unit,
    rank_fits,
)

VOID = {"meta", "br", "hr", "img", "link", "input"}


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
        # The plots' texts are JSON in ASCII.
        text = re.sub(r"\\u([0-9a-f]{4})", lambda m: chr(int(m[1], 16)), " ".join(self.pieces))
        self.text = " ".join(text.split())

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


def test_what_models_predict_of_a_recording_held_out_is_in_the_report(diagnosis, tmp_path):
    other = replace(diagnosis.base.preparation.takes[0].recording, source="other.csv")
    both = (other.response, other.response + 1)
    predicted = Predicted(other, np.ones(len(other), bool), both)
    shown = replace(diagnosis, held_out=replace(diagnosis.held_out, predicted=predicted))
    page = page_of(shown, tmp_path)
    assert "other.csv, held out: no fit has seen it" in page.text
    assert "100 % lie in the band of foh, 0 % lie in the band of foh >> creep." in page.text
    assert page_of(diagnosis, tmp_path).text.count("held out: no fit has seen it") == 0


def test_small_tones_show_the_frequency_response_and_its_distortions(diagnosis, tmp_path):
    angles = 2 * np.pi * np.arange(600) / 150
    tones = np.cos(3 * angles) + np.cos(5 * angles + 1)
    recording = fj.Recording(50 + tones, 0.2 * tones + 0.01 * tones**3, 1e-3, "V", "um", "tones")
    shown = replace(diagnosis)
    vars(shown)["linear_approximations"] = fj.best_linear_approximations(recording)
    page = page_of(shown, tmp_path)
    assert "Frequency response about levels of the drive" in page.text
    assert "About 50 V, with 3." in page.text
    assert "about 50 V" in page.source
    assert "Frequency response about" not in page_of(diagnosis, tmp_path).text


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
    assert not re.search(r"<script[^>]+src", page.source)
    head, _, data = page.links[-3].partition(",")
    assert head == "data:application/json;base64"
    assert json.loads(base64.b64decode(data)) == json.loads(json.dumps(diagnosis.to_dict()))


def test_a_page_says_where_it_comes_from(diagnosis, tmp_path):
    """Program, command, seed, date, and the hash of every recording that is a file."""
    file = tmp_path / "loop.csv"
    file.write_bytes(b"abc")
    take = diagnosis.base.preparation.takes[0]
    take = replace(take, recording=replace(take.recording, source=str(file)))
    base = replace(diagnosis.base, preparation=replace(diagnosis.base.preparation, takes=(take,)))
    command = "fracjax diagnose loop.csv --seed 7"
    write_report(replace(diagnosis, base=base), tmp_path / "report.html", command=command, seed=7)
    text = Page(tmp_path / "report.html").text
    # FIPS 180-2's example for SHA-256.
    assert "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad" in text
    assert command in text
    assert re.search(r"written \d{4}-\d\d-\d\d \d\d:\d\d UTC", text)


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


def test_what_a_fit_predicts_of_a_recording_held_out_is_drawn_over_it(fitted, tmp_path):
    own = fitted.preparation.takes[0].recording
    other = replace(own, source="other.csv")
    compared = compare_fits([fitted], holdout=other)
    (predicted,) = compared.predicted
    error = (other.response - predicted.responses[0])[predicted.scored]
    assert compared.rows[0].unseen is not None
    assert compared.rows[0].unseen.rmse == pytest.approx(np.sqrt(np.mean(error**2)))
    page = page_of(compared, tmp_path)
    assert "other.csv, held out: no fit has seen it" in page.text
    assert page.text.count("Response, residual and drive over time") == 1
    assert page.text.count("lie in the band of foh") == 2


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
    count = 100_000
    drive = np.sin(np.arange(count) / 50)
    noise = np.random.default_rng(0).normal(0, 0.01, count)
    take = fitted.preparation.takes[0]
    recording = replace(take.recording, drive=drive, response=drive + noise)
    long = replace(take, recording=recording, used=np.ones(count, bool))
    preparation = replace(fitted.preparation, takes=(long,) * 5)
    page = page_of(replace(fitted, preparation=preparation, simulations=(drive,) * 5), tmp_path)
    assert len(page.source) < 5_000_000
    assert "2 more recording(s)" in page.text


def test_the_same_result_gives_the_same_page(diagnosis, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    write_report(diagnosis, tmp_path / "report.html")
    first = (tmp_path / "report.html").read_bytes()
    write_report(diagnosis, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_bytes() == first


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
