"""Pictures of a posterior: corner plot, traces, prior and posterior, predictive bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import corner
import matplotlib as mpl
import numpy as np

from .._show import pretty_unit
from .._show.drawing import BAND, COLOURS, MEASURED, STYLE, WIDTH, Drawing, canvas, thinned
from ._rows import Band, Row

Draws = Mapping[str, np.ndarray]

_MOST_DRAWS = 5000
"""Most draws in the corner plot."""
_MARGIN = 0.15
"""Room around the draws, as a share of their span, so that smoothed contours close."""
_COLUMNS = 4
"""Densities side by side."""


def _label(row: Row, separator: str = " ") -> str:
    """A parameter's name with its unit."""
    unit = pretty_unit(row.unit)
    return f"{row.name}{separator}[{unit}]" if unit else row.name


@mpl.rc_context({**STYLE, "axes.grid": False, "font.size": 8})
def draw_corner(summary: Sequence[Row], samples: Draws) -> Drawing:
    """The density of every parameter and of every pair."""
    draws = np.stack([samples[row.name].ravel() for row in summary], axis=1)
    draws = draws[:: -(-len(draws) // _MOST_DRAWS)]
    ends = [draws.min(axis=0), draws.max(axis=0), _MARGIN * np.ptp(draws, axis=0)]
    drawing = Drawing(figsize=(WIDTH, WIDTH), dpi=150)
    corner.corner(
        draws,
        labels=[_label(row, "\n") for row in summary],
        fig=drawing,
        color=COLOURS[1],
        plot_datapoints=False,
        plot_density=False,
        fill_contours=True,
        levels=(0.5, 0.95),
        smooth=1.0,
        range=[(low - margin, high + margin) for low, high, margin in zip(*ends, strict=True)],
        max_n_ticks=3,
        hist_kwargs={"lw": 1.2},
        labelpad=0.15,
    )
    drawing.subplots_adjust(left=0.13, bottom=0.13, right=0.99, top=0.99)
    return drawing


@mpl.rc_context({**STYLE, "font.size": 9})
def draw_prior(summary: Sequence[Row], samples: Draws, priors: Draws) -> Drawing:
    """Densities of prior and posterior; where they coincide the data contain no information."""
    rows = -(-len(summary) // _COLUMNS)
    drawing, axes = canvas(2.1 * rows, rows, _COLUMNS)
    for panel, row in zip(axes.flat, summary, strict=False):
        draws, prior = samples[row.name].ravel(), priors[row.name]
        low, high = np.percentile(draws, [0.1, 99.9])
        margin = 1.5 * (high - low)
        edges = np.linspace(max(low - margin, min(low, prior.min())), high + margin, 60)
        panel.hist(draws, edges, density=True, color=COLOURS[1], alpha=0.6, label="posterior")
        # The prior's density, normalised over its whole range and not only over the panel.
        counts, _ = np.histogram(prior, edges)
        panel.stairs(counts / prior.size / np.diff(edges), edges, color=MEASURED, label="prior")
        panel.set_xlabel(_label(row))
        panel.ticklabel_format(axis="x", scilimits=(-3, 4))
        panel.xaxis.get_major_locator().set_params(nbins=4)
        panel.set_yticks([])
    for panel in axes.flat[len(summary) :]:
        panel.set_axis_off()
    axes.flat[0].legend(loc="upper left", fontsize=8)
    return drawing


@mpl.rc_context({**STYLE, "font.size": 9})
def draw_trace(summary: Sequence[Row], samples: Draws, burn_in: int, thinned_by: int) -> Drawing:
    """All walkers over the steps that were kept."""
    count = len(summary)
    drawing, axes = canvas(0.6 + 1.1 * count, count, 1, sharex=True)
    for panel, row in zip(axes[:, 0], summary, strict=True):
        walkers = samples[row.name]
        steps = burn_in + thinned_by * np.arange(walkers.shape[1])
        panel.plot(steps, walkers.T, color=MEASURED, lw=0.3, alpha=0.4, rasterized=True)
        panel.plot(steps, walkers.mean(axis=0), color=COLOURS[0], lw=1)
        panel.set_ylabel(_label(row, "\n"), rotation=0, ha="right", va="center")
    axes[-1, 0].set_xlabel("step")
    return drawing


@mpl.rc_context(STYLE)
def draw_loop(band: Band, units: tuple[str, str]) -> Drawing:
    """The loop measured and predicted, and the residual of the prediction within its band."""
    drawing, axes = canvas(4.4, 1, 2)
    loop, below = axes[0]
    drive, unit = band.drive[band.used], pretty_unit(units[1])
    loop.plot(drive, band.response[band.used], color=MEASURED, lw=2.4, alpha=0.5, rasterized=True)
    loop.plot(drive, band.median[band.used], color=COLOURS[1], rasterized=True)
    loop.legend(["measured", "median prediction"], loc="upper left")
    loop.set_ylabel(f"response [{unit}]")
    residual = (band.response - band.median)[band.used]
    order = np.argsort(drive)
    for edge in (band.predictive - band.median)[:, band.used]:
        below.plot(drive[order], edge[order], ".", ms=1.5, color="#AAAAAA", rasterized=True)
    below.plot(drive, residual, ".", ms=2, color=COLOURS[1], rasterized=True)
    below.set_ylabel(f"measured − median [{unit}]")
    for panel in (loop, below):
        panel.set_xlabel(f"drive [{pretty_unit(units[0])}]")
    return drawing


@mpl.rc_context(STYLE)
def draw_series(band: Band, units: tuple[str, str]) -> Drawing:
    """The response over time, and below it the residual within the predictive band."""
    drawing, axes = canvas(5.4, 2, 1, sharex=True)
    whole, below = axes[:, 0]
    unit = pretty_unit(units[1])
    whole.plot(
        *thinned(band.times, band.response), color=MEASURED, lw=2.4, alpha=0.5, label="measured"
    )
    whole.plot(*thinned(band.times, band.median), color=COLOURS[1], label="median prediction")
    whole.set_ylabel(f"response [{unit}]")
    whole.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0)
    noisy, model = band.predictive - band.median, band.model - band.median
    below.fill_between(
        band.times, *noisy, color=BAND, lw=0, label="95 % with noise", rasterized=True
    )
    below.fill_between(
        band.times, *model, color=COLOURS[0], lw=0, label="95 % without noise", rasterized=True
    )
    residual = np.where(band.used, band.response - band.median, np.nan)
    below.plot(band.times, residual, color=COLOURS[1], lw=0.7, label="measured", rasterized=True)
    below.set(xlabel="time [s]", ylabel=f"minus the median [{unit}]")
    below.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, borderaxespad=0)
    return drawing
