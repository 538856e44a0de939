"""The plots of the page, which are those of the report, and the results that they show."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn
from bokeh.document import Document
from bokeh.layouts import column, row
from bokeh.models import ColumnDataSource

from .._recording import Recording, runs_of
from .._report import (
    Curve,
    describe,
    diagnosis_figures,
    document_of,
    fit_sentence,
    key_figures,
    link,
    linked_plots,
    noise_of,
    parameter_rows,
    shown_by,
    shown_rows,
    strips,
)
from .._show import COLOURS, figure, quantity


def _at(recording: Recording, fit: Any) -> tuple[np.ndarray, np.ndarray]:
    """The simulation (N,) of a fit at a recording's samples, and which of them it counted: a
    diagnosis takes every n-th sample of a long recording."""
    take = fit.preparation.takes[0]
    times, own = recording.times, take.recording.times
    return np.interp(times, own, fit.simulations[0]), np.interp(times, own, take.used) > 0.5


_PARAMETER = ("value", "95 % interval", "unit", "remark")


def _markdown(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [headers, ["---"] * len(headers), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def brushed_times(samples: ColumnDataSource | None) -> list[tuple[float, float]]:
    """The stretches of time [s] that are brushed, ends included."""
    if samples is None or not samples.selected.indices:
        return []
    times = np.asarray(samples.data["time"])
    marked = np.zeros(times.size, bool)
    marked[samples.selected.indices] = True
    return [(float(times[a]), float(times[b - 1])) for a, b in runs_of(marked)]


class Plots:
    """One recording, the fits to it, and the strips of the last diagnosis.

    Attributes:
        pane: the plots on the page.
        samples: the table that they draw, None without a recording.
        result: the last fit or diagnosis.
    """

    def __init__(self) -> None:
        self.pane = pn.Column(sizing_mode="stretch_width")
        self._drawings = 0
        self.clear()

    def clear(self) -> None:
        """Forget the recording and all results."""
        self.samples: ColumnDataSource | None = None
        self.result: Any = None
        self._recording: Recording | None = None
        self._used = np.empty(0, bool)
        self._fits: list[Any] = []
        self._axes: tuple = ()
        self._new: list[int] = []
        self.pane.objects = []

    def show(self, recording: Recording, mask: Sequence[tuple[float, float]]) -> str:
        """Take a recording, and return what was understood of it, as Markdown."""
        self._recording = recording
        times = recording.times
        self._used = np.ones(len(recording), bool)
        for start, stop in mask:
            self._used &= (times < start) | (times > stop)
        one = describe(recording)
        drive, noise = one["drive"], one["noise"]
        floor = "not to be seen" if noise is None else quantity(noise["sigma"], noise["unit"])
        high = quantity(drive["high"], drive["unit"])
        summary = (
            f"**{Path(recording.source).name}**: {one['samples']} samples at {one['rate_Hz']:.6g} "
            f"Hz; drive {drive['kind']}, {figure(drive['low'])} to {high}; noise floor {floor}."
        )
        warnings = [f"- {warning}" for warning in one["warnings"]]
        rows = [f"| {' | '.join(row)} |" for row in shown_rows(shown_by(recording))]
        table = ["| effect | | smallest size that this recording would show |", "|---|---|---|"]
        return "\n".join([summary, "", *warnings, "", *table, *rows])

    def take(self, result: Any) -> str:
        """Take a fit, with its errors on data held out where there are such, or a diagnosis, and
        return what it says: its sentence, its scores, its parameters and a diagnosis' candidates,
        as Markdown."""
        self.result = result
        if hasattr(result, "verdict"):
            fits = [fit for fit in (result.base, result.extended) if fit is not None]
            self._axes, sentence = result.axes, result.sentence
            scores = diagnosis_figures(result)
            candidates = [[c.name, figure(c.score), c.reason] for c in result.candidates]
            further = [(["effect", "score", "why it is named or not"], candidates)]
        else:
            # A comparison has fits: its class would load what a first paint does without.
            compared = hasattr(result, "fits")
            fits = [*result.fits] if compared else [result]
            sentence, scores = fit_sentence(fits), key_figures(result if compared else fits)
            further = []
        parameters = parameter_rows(fits[-1])
        named = [fits[-1].model.name, *_PARAMETER], [[*r.values()] for r in parameters]
        tables = [scores, named, *further]
        sentence = "\n\n".join([sentence, *(_markdown(*table) for table in tables)])
        self._new = list(range(len(self._fits), len(self._fits) + len(fits)))
        self._fits += fits
        return sentence

    def choices(self) -> dict[str, int]:
        """The fits by name, each with its residual over the noise."""
        return {
            f"{index + 1}. {fit.model.name}: "
            f"{figure(fit.scores.rmse / noise_of(fit).sigma)} × noise": index
            for index, fit in enumerate(self._fits)
        }

    def latest(self) -> list[int]:
        """The fits of the last result."""
        return self._new

    def latest_fit(self) -> Any:
        """The last fit, the extended one of a diagnosis where there is one."""
        return self._fits[self._new[-1]]

    def draw(self, chosen: Sequence[int]) -> None:
        """Draw the recording with the chosen fits."""
        recording = self._recording
        if recording is None:
            return
        fits = [self._fits[index] for index in chosen][: len(COLOURS)]
        curves = [
            Curve(fit.model.name, _at(recording, fit)[0], colour)
            for fit, colour in zip(fits, COLOURS, strict=False)
        ]
        sigma = noise_of(fits[0]).sigma if fits else None
        used = _at(recording, fits[0])[1] if fits else self._used
        plots = linked_plots(recording, used, curves, sigma, self._axes)
        located = strips(self._axes) if self._axes else []
        link([plots], located, [curve.name for curve in curves], recording.response_unit)
        # A page has one model of each id, also of those that it drew before.
        self._drawings += 1
        parts = [*plots.figures, *(strip.plot for strip in located)]
        text = document_of(parts, f"drawing-{self._drawings}-")
        document = Document.from_json(json.loads(text))
        roots: list[Any] = list(document.roots)
        document.clear()
        self.samples = roots[0].renderers[0].data_source
        over, drawn = 3 if curves else 2, len(plots.figures)
        layout = column(
            *roots[:over],
            row(*roots[over:drawn], sizing_mode="stretch_width"),
            *roots[drawn:],
            sizing_mode="stretch_width",
        )
        self.pane.objects = [pn.pane.Bokeh(layout, sizing_mode="stretch_width")]
