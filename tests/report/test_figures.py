"""The figures of a diagnosis and of a protocol: what their bars say and how long they are."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bokeh.document import Document

import fracjax as fj
from fracjax._path import LARGEST, Visible
from fracjax._report import _figures
from fracjax._report._bokehjs import Model, document_of
from tests.results import small_protocol


def words_of(plot: Model) -> list[str]:
    return [each.text for each in plot.center if each.kind == "Label"]


def levels_of(plot: Model) -> list[float]:
    return [each.location for each in plot.center if each.kind == "Span"]


def test_bars_end_at_the_smallest_detectable_change_or_at_the_span(diagnosis):
    """Those that hide most come first; none is longer than the largest possible change."""
    first, *others = diagnosis.candidates
    beyond = replace(first, concealment=1.0, detectable_amplitude=50.0)
    figure = _figures.hidden([*others, beyond], diagnosis.noise, 10.0)
    (plot,) = figure.plots
    assert words_of(plot) == [
        "creep: 100 % concealed, not detectable",
        "saturation: 0.04 µm, 30 % concealed",
        "resonance: 0.03 µm, 50 % concealed",
        "drive_lag: 0.02 µm, 70 % concealed",
    ]
    assert plot.renderers[0].data_source.data["end"] == pytest.approx([10, 0.04, 0.03, 0.02])
    assert levels_of(plot) == [diagnosis.noise.sigma]
    assert plot.x_range.start < diagnosis.noise.sigma < 10 < plot.x_range.end


def test_what_is_shown_at_no_size_is_hatched_up_to_the_largest():
    sizes = [Visible("creep", 0.02, "um", ""), Visible("delay", None, "um", "met once")]
    (plot,) = _figures.shown(sizes, 10.0).plots
    assert words_of(plot) == ["creep: 0.02 µm", "delay: not at any size"]
    data = plot.renderers[0].data_source.data
    assert data["end"] == pytest.approx([0.02, 10 * LARGEST])
    assert data["opacity"] == [1, 0]


def test_each_fold_has_a_bar_of_each_model(diagnosis):
    figure = _figures.held_out(diagnosis.held_out, ["foh", "foh >> creep"], diagnosis.noise)
    (plot,) = figure.plots
    base, extended = (each.data_source.data for each in plot.renderers)
    assert base["error"].tolist() == [0.02, 0.04]
    assert extended["error"].tolist() == [0.01, 0.012]
    assert (0.5 * (base["fold"] + extended["fold"])).tolist() == [1, 2]
    assert [name for name, *_ in figure.legend] == ["foh", "foh >> creep", "noise floor"]
    assert levels_of(plot) == [diagnosis.noise.sigma]
    alone = replace(diagnosis.held_out, extended_folds=())
    figure = _figures.held_out(alone, ["foh"], diagnosis.noise)
    assert [name for name, *_ in figure.legend] == ["foh", "noise floor"]


def test_bokeh_reads_every_figure(diagnosis):
    """It knows every class and property, of parts of a drive and of logarithmic axes too."""
    angles = 2 * np.pi * np.arange(600) / 150
    tones = np.cos(3 * angles) + np.cos(5 * angles + 1)
    recording = fj.Recording(50 + tones, 0.2 * tones + 0.01 * tones**3, 1e-3, "V", "um", "tones")
    protocol = small_protocol()
    figures = [
        _figures.hidden(diagnosis.candidates, diagnosis.noise, 10.0),
        _figures.shown(protocol.shows, 10.0),
        _figures.held_out(diagnosis.held_out, ["foh"], diagnosis.noise),
        _figures.drive(protocol.drive, "V"),
        _figures.approximations(fj.best_linear_approximations(recording)),
    ]
    plots = [plot for figure in figures for plot in figure.plots]
    read: list[Any] = list(Document.from_json(json.loads(document_of(plots, "p"))).roots)
    assert [plot.height for plot in read] == [plot.height for plot in plots]
    drive = read[3]
    assert list(drive.above[0].major_label_overrides.values()) == ["rest", "fast path"]
    assert read[4].title.text == "about 50 V"
