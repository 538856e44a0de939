"""A picture of a diagnosis: the residual before and after, and the evidence for each effect."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np

from .._prepare import Noise, Take
from .._show import pretty_unit, quantity
from .._show.drawing import BAND, COLOURS, STYLE, Drawing, canvas, noise_band, thinned

_MOST = 10
"""Most effects that are drawn."""


@mpl.rc_context(STYLE)
def draw_diagnosis(
    take: Take,
    noise: Noise,
    simulations: Mapping[str, np.ndarray],
    evidence: Mapping[str, tuple[float, bool]],
) -> Drawing:
    """Draw the residual of each model (N,) over time beside the scores of the effects.

    `evidence` has, by effect, its score |z| and whether it is named.
    """
    recording, used = take.recording, take.used
    count = len(simulations)
    drawing, panels = canvas(
        1.6 + 2.2 * count, count, 2, sharex="col", gridspec_kw={"width_ratios": (2, 1)}
    )
    for panel in panels[:, 1]:
        panel.remove()
    strength = drawing.add_subplot(panels[0, 0].get_gridspec()[:, 1])
    unit = recording.response_unit
    for panel, (name, simulation), colour in zip(
        panels[:, 0], simulations.items(), COLOURS, strict=False
    ):
        residual = (recording.response - simulation)[used]
        noise_band(panel, noise.sigma)
        panel.plot(*thinned(recording.times[used], residual), color=colour, lw=0.7)
        panel.sharey(panels[0, 0])
        rms = float(np.sqrt(np.mean(residual**2)))
        panel.set_title(f"{name}: {quantity(rms, unit)} rms")
        panel.set_ylabel(f"measured − simulated [{pretty_unit(unit)}]", fontsize=9)
    panels[-1, 0].set_xlabel("time [s]")
    shown = dict(sorted(evidence.items(), key=lambda pair: -pair[1][0])[:_MOST])
    scores = [score for score, _ in shown.values()]
    colours = [COLOURS[0] if is_named else BAND for _, is_named in shown.values()]
    strength.barh(list(shown), scores, color=colours)
    strength.invert_yaxis()
    strength.grid(visible=False, axis="y")
    strength.set_xlabel("score |z| of the effect")
    return drawing
