"""The linked plots: what is drawn of a recording, where samples lie, and how bins are labelled."""

import json
from typing import Any

import numpy as np
import pytest
from bokeh.document import Document

from fracjax._diagnose import Axis
from fracjax._fit import analyse_residuals
from fracjax._recording import Recording
from fracjax._report._bokehjs import document_of
from fracjax._report._drawn_samples import bins_of_samples, drawn_samples
from fracjax._report._linked import Curve, link, linked_plots
from fracjax._report._residual_plots import residual_plots
from fracjax._report._strips import strips
from fracjax._show import rounded_edges


def axis_of(name: str, edges) -> Axis:
    edges = np.asarray(edges, float)
    return Axis(name, "1", edges, np.ones(edges.size - 1), 3.0, (), 0.5)


def test_a_short_recording_is_drawn_whole():
    signal = np.random.default_rng(0).normal(size=5000)
    assert np.array_equal(drawn_samples([signal]), np.arange(5000))


def test_of_a_long_recording_no_extreme_is_lost():
    rng = np.random.default_rng(0)
    signals = rng.normal(size=(3, 300_000))
    signals[0, 123_457] = 99.0
    chosen = drawn_samples(list(signals))
    assert chosen.size < 7000
    assert 123_457 in chosen
    for signal in signals:
        stretches = signal.reshape(1000, 300)
        for extreme in (stretches.min(axis=1), stretches.max(axis=1)):
            assert np.isin(extreme, signal[chosen]).all()


def test_samples_lie_in_the_bins_of_each_axis():
    """A triangle of eight samples: its levels, rates, and times since it last turned."""
    triangle = np.tile([0.0, 1, 2, 3, 4, 3, 2, 1], 8)
    recording = Recording(triangle, triangle + 0.1, 0.5, "V", "um")
    bins = bins_of_samples(
        recording,
        [
            axis_of("time", [0, 16, 32]),
            axis_of("level", [0, 1.5, 2.5, 4]),
            axis_of("rate", [-3, 0, 3]),
            axis_of("phase", [0, 180, 360]),
            axis_of("frequency", [0.1, 1]),
        ],
    )
    assert set(bins) == {"time", "level", "rate", "phase"}
    assert np.array_equal(bins["time"], np.repeat([0, 1], 32))
    assert bins["level"][:8].tolist() == [0, 0, 1, 2, 2, 2, 1, 0]
    assert bins["rate"][1:4].tolist() == [1, 1, 1]
    assert bins["rate"][5:8].tolist() == [0, 0, 0]
    assert bins["phase"][:8].tolist() == [0, 0, 0, 0, 1, 1, 1, 1]


def test_time_since_reversal_starts_anew_where_the_drive_turns():
    drive = np.concatenate([np.linspace(0, 1, 41), np.linspace(1, 0, 41)[1:]])
    recording = Recording(drive, drive, 1.0, "V", "um")
    edges = np.arange(0, 60) * 1.0
    since = bins_of_samples(recording, [axis_of("reversal", edges)])["reversal"]
    assert since[:40].tolist() == list(range(40))
    assert since[42:80].tolist() == list(range(since[42], since[42] + 38))
    assert since[42] <= 2


@pytest.mark.parametrize(
    ("edges", "texts"),
    [
        ([-1388, -131.0, -1e-9, 3e-9, 1.01, 145.2], ["−1400", "−130", "0", "0", "1", "150"]),
        ([0.00667, 1.631, 3.256, 4.88], ["0", "1.6", "3.3", "4.9"]),
        ([1000, 1000.5, 1001], ["1000", "1000.5", "1001"]),
        ([0.0384, 0.0866, 0.195], ["0.038", "0.087", "0.2"]),
        ([-50.0, 0.0, 50.0], ["−50", "0", "50"]),
    ],
)
def test_edges_are_signed_and_rounded_to_their_bins(edges, texts):
    assert rounded_edges(edges) == texts


def test_no_label_of_a_strip_stands_twice():
    (strip,) = strips([axis_of("rate", [-131, -1e-6, 1e-6, 1.01])])
    labels = list(strip.plot.below[0].major_label_overrides.values())
    assert labels == ["−130", "0", "1"]


def test_samples_that_do_not_count_are_not_in_the_loop_nor_in_the_residual():
    drive = np.sin(np.arange(200) / 10)
    recording = Recording(drive, 2 * drive, 0.1, "V", "um")
    used = np.arange(200) >= 50
    plots = linked_plots(recording, used, [Curve("model", 2 * drive + 0.5, "#D55E00")], 0.1)
    data = {name: np.asarray(column) for name, column in plots.samples.data.items()}
    assert np.isnan(data["counted_drive"][:50]).all()
    assert np.isnan(data["residual_0"][:50]).all()
    assert data["residual_0"][50:] == pytest.approx(-0.5)
    assert plots.title == "all samples:\nmodel: 0.5 µm rms"


def test_what_is_written_is_what_bokeh_reads(fitted):
    """Bokeh knows every class and property, and reads every value and column as it was."""
    drive = np.sin(np.arange(200) / 10)
    recording, axis = Recording(drive, 2 * drive, 0.1), axis_of("time", [0, 10, 20])
    curve = Curve("model", 2 * drive + 0.5, "#D55E00")
    plots = linked_plots(recording, np.ones(200, bool), [curve], 0.1, [axis])
    located = strips([axis])
    link([plots], located, ["model"], "um")
    (analysis,) = analyse_residuals(fitted)
    roots = [*plots.figures, *(strip.plot for strip in located), *residual_plots(analysis)]
    read: list[Any] = list(Document.from_json(json.loads(document_of(roots, "p"))).roots)
    assert [root.height for root in read] == [root.height for root in roots]
    source = read[0].renderers[0].data_source
    assert source is read[4].renderers[0].data_source
    assert source.data.keys() == plots.samples.data.keys()
    for name, column in plots.samples.data.items():
        assert np.array_equal(source.data[name], column, equal_nan=True)
    (callback,) = source.selected.js_property_callbacks["change:indices"]
    assert callback.args["recordings"] == [source]
    assert read[0].renderers[1].glyph.size.value == 2
    histogram = read[6].renderers[0].data_source.data
    widths = np.asarray(histogram["right"]) - np.asarray(histogram["left"])
    assert np.sum(widths * histogram["top"]) == pytest.approx(1)
