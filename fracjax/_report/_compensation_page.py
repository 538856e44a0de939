"""The report of a compensation, and its summary on the terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup

from .._compensate import Compensation, Stretch
from .._show import figure, pretty_unit, quantity
from .._show.drawing import BAND, COLOURS, MEASURED, STYLE, canvas, svg, thinned
from ._text import download

_BADGES = {
    "followed": "followed",
    "limited": "out of reach within the limits",
    "approximate": "followed approximately",
}
_COARSE = 1e-3
"""A larger discretisation error, as a share of the stroke, is warned of; chosen by judgement."""


def compensation_content(compensation: Compensation) -> dict[str, Any]:
    """The template's content."""
    _, rows = compensation_figures(compensation)
    return {
        "title": f"Compensation along {Path(compensation.source).name}",
        "sentence": compensation_sentence(compensation),
        "badge": _BADGES[compensation.verdict] if compensation.converged else "not converged",
        "verdict": "none" if compensation.verdict == "followed" else "unexplained",
        "rows": rows,
        "warnings": compensation_warnings(compensation),
        "stretches": [
            _stretch_row(stretch, compensation)
            for stretch in (*compensation.missed, *compensation.binding)
        ],
        "motion": _motion(compensation),
        "drive": _drive(compensation),
        "error": _error(compensation),
        "downloads": [download("compensation.json", compensation.to_dict())],
    }


def compensation_sentence(compensation: Compensation) -> str:
    """Whether the response follows, where it misses the trajectory, and the one error to expect on
    the stage."""
    expected = compensation.expected
    return _along(compensation) + (f" On the stage expect {expected}." if expected else "")


def _along(compensation: Compensation) -> str:
    """Whether the response follows the trajectory, or where it misses it."""
    model, (drive, unit) = compensation.model, compensation.units
    name = Path(compensation.source).name
    share = figure(100 * compensation.max_error / compensation.stroke)
    used = f"{figure(compensation.drive.min(), 4)} to {quantity(compensation.drive.max(), drive)}"
    if not compensation.missed:
        return f"{model} follows {name}; the drive is {used}."
    error = f"{quantity(compensation.max_error, unit)} ({share} % of the stroke)"
    time = sum(stretch.stop - stretch.start for stretch in compensation.missed)
    worst = compensation.times[np.argmax(np.abs(compensation.error))]
    why = f" within {_limits(compensation)}" if compensation.verdict == "limited" else ""
    return (
        f"{model} cannot follow {name}{why}: with the best drive it is off by {error} at "
        f"{figure(worst)} s, and by more than 0.1 % of the stroke for {figure(time)} s in total."
    )


def _limits(compensation: Compensation) -> str:
    """The limits of drive and slew rate in words."""
    unit, limits = compensation.units[0], []
    if compensation.limits is not None:
        limits.append(
            f"{figure(compensation.limits[0])} to {quantity(compensation.limits[1], unit)}"
        )
    if compensation.slew is not None:
        limits.append(quantity(compensation.slew, f"{unit}/s"))
    return " and ".join(limits)


def compensation_figures(compensation: Compensation) -> tuple[list[str], list[list[str]]]:
    """The table of key figures: no headers, and its rows."""
    unit = compensation.units[1]

    def error(value: float) -> str:
        return (
            f"{quantity(value, unit)}, {figure(100 * value / compensation.stroke)} % of the stroke"
        )

    rows = [
        *(
            [["error to expect on the stage", compensation.expected]]
            if compensation.expected
            else []
        ),
        ["of the inversion, largest", error(compensation.max_error)],
        ["of the inversion, rms", error(compensation.rms_error)],
        ["discretisation", f"{figure(100 * compensation.numerics)} % of the stroke"],
        ["method", f"{compensation.method}, {compensation.iterations} iterations"],
        ["limits", _limits(compensation) or "none"],
    ]
    if compensation.offset:
        rows.append(["model's zero", f"sensor at {quantity(compensation.offset, unit)}"])
    if compensation.band is not None:
        width = float(np.max(compensation.band[1] - compensation.band[0]))
        rows.append(["95 % band of the parameters", f"{quantity(width, unit)} wide at most"])
    if compensation.max_error_of_band is not None:
        rows.append(["largest error within the band", error(compensation.max_error_of_band)])
    return [], rows


def compensation_warnings(compensation: Compensation) -> list[str]:
    """Warnings about the model, convergence, blocks left out, and discretisation."""
    warnings = list(compensation.warnings)
    if not compensation.converged:
        warnings.append("The inversion did not converge: this is the best drive that it reached.")
    if compensation.left_out:
        warnings.append(
            f"{' and '.join(compensation.left_out)} belonged to the recorded run and were left "
            "out: their phase will differ in the next run."
        )
    if compensation.numerics > _COARSE:
        warnings.append(
            "Halving the grid's step changes the prediction by "
            f"{figure(100 * compensation.numerics)} % of the stroke: give the trajectory more "
            "samples."
        )
    return warnings


def _stretch_row(stretch: Stretch, compensation: Compensation) -> dict[str, str]:
    """A stretch as a row of the table."""
    unit = {"missed": compensation.units[1], "slew limit": f"{compensation.units[0]}/s"}
    return {
        "kind": stretch.kind,
        "start": f"{stretch.start:.6g}",
        "stop": f"{stretch.stop:.6g}",
        "value": quantity(stretch.largest, unit.get(stretch.kind, compensation.units[0])),
    }


@mpl.rc_context(STYLE)
def _motion(compensation: Compensation) -> Markup:
    """Desired and predicted response over time."""
    drawing, axes = canvas(3.4)
    panel, times = axes[0, 0], compensation.times
    if compensation.band is not None:
        panel.fill_between(times, *compensation.band, color=BAND, lw=0, rasterized=True)
    panel.plot(
        *thinned(times, compensation.desired), color=MEASURED, lw=2.4, alpha=0.5, label="desired"
    )
    panel.plot(*thinned(times, compensation.predicted), color=COLOURS[1], label="predicted")
    panel.set(xlabel="time [s]", ylabel=f"response [{pretty_unit(compensation.units[1])}]")
    panel.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0)
    return svg(drawing)


@mpl.rc_context(STYLE)
def _drive(compensation: Compensation) -> Markup:
    """The drive over time with its limits, and over the response."""
    drawing, axes = canvas(3.4, 1, 2, gridspec_kw={"width_ratios": (2, 1)})
    panel, loop = axes[0]
    panel.plot(*thinned(compensation.times, compensation.drive), color=COLOURS[0])
    for level in compensation.limits or ():
        panel.axhline(level, color=MEASURED, lw=0.8, ls="--")
    for stretch in compensation.binding:
        panel.axvspan(stretch.start, stretch.stop, color=BAND, lw=0, zorder=0)
    unit = f"drive [{pretty_unit(compensation.units[0])}]"
    panel.set(xlabel="time [s]", ylabel=unit)
    loop.plot(compensation.predicted, compensation.drive, color=COLOURS[0], rasterized=True)
    loop.set(xlabel=f"response [{pretty_unit(compensation.units[1])}]")
    return svg(drawing)


@mpl.rc_context(STYLE)
def _error(compensation: Compensation) -> Markup:
    """Predicted minus desired response over time."""
    drawing, axes = canvas(2.6)
    panel = axes[0, 0]
    if compensation.band is not None:
        panel.fill_between(
            compensation.times,
            *(compensation.band - compensation.desired),
            color=BAND,
            lw=0,
            rasterized=True,
        )
    panel.plot(*thinned(compensation.times, compensation.error), color=COLOURS[1], lw=0.7)
    unit = pretty_unit(compensation.units[1])
    panel.set(xlabel="time [s]", ylabel=f"predicted − desired [{unit}]")
    return svg(drawing)
