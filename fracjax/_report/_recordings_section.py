"""The section of a report on its recordings: linked plots, and the strips of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .._fit import Fit, Predicted, ResidualAnalysis, interval_errors, interval_errors_beyond
from .._prepare import Noise
from .._recording import Recording
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
_REACH = 1.96
"""Half of the central 95 % of a normal distribution, in standard deviations."""


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
    the tests of residuals; behind the recordings those held out, as `predicted`, and `beside` them
    other figures by their names in the template.  About each model the interval of its predictions
    is drawn.
    """
    axes = () if diagnosis is None else diagnosis.axes
    candidates = _candidates(diagnosis)
    takes = fits[0].preparation.takes
    names = [fit.model.name for fit in fits]
    reaches = [[_REACH * each for each in interval_errors(fit, MOST_RECORDINGS)] for fit in fits]
    curves = [_curves(fits, reaches, index) for index in range(len(takes[:MOST_RECORDINGS]))]
    plots = [
        linked_plots(
            take.recording,
            take.used,
            curves[index],
            noise.sigma,
            axes,
            _explained(fits[0], index, candidates),
        )
        for index, take in enumerate(takes[:MOST_RECORDINGS])
    ]
    drawn_takes = len(plots)
    sources = [Path(take.recording.source).name for take in takes[:MOST_RECORDINGS]]
    notes = [
        _within(each, take.recording, take.used) for each, take in zip(curves, takes, strict=False)
    ]
    for one in predicted[:MOST_RECORDINGS]:
        reach = [_REACH * interval_errors_beyond(fit, one.recording) for fit in fits]
        about = zip(names, one.responses, COLOURS, reach, strict=False)
        curves.append([Curve(*each) for each in about])
        plots.append(linked_plots(one.recording, one.scored, curves[-1], noise.sigma))
        sources.append(f"{Path(one.recording.source).name}, held out: no fit has seen it")
        notes.append(_within(curves[-1], one.recording, one.scored))
    located = strips(axes) if axes else []
    # What is held out has a clock and places of its own.
    link(plots[:drawn_takes], located, names, noise.unit)
    link(plots[drawn_takes:], [], names, noise.unit)
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
                "note": " ".join(filter(None, (within, _note(plot)))),
            }
            for index, (source, within, plot) in enumerate(zip(sources, notes, plots, strict=True))
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


def _curves(
    fits: Sequence[Fit], reaches: Sequence[Sequence[np.ndarray]], index: int
) -> list[Curve]:
    """The simulations of one recording, with how far new samples may be off."""
    return [
        Curve(fit.model.name, fit.simulations[index], colour, reach[index])
        for fit, colour, reach in zip(fits, COLOURS, reaches, strict=False)
    ]


def _within(curves: Sequence[Curve], recording: Recording, used: np.ndarray) -> str:
    """How many of the samples (N,) that count lie in the interval of each model's predictions."""
    shares = [
        f"{100 * np.mean((np.abs(recording.response - c.response) <= c.reach)[used]):.3g} % lie in "
        f"the band of {c.name}"
        for c in curves
        if c.reach is not None
    ]
    return f"Of these samples {', '.join(shares)}."


def _note(plot: LinkedPlots) -> str:
    """How many samples are drawn, where it is not all of them."""
    if plot.drawn == plot.count:
        return ""
    return (
        f"Of {plot.count} samples the {plot.drawn} are drawn in which the drive, the response or a "
        "residual is extreme within a thousandth of the recording."
    )
