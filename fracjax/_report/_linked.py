"""Linked plots of a recording, with BokehJS: zoom, hover, and a brush that shows in all of them.

All plots of a recording draw one table of samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .._recording import Recording
from .._show import pretty_unit, quantity
from ._bokehjs import Field, Model
from ._drawn_samples import bins_of_samples, drawn_samples
from ._plot import BRUSHED, MEASURED, draw, draw_band, draw_line, draw_reach, empty_plot, one, table
from ._strips import Strip

if TYPE_CHECKING:
    from .._diagnose import Axis


class Curve(NamedTuple):
    """A simulated response (N,) [response unit] with the name and the colour of its model, and how
    far (N,) 95 % of new samples may be off, if that is drawn."""

    name: str
    response: np.ndarray
    colour: str
    reach: np.ndarray | None = None


_ENDS = (("low", -1.0), ("high", 1.0))
"""Of the interval of a prediction."""


class _Line(NamedTuple):
    """A column of the table as a line; layers of one name are shown or hidden together."""

    layer: str
    column: str
    colour: str
    width: float
    visible: bool = True


@dataclass(frozen=True)
class LinkedPlots:
    """The plots of one recording.

    Attributes:
        samples: the table that they draw.
        figures: response, residual (with curves only) and drive over time, then response and
            residual over the drive.
        errors: the plot of the residual over time, None without curves.
        title: its title while nothing is brushed.
        drawn: how many of the samples are drawn.
        count: the number of samples.
    """

    samples: Model
    figures: tuple[Model, ...]
    errors: Model | None
    title: str
    drawn: int
    count: int


def linked_plots(
    recording: Recording,
    used: np.ndarray,
    curves: Sequence[Curve],
    sigma: float | None = None,
    axes: Sequence[Axis] = (),
    explained: Sequence[Curve] = (),
) -> LinkedPlots:
    """The plots of a recording.

    `used` (N,): the samples that count; `sigma`: the noise [response unit]; `axes`: those whose
    strips are to be linked; `explained`: curves beside the residual, hidden at first.
    """
    residuals = [np.where(used, recording.response - c.response, np.nan) for c in curves]
    signals = (recording.drive, recording.response, *map(np.nan_to_num, residuals))
    chosen = drawn_samples(signals)
    reached = [(k, c.response, c.reach) for k, c in enumerate(curves) if c.reach is not None]
    columns = {
        "drive": recording.drive,
        "counted_drive": np.where(used, recording.drive, np.nan),
        "measured": recording.response,
        **{f"simulated_{k}": curve.response for k, curve in enumerate(curves)},
        **{f"residual_{k}": residual for k, residual in enumerate(residuals)},
        **{f"explained_{k}": curve.response for k, curve in enumerate(explained)},
        **{f"{end}_{k}": sign * reach for end, sign in _ENDS for k, _, reach in reached},
        **{
            f"simulated_{end}_{k}": response + sign * reach
            for end, sign in _ENDS
            for k, response, reach in reached
        },
    }
    samples = table(
        {
            "time": recording.times[chosen],
            **{name: signal[chosen].astype(np.float32) for name, signal in columns.items()},
            **{f"bin_{k}": bins[chosen] for k, bins in bins_of_samples(recording, axes).items()},
        }
    )
    unit = pretty_unit(recording.response_unit)
    drive_label = f"drive [{pretty_unit(recording.drive_unit)}]"
    response_label, error_label = f"response [{unit}]", f"measured − simulated [{unit}]"
    hover = _hover(recording, curves)
    time = Model("DataRange1d", range_padding=0.01)
    drive = Model("DataRange1d", range_padding=0.02)
    lines = [
        _Line("measured", "measured", MEASURED, 3.0),
        *(_Line(f"model_{k}", f"simulated_{k}", c.colour, 1.2) for k, c in enumerate(curves)),
    ]
    errors = [_Line(f"model_{k}", f"residual_{k}", c.colour, 1.0) for k, c in enumerate(curves)]
    errors += [
        _Line(f"candidate_{k}", f"explained_{k}", c.colour, 1.6, visible=False)
        for k, c in enumerate(explained)
    ]
    along, over = [(240, response_label, lines)], [(330, response_label, lines)]
    if curves:
        along.append((265, error_label, errors))
        over.append((330, error_label, errors))
    along.append((130, drive_label, [_Line("drive", "drive", MEASURED, 1.2)]))
    cursor = Model("Span", dimension="height", line_color=MEASURED, line_dash="dotted")
    figures = []
    for height, label, drawn in along:
        plot = empty_plot(height, ("time [s]", label), time)
        plot.toolbar.tools.append(Model("CrosshairTool", overlay=cursor))
        _draw(plot, samples, "time", drawn, joined=True)
        _let_brush(plot, [Model("BoxSelectTool", dimensions="width")], hover | {"mode": "vline"})
        figures.append(plot)
    for height, label, drawn in over:
        plot = empty_plot(height, (drive_label, label), drive)
        _draw(plot, samples, "counted_drive", drawn, joined=chosen.size == len(recording))
        _let_brush(plot, [Model("BoxSelectTool"), Model("LassoSelectTool")], hover)
        figures.append(plot)
    if not curves:
        return LinkedPlots(samples, tuple(figures), None, "", chosen.size, len(recording))
    if sigma is not None:
        for plot in (figures[1], figures[-1]):
            draw_band(plot, -2 * sigma, 2 * sigma)
    for k, *_ in reached:
        for plot, stem in ((figures[0], "simulated_"), (figures[1], "")):
            ends = f"{stem}low_{k}", f"{stem}high_{k}"
            draw_reach(plot, samples, "time", ends, curves[k].colour, f"model_{k}")
    levels = [quantity(_rms(residual), recording.response_unit) for residual in residuals]
    title = "all samples:\n" + "\n".join(
        f"{curve.name}: {level} rms" for curve, level in zip(curves, levels, strict=True)
    )
    figures[1].title.text = title
    return LinkedPlots(samples, tuple(figures), figures[1], title, chosen.size, len(recording))


def link(
    plots: Sequence[LinkedPlots], beside: Sequence[Strip], names: Sequence[str], unit: str
) -> None:
    """Let a brush in any plot of the recordings or in any strip show in all of them.

    `names` are the models' and `unit` is the response's, by which the residual within the brush is
    given.  Strips along which samples have no place are left out.
    """
    recordings = [plot.samples for plot in plots]
    linked = [
        strip.bins
        for strip in beside
        if all(f"bin_{strip.bins.name}" in samples.data for samples in recordings)
    ]
    callback = Model(
        "CustomJS",
        args={
            "recordings": recordings,
            "strips": linked,
            "titles": [plot.errors and plot.errors.title for plot in plots],
            "plain": [plot.title for plot in plots],
            "whole": [plot.drawn == plot.count for plot in plots],
            "names": list(names),
            "unit": pretty_unit(unit),
        },
        code=files("fracjax._report").joinpath("brush.js").read_text("utf-8"),
    )
    for source in (*recordings, *linked):
        source.selected.js_property_callbacks = {"change:indices": [callback]}


def _draw(plot: Model, samples: Model, x: str, lines: Sequence[_Line], *, joined: bool) -> None:
    """Draw lines, and the points that appear where they are brushed.

    Without `joined` there are points alone, for lines between distant samples would cut across a
    loop.
    """
    for line in lines:
        shown = {"name": line.layer, "visible": line.visible}
        if joined:
            style = {"line_color": line.colour, "line_width": line.width}
            draw_line(plot, samples, x, line.column, style, **shown)
        points = Model(
            "Scatter",
            x=Field(x),
            y=Field(line.column),
            **one(size=2, line_color=None, fill_color=None if joined else line.colour),
        )
        brushed = points.like(**one(size=4, fill_color=BRUSHED))
        draw(
            plot,
            samples,
            points,
            selection_glyph=brushed,
            nonselection_glyph=points.like(),
            **shown,
        )


def _let_brush(plot: Model, brushes: Sequence[Model], hover: dict[str, Any]) -> None:
    """The tools of a plot; a drag brushes until another tool is chosen."""
    points = [each for each in plot.renderers if each.glyph.kind == "Scatter"]
    for brush in brushes:
        brush.renderers = points
    others = ("BoxZoomTool", "PanTool", "WheelZoomTool", "ResetTool", "SaveTool")
    plot.toolbar.tools += [
        *brushes,
        *map(Model, others),
        Model("HoverTool", renderers=points[:1], limit=1, **hover),
    ]
    plot.toolbar.active_drag = brushes[0]


def _hover(recording: Recording, curves: Sequence[Curve]) -> dict[str, Any]:
    """What a plot says of the sample below the pointer."""
    unit = pretty_unit(recording.response_unit)
    lines = [
        ("time", "@time{%.6g} s"),
        ("drive", f"@drive{{%.4g}} {pretty_unit(recording.drive_unit)}"),
        ("measured", f"@measured{{%.6g}} {unit}"),
    ]
    columns = ["time", "drive", "measured"]
    for k, curve in enumerate(curves):
        lines.append((curve.name, f"@simulated_{k}{{%.6g}} {unit}, off by @residual_{k}{{%.3g}}"))
        columns += [f"simulated_{k}", f"residual_{k}"]
    return {"tooltips": lines, "formatters": {f"@{column}": "printf" for column in columns}}


def _rms(residual: np.ndarray) -> float:
    """The rms of a residual (N,), over the samples that count."""
    return float(np.sqrt(np.nanmean(residual**2)))
