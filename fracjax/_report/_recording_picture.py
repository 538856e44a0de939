"""A picture of what was understood of recordings: drive, response, loop, noise floor, warnings."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from .._recording import Recording
from ._colours import COLOURS
from ._description import describe
from ._figures import _STYLE, MEASURED
from ._numbers import pretty_unit, quantity

_MOST = 4
"""Segments that are drawn."""
_POINTS = 20_000
_LINE = 150


def draw_recordings(recordings: Sequence[Recording], path: Path, form: str) -> None:
    """Draw recordings, a row of pictures and the warnings for each: drive and response in time,
    with rests and samples left out marked, and the response over the drive.  `form`: "svg", "png"
    or "pdf"."""
    shown = list(recordings)[:_MOST]
    descriptions = [describe(recording) for recording in shown]
    notes = [_notes(one) for one in descriptions]
    heights = [3.4 + 0.19 * len(lines) for lines in notes]
    with mpl.rc_context(_STYLE):
        drawing = Figure(figsize=(9.5, sum(heights)), layout="constrained")
        FigureCanvasAgg(drawing)
        rows = drawing.subfigures(len(shown), 1, height_ratios=heights, squeeze=False)[:, 0]
        for part, recording, one, lines in zip(rows, shown, descriptions, notes, strict=True):
            _draw(part, recording, one, lines)
        drawing.savefig(path, format=form)


def _draw(part, recording: Recording, description: dict, lines: Sequence[str]) -> None:
    height = 3.4 + 0.19 * len(lines)
    grid = part.add_gridspec(
        3, 2, width_ratios=(1.7, 1), height_ratios=(1, 1, max(0.19 * len(lines), 0.01) * 3 / height)
    )
    drive, response = part.add_subplot(grid[0, 0]), part.add_subplot(grid[1, 0])
    loop, text = part.add_subplot(grid[:2, 1]), part.add_subplot(grid[2, :])
    step = max(1, len(recording) // _POINTS)
    times = recording.times
    units = [pretty_unit(unit) for unit in (recording.drive_unit, recording.response_unit)]
    names = [f"drive [{units[0]}]", f"response [{units[1]}]"]
    for axes, signal, name, colour in (
        (drive, recording.drive, names[0], MEASURED),
        (response, recording.response, names[1], COLOURS[0]),
    ):
        axes.plot(times[::step], signal[::step], color=colour, lw=0.9)
        axes.set_ylabel(name)
        for start, stop in description["rests_s"]:
            axes.axvspan(start, stop, color="0.85", lw=0)
        if recording.masked is not None:
            left_out = np.flatnonzero(recording.masked)
            axes.plot(times[left_out], signal[left_out], "x", color="red", ms=4)
    drive.tick_params(labelbottom=False)
    response.set_xlabel("time [s]")
    counted = recording.response.copy()
    if recording.masked is not None:
        counted[recording.masked] = np.nan
    loop.plot(recording.drive[::step], counted[::step], color=COLOURS[0], lw=0.8)
    loop.set_xlabel(names[0])
    loop.set_ylabel(names[1])
    noise = description["noise"]
    floor = "not to be seen" if noise is None else quantity(noise["sigma"], noise["unit"])
    loop.set_title(f"noise floor {floor}")
    part.suptitle(
        f"{recording.source}: {len(recording)} samples at {recording.rate:.6g} Hz", fontsize=9
    )
    text.set_axis_off()
    text.text(0, 1, "\n".join(lines), va="top", fontsize=8, transform=text.transAxes)


def _notes(description: dict) -> list[str]:
    """The warnings as lines."""
    return [
        line
        for each in description["warnings"]
        for line in textwrap.wrap(f"Warning: {each}", _LINE)
    ]
