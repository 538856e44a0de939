"""The report's figures: inline SVG, drawn with matplotlib's object interface."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from markupsafe import Markup

from .._diagnose import Candidate, HeldOut
from .._prepare import Noise
from .._protocol import Drive
from .._show import percent, pretty_unit
from .._show.drawing import COLOURS, MEASURED, STYLE, canvas, svg, thinned


@mpl.rc_context({**STYLE, "axes.grid.axis": "x"})
def hidden(candidates: Sequence[Candidate], noise: Noise, span: float) -> Markup:
    """The smallest detectable amplitude of each effect, and the share that the model conceals.

    Bars end at the response's span [response], the largest possible change.
    """
    ordered = sorted(candidates, key=lambda c: c.detectable_amplitude)
    drawing, axes = canvas(0.9 + 0.32 * len(ordered))
    panel = axes[0, 0]
    amplitudes = [min(c.detectable_amplitude, span) for c in ordered]
    panel.barh([c.name for c in ordered], amplitudes, color="#56B4E9", height=0.65)
    for row, (candidate, amplitude) in enumerate(zip(ordered, amplitudes, strict=True)):
        remark = "" if candidate.is_seen_within(span) else ", not detectable"
        panel.annotate(
            f"{percent(candidate.concealment)} concealed{remark}",
            (amplitude, row), (5, 0), textcoords="offset points",
            va="center", fontsize=10, bbox={"color": "white", "pad": 1},
        )  # fmt: skip
    panel.axvline(noise.sigma, color=MEASURED, ls="--", lw=1, zorder=1.5)
    panel.annotate("noise floor", (noise.sigma, 1), (4, 2), xycoords=("data", "axes fraction"),
                   textcoords="offset points", fontsize=10)  # fmt: skip
    panel.set_xscale("log")
    panel.set_xlim(0.5 * min(*amplitudes, noise.sigma), 6 * max(amplitudes))
    panel.set_xlabel(f"smallest detectable change of the response [{pretty_unit(noise.unit)} rms]")
    return svg(drawing)


@mpl.rc_context({**STYLE, "axes.grid.axis": "y"})
def held_out(scores: HeldOut, names: Sequence[str], noise: Noise) -> Markup:
    """Error on held-out data, fold by fold."""
    drawing, axes = canvas(3.2)
    panel = axes[0, 0]
    groups = [folds for folds in (scores.base_folds, scores.extended_folds) if folds]
    width = 0.8 / len(groups)
    for k, (folds, name) in enumerate(zip(groups, names, strict=False)):
        positions = np.arange(1, len(folds) + 1) + width * (k - (len(groups) - 1) / 2)
        panel.bar(positions, folds, width=0.92 * width, color=COLOURS[k], label=name)
    panel.axhline(noise.sigma, color=MEASURED, ls="--", lw=1, label="noise floor")
    panel.xaxis.get_major_locator().set_params(integer=True)
    panel.set_xlabel("fold")
    panel.set_ylabel(f"RMSE [{pretty_unit(noise.unit)}]")
    panel.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, borderaxespad=0)
    return svg(drawing)


@mpl.rc_context(STYLE)
def drive(proposed: Drive, unit: str) -> Markup:
    """A drive over time."""
    drawing, axes = canvas(2.2)
    (panel,) = axes.flat
    panel.plot(*thinned(proposed.times, proposed.values), color=COLOURS[0])
    panel.set_xlabel("time [s]")
    panel.set_ylabel(f"drive [{pretty_unit(unit)}]")
    return svg(drawing)
