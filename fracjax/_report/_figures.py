"""The figures of a diagnosis and of a protocol."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .._path import LARGEST, Visible
from .._show import COLOURS, percent, pretty_unit, quantity
from ._bokehjs import Field, Model
from ._drawn_samples import drawn_samples
from ._embedding import PlottedFigure
from ._plot import (
    MEASURED,
    draw,
    draw_level,
    draw_line,
    draw_stretch,
    empty_plot,
    one,
    plot_to_enlarge,
    table,
)

if TYPE_CHECKING:
    from .._diagnose import Candidate, HeldOut
    from .._frequency import LinearApproximation
    from .._prepare import Noise
    from .._protocol import Drive

_HEIGHT = 260
"""Height of a plot [pixels]."""
_ROW = 36
"""Height of a bar with the words above it [pixels]."""
_BELOW = 56
"""Height of the axis below the bars [pixels]."""
_NOISE_FLOOR = ("noise floor", "var(--ink)", "dashed")


class _Bar(NamedTuple):
    """A bar, the words above it, and whether it is hatched: it ends where the scale does."""

    text: str
    end: float
    hatched: bool = False


def hidden(candidates: Sequence[Candidate], noise: Noise, span: float) -> PlottedFigure:
    """The smallest detectable amplitude of each effect, and the share that the model conceals.

    Bars end at the response's span [response], the largest possible change.
    """
    bars = []
    for candidate in sorted(candidates, key=lambda c: -c.detectable_amplitude):
        remark = f"{percent(candidate.concealment)} concealed"
        if candidate.is_seen_within(span):
            amount = quantity(candidate.detectable_amplitude, noise.unit)
            bars.append(
                _Bar(f"{candidate.name}: {amount}, {remark}", candidate.detectable_amplitude)
            )
        else:
            bars.append(_Bar(f"{candidate.name}: {remark}, not detectable", span))
    label = f"smallest detectable change of the response [{pretty_unit(noise.unit)} rms]"
    ends = [noise.sigma, *(bar.end for bar in bars)]
    plot = _bars(bars, label, 0.5 * min(ends), 1.1 * max(ends))
    draw_level(plot, noise.sigma, "height")
    _write(plot, bars)
    return PlottedFigure([plot], [_NOISE_FLOOR])


def shown(sizes: Sequence[Visible], span: float) -> PlottedFigure:
    """The smallest size of each effect that would be named, of a response of some span.

    Where none is, a hatched bar ends at the largest credible size.
    """
    largest = LARGEST * span
    bars = [
        _Bar(f"{each.effect}: not at any size", largest, hatched=True)
        if each.size is None
        else _Bar(f"{each.effect}: {quantity(each.size, each.unit)}", each.size)
        for each in sizes
    ]
    label = f"smallest size that would be named [{pretty_unit(sizes[0].unit)} peak to peak]"
    plot = _bars(bars, label, 0.5 * min(bar.end for bar in bars), 1.1 * largest)
    _write(plot, bars)
    return PlottedFigure([plot])


def _bars(bars: Sequence[_Bar], label: str, start: float, stop: float) -> Model:
    """Bars below each other on a logarithmic axis from `start` to `stop`, with room for words."""
    x_range = Model("Range1d", start=start, end=stop)
    plot = empty_plot(_ROW * len(bars) + _BELOW, (label, ""), x_range, "x")
    plot.y_range = Model("Range1d", start=len(bars), end=0)
    plot.toolbar_location = None
    plot.min_border_left = 12
    for unused in (*plot.left, plot.center[1]):
        unused.visible = False
    rows = np.arange(len(bars))
    source = table(
        {
            "end": [bar.end for bar in bars],
            "top": rows + 0.52,
            "bottom": rows + 0.88,
            "opacity": [0.0 if bar.hatched else 1.0 for bar in bars],
            "pattern": ["/" if bar.hatched else " " for bar in bars],
        }
    )
    quad = Model(
        "Quad",
        right=Field("end"),
        top=Field("top"),
        bottom=Field("bottom"),
        fill_alpha=Field("opacity"),
        hatch_pattern=Field("pattern"),
        **one(left=start, fill_color=COLOURS[1], line_color=COLOURS[1], hatch_color=MEASURED),
    )
    draw(plot, source, quad)
    return plot


def _write(plot: Model, bars: Sequence[_Bar]) -> None:
    """Write the words above each bar, where they have the plot's width, on a phone too."""
    paper = {"--bk-background-fill-color": "var(--paper)"}
    for row, bar in enumerate(bars):
        words = {"text": bar.text, "text_font_size": "12px", "text_baseline": "bottom"}
        place = {"x": 0, "x_units": "screen", "y": row + 0.48}
        plot.center.append(Model("Label", **words, **place, css_variables=paper))


def held_out(scores: HeldOut, names: Sequence[str], noise: Noise) -> PlottedFigure:
    """Error on held-out data, fold by fold."""
    groups = [folds for folds in (scores.base_folds, scores.extended_folds) if folds]
    count, width = len(scores.base_folds), 0.8 / len(groups)
    highest = max(noise.sigma, *(error for folds in groups for error in folds))
    plot = plot_to_enlarge(_HEIGHT, ("fold", f"RMSE [{pretty_unit(noise.unit)}]"))
    plot.x_range = Model("Range1d", start=0.5, end=count + 0.5)
    plot.y_range = Model("Range1d", start=0, end=1.08 * highest)
    plot.below[0].ticker = Model("FixedTicker", ticks=[*range(1, count + 1)], minor_ticks=[])
    plot.center[0].visible = False
    for k, (folds, colour) in enumerate(zip(groups, COLOURS, strict=False)):
        places = np.arange(1, count + 1) + width * (k - (len(groups) - 1) / 2)
        bars = table({"fold": places, "error": np.array(folds)})
        look = one(width=0.92 * width, bottom=0, fill_color=colour, line_color=None)
        draw(plot, bars, Model("VBar", x=Field("fold"), top=Field("error"), **look))
    draw_level(plot, noise.sigma, "width")
    drawn = zip(names, COLOURS, groups, strict=False)
    models = [(name, colour, "solid") for name, colour, _ in drawn]
    return PlottedFigure([plot], [*models, _NOISE_FLOOR])


def drive(proposed: Drive, unit: str) -> PlottedFigure:
    """A drive over time, with its parts."""
    plot = plot_to_enlarge(_HEIGHT, ("time [s]", f"drive [{pretty_unit(unit)}]"))
    times = proposed.times
    plot.x_range = Model("Range1d", start=0, end=float(times[-1]))
    chosen = drawn_samples([proposed.values])
    samples = table({"time": times[chosen], "drive": proposed.values[chosen]})
    draw_line(plot, samples, "time", "drive", {"line_color": COLOURS[0], "line_width": 1.2})
    for part in proposed.parts[1::2]:
        draw_stretch(plot, part.start, part.stop)
    if proposed.parts:
        middles = {0.5 * (part.start + part.stop): part.name for part in proposed.parts}
        names = plot.below[0].like(
            axis_label=None,
            ticker=Model("FixedTicker", ticks=[*middles], minor_ticks=[]),
            major_label_overrides=middles,
            major_label_policy=Model("NoOverlap", min_distance=4),
            major_tick_in=0,
            major_tick_out=0,
        )
        plot.above = [names]
    return PlottedFigure([plot])


def approximations(linear: Sequence[LinearApproximation]) -> PlottedFigure:
    """The linear response about each level, and noise, odd and even distortions below it."""
    plots, legend = [], []
    y_range = Model("DataRange1d")
    for each in linear:
        labels = ("frequency [Hz]", f"response over drive [{pretty_unit(each.unit)}]")
        title = f"about {quantity(each.level, each.drive_unit)}"
        plot = plot_to_enlarge(_HEIGHT, labels, title, "xy")
        plot.y_range = y_range
        parts = {
            "linear": (np.abs(each.response), MEASURED),
            "noise": (each.noise, COLOURS[0]),
            "odd distortions": (each.odd, COLOURS[1]),
            "even distortions": (each.even, COLOURS[2]),
        }
        for size, colour in parts.values():
            # What is not there has no place on a logarithmic axis.
            sizes = np.where(size > 0, size, np.nan)
            columns = table({"frequency": each.frequencies_Hz, "size": sizes})
            draw_line(plot, columns, "frequency", "size", {"line_color": colour, "line_width": 1.6})
            points = one(size=4, fill_color=colour, line_color=None)
            draw(plot, columns, Model("Scatter", x=Field("frequency"), y=Field("size"), **points))
        plots.append(plot)
        legend = [(name, colour, "solid") for name, (_, colour) in parts.items()]
    return PlottedFigure(plots, legend)
