"""Pictures of a fit: measured and simulated, the residual, and models side by side."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from scipy.stats import norm

from .._prepare import Noise, Take
from .._show import pretty_unit, quantity
from .._show.drawing import (
    BAND,
    COLOURS,
    DENSE,
    MEASURED,
    STYLE,
    Drawing,
    canvas,
    noise_band,
    thinned,
)


@mpl.rc_context(STYLE)
def draw_fit(take: Take, noise: Noise, simulation: np.ndarray, name: str) -> Drawing:
    """Measured and simulated response, and the residual, over the drive and over time."""
    recording, used = take.recording, take.used
    unit = pretty_unit(recording.response_unit)
    drawing, ((loop, series), (over_drive, over_time)) = canvas(
        6.4, 2, 2, sharex="col", sharey="row", gridspec_kw={"height_ratios": (3, 2)}
    )
    drive, times = recording.drive[used], recording.times[used]
    measured, simulated = recording.response[used], simulation[used]
    pixels = {"rasterized": drive.size > DENSE}
    loop.plot(drive, measured, color=MEASURED, lw=2.4, alpha=0.5, **pixels)
    loop.plot(drive, simulated, color=COLOURS[0], **pixels)
    loop.legend(["measured", name], loc="upper left")
    series.plot(*thinned(times, measured), color=MEASURED, lw=2.4, alpha=0.5)
    series.plot(*thinned(times, simulated), color=COLOURS[0])
    over_drive.plot(drive, measured - simulated, color=COLOURS[0], lw=0.7, **pixels)
    over_time.plot(*thinned(times, measured - simulated), color=COLOURS[0], lw=0.7)
    for panel in (over_drive, over_time):
        noise_band(panel, noise.sigma)
    over_time.set_title("grey: ±2 standard deviations of the noise", fontsize=9)
    loop.set_ylabel(f"response [{unit}]")
    over_drive.set_ylabel(f"measured − simulated [{unit}]")
    over_drive.set_xlabel(f"drive [{pretty_unit(recording.drive_unit)}]")
    over_time.set_xlabel("time [s]")
    return drawing


@mpl.rc_context(STYLE)
def draw_residuals(
    take: Take, noise: Noise, names: Sequence[str], simulations: Sequence[np.ndarray]
) -> Drawing:
    """The residual of several models of one recording over time, with the noise band."""
    recording, used = take.recording, take.used
    rows = len(names)
    drawing, axes = canvas(0.9 + 1.75 * rows, rows, 1, sharex=True, sharey=True)
    for k, (panel, name, simulation) in enumerate(zip(axes[:, 0], names, simulations, strict=True)):
        residual = (recording.response - simulation)[used]
        noise_band(panel, noise.sigma)
        colour = COLOURS[k % len(COLOURS)]
        panel.plot(*thinned(recording.times[used], residual), color=colour, lw=0.7)
        rms = float(np.sqrt(np.mean(residual**2)))
        panel.set_title(f"{name}: {quantity(rms, recording.response_unit)} rms")
    axes[-1, 0].set_xlabel("time [s]")
    drawing.supylabel(f"measured − simulated [{pretty_unit(recording.response_unit)}]", fontsize=11)
    return drawing


@mpl.rc_context({**STYLE, "axes.grid.axis": "x"})
def draw_errors(
    names: Sequence[str], fitted: Sequence[float], unseen: Sequence[float], noise: Noise
) -> Drawing:
    """The rms error of each model on the data fitted and on data held out, the first on top."""
    drawing, axes = canvas(1.2 + 0.55 * len(names))
    panel, places = axes[0, 0], -np.arange(len(names))
    panel.barh(places + 0.2, fitted, 0.36, color=COLOURS[1], label="fitted")
    panel.barh(places - 0.2, unseen, 0.36, color=COLOURS[0], label="held out")
    if noise.method != "residual":
        panel.axvline(noise.sigma, color=MEASURED, ls="--", lw=1, label="noise floor")
    panel.set_yticks(places, names)
    panel.set_xlabel(f"rms error [{pretty_unit(noise.unit)}]")
    panel.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, borderaxespad=0)
    return drawing


def _within(panel: Axes, low: float, high: float) -> None:
    """Draw the band that holds 99 % of what chance causes."""
    panel.axhspan(low, high, color=BAND, lw=0)
    for edge in (low, high):
        panel.axhline(edge, color=MEASURED, lw=0.8, ls="--", zorder=3)


def _stems(panel: Axes, places: np.ndarray, heights: np.ndarray, band: float) -> None:
    """Draw correlations (L,) over lags (L,), with the band of ± `band`."""
    _within(panel, -band, band)
    panel.vlines(places, 0, heights, color=COLOURS[1], lw=2)
    top = 1.15 * max(float(np.abs(heights).max()), 2 * band)
    panel.set_ylim(-top, top)
    panel.set_xlabel("lag [samples]")


@mpl.rc_context(STYLE)
def draw_residual_tests(
    histogram: tuple[np.ndarray, np.ndarray],
    autocorrelation: tuple[np.ndarray, float],
    cross_correlation: tuple[np.ndarray, float],
    spreads: tuple[np.ndarray, np.ndarray, tuple[float, float]],
) -> Drawing:
    """The residual's histogram, autocorrelation, correlation with the drive, and level in time.

    The histogram is given by the edges (B+1,) of its bins, in units of the noise as all is here,
    and the densities in them; the levels `spreads` (K,) by times (K+1,) [s] and the band that holds
    99 % of them; the correlations, at lags from 1 and from -L to L, by the width of their band.
    """
    (edges, densities), (levels, times, (low, high)) = histogram, spreads
    drawing, ((distribution, auto), (cross, spread)) = canvas(6.4, 2, 2)
    distribution.stairs(densities, edges, fill=True, color=COLOURS[1])
    distribution.plot(edges, norm.pdf(edges), color=MEASURED, label="normal")
    distribution.legend(loc="upper right")
    distribution.set_title("distribution")
    distribution.set_xlabel("residual over noise")
    lags = autocorrelation[0].size
    _stems(auto, np.arange(1, lags + 1), *autocorrelation)
    auto.set_title("autocorrelation")
    _stems(cross, np.arange(-lags, lags + 1), *cross_correlation)
    cross.set_title("correlation with the drive, which leads at positive lags")
    _within(spread, low, high)
    spread.stairs(levels, times, color=COLOURS[1], lw=2)
    spread.set_ylim(0, 1.2 * float(np.nanmax([high, *levels])))
    spread.set_title("standard deviation over time, in units of the noise")
    spread.set_xlabel("time [s]")
    return drawing
