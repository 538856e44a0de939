"""The section of a report on its recordings: linked plots, and the strips of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .._diagnose import Axis
from .._fit import Fit
from .._prepare import Noise
from ._colours import COLOURS
from ._embedding import embedded
from ._linked import Curve, LinkedPlots, link, linked_plots
from ._plot import MEASURED
from ._strips import strips

MOST_RECORDINGS = 3
"""Most recordings drawn."""


def recordings_section(
    fits: Sequence[Fit], noise: Noise, axes: Sequence[Axis] = ()
) -> dict[str, Any]:
    """The template's content: the elements of the plots, the layers to choose from, the scripts.

    `fits` are of the same recordings; `axes` those of a diagnosis.
    """
    takes = fits[0].preparation.takes
    names = [fit.model.name for fit in fits]
    plots = [
        linked_plots(take.recording, take.used, _curves(fits, index), noise.sigma, axes)
        for index, take in enumerate(takes[:MOST_RECORDINGS])
    ]
    located = strips(axes) if axes else []
    link(plots, located, names, noise.unit)
    drawn = [figure for plot in plots for figure in plot.figures]
    elements, scripts = embedded([*drawn, *(strip.plot for strip in located)])
    return {
        "recordings": [
            {
                "source": Path(take.recording.source).name,
                "elements": elements[5 * index : 5 * index + 5],
                "note": _note(plot),
            }
            for index, (take, plot) in enumerate(zip(takes, plots, strict=False))
        ],
        "omitted": len(takes) - len(plots),
        "strips": elements[len(drawn) :],
        "layers": [
            ("measured", "measured", MEASURED),
            *(
                (f"model_{k}", name, colour)
                for k, (name, colour) in enumerate(zip(names, COLOURS, strict=False))
            ),
        ],
        "scripts": scripts,
    }


def _curves(fits: Sequence[Fit], index: int) -> list[Curve]:
    """The simulations of one recording."""
    return [
        Curve(fit.model.name, fit.simulations[index], colour)
        for fit, colour in zip(fits, COLOURS, strict=False)
    ]


def _note(plot: LinkedPlots) -> str:
    """How many samples are drawn, where it is not all of them."""
    if plot.drawn == plot.count:
        return ""
    return (
        f"Of {plot.count} samples the {plot.drawn} are drawn in which the drive, the response or a "
        "residual is extreme within a thousandth of the recording."
    )
