"""The section of a report on its recordings: linked plots, and the strips of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from .._fit import Fit, Predicted, ResidualAnalysis
from .._prepare import Noise
from .._show import CANDIDATES, COLOURS
from ._embedding import PlottedFigure, embedded, placed
from ._linked import Curve, LinkedPlots, link, linked_plots
from ._plot import MEASURED
from ._residual_plots import PLOTS, residual_plots
from ._strips import strips

if TYPE_CHECKING:
    from .._diagnose import Diagnosis

MOST_RECORDINGS = 3
"""Most recordings drawn."""


class Layer(NamedTuple):
    """What a box of the report shows or hides."""

    key: str
    label: str
    colour: str
    shown: bool


def recordings_section(
    fits: Sequence[Fit],
    noise: Noise,
    diagnosis: Diagnosis | None = None,
    tests: Sequence[ResidualAnalysis] = (),
    predicted: Sequence[Predicted] = (),
    beside: Mapping[str, PlottedFigure] = MappingProxyType({}),
) -> dict[str, Any]:
    """The template's content: the elements of the plots, the layers to choose from, the scripts.

    `fits` are of the same recordings; of a diagnosis its axes and candidates are drawn too, and
    the tests of residuals; behind the recordings those held out, as `predicted`,
    and `beside` them other figures by their names in the template.
    """
    axes = () if diagnosis is None else diagnosis.axes
    candidates = _candidates(diagnosis)
    takes = fits[0].preparation.takes
    names = [fit.model.name for fit in fits]
    plots = [
        linked_plots(
            take.recording,
            take.used,
            _curves(fits, index),
            noise.sigma,
            axes,
            _explained(fits[0], index, candidates),
        )
        for index, take in enumerate(takes[:MOST_RECORDINGS])
    ]
    drawn_takes = len(plots)
    sources = [Path(take.recording.source).name for take in takes[:MOST_RECORDINGS]]
    for one in predicted[:MOST_RECORDINGS]:
        curves = [Curve(*each) for each in zip(names, one.responses, COLOURS, strict=False)]
        plots.append(linked_plots(one.recording, one.scored, curves, noise.sigma))
        sources.append(f"{Path(one.recording.source).name}, held out: no fit has seen it")
    located = strips(axes) if axes else []
    link(plots, located, names, noise.unit)
    drawn = [figure for plot in plots for figure in plot.figures]
    drawn += [strip.plot for strip in located]
    tested = [plot for analysis in tests for plot in residual_plots(analysis)]
    others = [plot for figure in beside.values() for plot in figure.plots]
    elements, scripts = embedded([*drawn, *tested, *others])
    return {
        "recordings": [
            {
                "source": source,
                "elements": elements[5 * index : 5 * index + 5],
                "note": _note(plot),
            }
            for index, (source, plot) in enumerate(zip(sources, plots, strict=True))
        ],
        "omitted": len(takes) - drawn_takes,
        "strips": elements[len(drawn) - len(located) : len(drawn)],
        "residual_tests": [
            {
                "source": analysis.source,
                "findings": analysis.findings,
                "elements": elements[len(drawn) + PLOTS * index :][:PLOTS],
            }
            for index, analysis in enumerate(tests)
        ],
        "figures": placed(beside, elements[len(elements) - len(others) :]),
        "layers": [
            Layer("measured", "measured", MEASURED, True),
            *(
                Layer(f"model_{k}", name, colour, True)
                for k, (name, colour) in enumerate(zip(names, COLOURS, strict=False))
            ),
            *(
                Layer(f"candidate_{k}", f"what {name} would explain", colour, False)
                for k, (name, colour) in enumerate(zip(candidates, CANDIDATES, strict=False))
            ),
        ],
        "scripts": scripts,
    }


def _candidates(diagnosis: Diagnosis | None) -> list[str]:
    """The candidates whose changes of the response are drawn."""
    if diagnosis is None:
        return []
    from ._explained import drawn_candidates

    return [candidate.name for candidate in drawn_candidates(diagnosis)]


def _explained(base: Fit, index: int, candidates: Sequence[str]) -> list[Curve]:
    """What candidates would explain of the residual of one recording."""
    if not candidates:
        return []
    from ._explained import explained_by

    curves = explained_by(base, index, candidates)
    return [Curve(*each) for each in zip(candidates, curves, CANDIDATES, strict=False)]


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
