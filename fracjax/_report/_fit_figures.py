"""Figures of fits: Bode plots and profiles."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from markupsafe import Markup

from .._fit import Profile
from .._frequency import FrequencyFit
from .._show import pretty_unit
from .._show.drawing import BAND, COLOURS, MEASURED, STYLE, canvas, svg

_COLUMNS = 3
"""Profiles side by side."""
_LOGARITHMIC = 30.0
"""Profiles that span more than this factor have a logarithmic axis."""


@mpl.rc_context(STYLE)
def bode_plot(fits: Sequence[FrequencyFit]) -> Markup:
    """Magnitude and phase measured and fitted, and the residuals below them."""
    drawing, panels = canvas(6.4, 2, 2, sharex=True, gridspec_kw={"height_ratios": (3, 2)})
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
                frequencies, -2 * scale * errors, 2 * scale * errors, color=BAND, lw=0
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
    return svg(drawing)


@mpl.rc_context(STYLE)
def profiles(computed: Sequence[Profile]) -> Markup:
    """Δχ² of each parameter, with the levels of 68 and 95 %."""
    rows = -(-len(computed) // _COLUMNS)
    columns = min(len(computed), _COLUMNS)
    drawing, panels = canvas(0.4 + 2.9 * rows, rows, columns, sharey=True)
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
    return svg(drawing)


def _parabola(profile: Profile) -> np.ndarray:
    """The parabola of Δχ² that the standard error implies."""
    return ((profile.values - profile.estimate) / profile.standard_error) ** 2
