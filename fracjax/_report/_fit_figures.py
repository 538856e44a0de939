"""Figures of fits: tests of the residual, Bode plots and profiles."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from scipy.stats import norm

from .._fit import Profile, ResidualAnalysis
from .._frequency import FrequencyFit
from ._colours import COLOURS
from ._figures import _BAND, _STYLE, MEASURED, _canvas, _svg
from ._numbers import pretty_unit

_BINS = 41
"""Edges of the histogram's bins."""
_WIDEST = 5.0
"""The histogram ends at most at so many standard deviations, or at 4 if that is more."""
_COLUMNS = 3
"""Profiles side by side."""
_LOGARITHMIC = 30.0
"""Profiles that span more than this factor have a logarithmic axis."""


def _within(panel: Axes, low: float, high: float) -> None:
    """Draw the band that holds 99 % of what chance causes."""
    panel.axhspan(low, high, color=_BAND, lw=0)
    for edge in (low, high):
        panel.axhline(edge, color=MEASURED, lw=0.8, ls="--", zorder=3)


def _stems(panel: Axes, places: np.ndarray, heights: np.ndarray, band: float) -> None:
    """Draw correlations (L,) over lags (L,), with the band of ± `band`."""
    _within(panel, -band, band)
    panel.vlines(places, 0, heights, color=COLOURS[1], lw=2)
    top = 1.15 * max(float(np.abs(heights).max()), 2 * band)
    panel.set_ylim(-top, top)
    panel.set_xlabel("lag [samples]")


@mpl.rc_context(_STYLE)
def residual_tests(analysis: ResidualAnalysis) -> Markup:
    """The residual's histogram, autocorrelation, correlation with the drive, and level in time."""
    drawing, ((histogram, auto), (cross, spread)) = _canvas(6.4, 2, 2)
    width = float(np.clip(np.abs(analysis.residual).max(), 4, _WIDEST * analysis.residual.std()))
    bins = np.linspace(-width, width, _BINS)
    histogram.hist(
        np.clip(analysis.residual, -width, width), bins=bins, density=True, color=COLOURS[1]
    )
    histogram.plot(bins, norm.pdf(bins), color=MEASURED, label="normal")
    histogram.legend(loc="upper right")
    histogram.set_title("distribution")
    histogram.set_xlabel("residual over noise")
    lags = analysis.autocorrelation.size
    _stems(auto, np.arange(1, lags + 1), analysis.autocorrelation, analysis.band)
    auto.set_title("autocorrelation")
    _stems(cross, np.arange(-lags, lags + 1), analysis.cross_correlation, analysis.cross_band)
    cross.set_title("correlation with the drive, which leads at positive lags")
    per_bin = analysis.residual.size / analysis.spreads.size
    level = float(np.sqrt(np.mean(analysis.residual**2)))
    reach = level * norm.ppf(0.995) / np.sqrt(2 * per_bin)
    _within(spread, level - reach, level + reach)
    spread.stairs(analysis.spreads, analysis.edges, color=COLOURS[1], lw=2)
    spread.set_ylim(0, 1.2 * float(np.nanmax([level + reach, *analysis.spreads])))
    spread.set_title("standard deviation over time, in units of the noise")
    spread.set_xlabel("time [s]")
    return _svg(drawing)


@mpl.rc_context(_STYLE)
def bode_plot(fits: Sequence[FrequencyFit]) -> Markup:
    """Magnitude and phase measured and fitted, and the residuals below them."""
    drawing, panels = _canvas(6.4, 2, 2, sharex=True, gridspec_kw={"height_ratios": (3, 2)})
    table = fits[0].table
    frequencies, ratio = table.frequencies_Hz, table.response
    (magnitude, phase), (magnitude_residual, phase_residual) = panels
    style = {"color": MEASURED, "ls": "", "marker": "o", "ms": 4, "alpha": 0.6}
    magnitude.plot(frequencies, np.abs(ratio), label="measured", **style)
    phase.plot(frequencies, np.degrees(np.unwrap(np.angle(ratio))), **style)
    for errors, panel, scale in (
        (table.amplitude_errors, magnitude_residual, 20 / np.log(10)),
        (table.phase_errors, phase_residual, 180 / np.pi),
    ):
        if errors is not None:
            panel.fill_between(
                frequencies, -2 * scale * errors, 2 * scale * errors, color=_BAND, lw=0
            )
    for fit, colour in zip(fits, COLOURS, strict=False):
        quotient = ratio / fit.fitted
        magnitude.plot(frequencies, np.abs(fit.fitted), color=colour, label=fit.model.name)
        # The model's phase, on the same branch of the phase as the measured one.
        angles = np.unwrap(np.angle(ratio)) - np.angle(quotient)
        phase.plot(frequencies, np.degrees(angles), color=colour)
        magnitude_residual.plot(
            frequencies, 20 * np.log10(np.abs(quotient)), color=colour, marker="."
        )
        phase_residual.plot(frequencies, np.degrees(np.angle(quotient)), color=colour, marker=".")
    magnitude.set_xscale("log")
    magnitude.set_yscale("log")
    unit = f"{pretty_unit(table.response_unit)}/{pretty_unit(table.drive_unit)}"
    magnitude.set_ylabel(f"amplitude [{unit}]")
    phase.set_ylabel("phase [degrees]")
    magnitude_residual.set_ylabel("measured − fitted [dB]")
    phase_residual.set_ylabel("measured − fitted [degrees]")
    magnitude.legend(loc="best")
    for panel in panels[1]:
        panel.set_xlabel("frequency [Hz]")
    return _svg(drawing)


@mpl.rc_context(_STYLE)
def profiles(computed: Sequence[Profile]) -> Markup:
    """Δχ² of each parameter, with the levels of 68 and 95 %."""
    rows = -(-len(computed) // _COLUMNS)
    columns = min(len(computed), _COLUMNS)
    drawing, panels = _canvas(0.4 + 2.9 * rows, rows, columns, sharey=True)
    for panel in panels.flat[len(computed) :]:
        panel.set_axis_off()
    for panel, profile in zip(panels.flat, computed, strict=False):
        panel.plot(profile.values, profile.delta, color=COLOURS[0], marker="o", ms=3)
        panel.plot(profile.values, _parabola(profile), color=MEASURED, lw=0.9, ls=":", scalex=False)
        for level, name in ((1.0, "68 %"), (3.84, "95 %")):
            panel.axhline(level, color=MEASURED, lw=0.8, ls="--")
            panel.annotate(name, (1, level), (-2, 2), xycoords=("axes fraction", "data"),
                           textcoords="offset points", ha="right", fontsize=9)  # fmt: skip
        panel.set_ylim(0, 6)
        if profile.values.min() > 0 and profile.values.max() > _LOGARITHMIC * profile.values.min():
            panel.set_xscale("log")
        unit = pretty_unit(profile.unit)
        panel.set_xlabel(f"{profile.name} [{unit}]" if unit else profile.name)
        panel.set_title("open" if profile.open else "")
    for row in panels:
        row[0].set_ylabel("Δχ²")
    return _svg(drawing)


def _parabola(profile: Profile) -> np.ndarray:
    """The parabola of Δχ² that the standard error implies."""
    return ((profile.values - profile.estimate) / profile.standard_error) ** 2
