"""What the page of a compensation holds, and what the terminal says of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup

from .._compensate import Compensation, Stretch
from ._figures import _BAND, _STYLE, COLOURS, MEASURED, _canvas, _svg, _thinned
from ._text import download, figure, pretty_unit, quantity

_BADGES = {
    "followed": "followed",
    "limited": "out of reach within the limits",
    "approximate": "followed approximately",
}
_COARSE = 1e-3


def of_compensation(found: Compensation) -> dict[str, Any]:
    """The template's content."""
    _, rows = compensation_figures(found)
    return {
        "title": f"Compensation along {Path(found.source).name}",
        "sentence": sentence_of(found),
        "badge": _BADGES[found.verdict] if found.converged else "not converged",
        "verdict": "none" if found.verdict == "followed" else "unexplained",
        "rows": rows,
        "warnings": warnings_of(found),
        "stretches": [_told(stretch, found) for stretch in (*found.missed, *found.binding)],
        "motion": _motion(found),
        "drive": _drive(found),
        "error": _error(found),
        "downloads": [download("compensation.json", found.to_dict())],
    }


def sentence_of(found: Compensation) -> str:
    """How near the predicted response comes, and where it does not."""
    drive, unit = found.units
    name, share = Path(found.source).name, figure(100 * found.max_error / found.stroke)
    error = f"{quantity(found.max_error, unit)} at most ({share} % of the stroke)"
    used = f"{figure(found.drive.min(), 4)} to {quantity(found.drive.max(), drive)}"
    if found.verdict == "followed":
        return (
            f"{found.model} follows {name} with a predicted error of {error}, driven from {used}."
        )
    if not found.missed:
        return (
            f"{found.model} follows {name} to a predicted error of {error}, driven by {used}; "
            "no drive found comes nearer."
        )
    time = sum(stretch.stop - stretch.start for stretch in found.missed)
    worst = found.times[np.argmax(np.abs(found.error))]
    why = f" within {_limits(found)}" if found.verdict == "limited" else ""
    return (
        f"{found.model} cannot follow {name}{why}: the best drive found misses it by {error}, at "
        f"{figure(worst)} s, and by more than 0.1 % for {figure(time)} s in all."
    )


def _limits(found: Compensation) -> str:
    unit, told = found.units[0], []
    if found.limits is not None:
        told.append(f"{figure(found.limits[0])} to {quantity(found.limits[1], unit)}")
    if found.slew is not None:
        told.append(quantity(found.slew, f"{unit}/s"))
    return " and ".join(told)


def compensation_figures(found: Compensation) -> tuple[list[str], list[list[str]]]:
    """No heads, and rows of the table of key figures."""
    unit = found.units[1]

    def error(value: float) -> str:
        return f"{quantity(value, unit)}, {figure(100 * value / found.stroke)} % of the stroke"

    rows = [
        ["largest predicted error", error(found.max_error)],
        ["rms predicted error", error(found.rms_error)],
        ["discretisation", f"{figure(100 * found.numerics)} % of the stroke"],
        ["found by", f"{found.method}, {found.iterations} iterations"],
        ["limits", _limits(found) or "none"],
    ]
    if found.offset:
        rows.append(["model's zero", f"sensor at {quantity(found.offset, unit)}"])
    if found.band is not None:
        width = float(np.max(found.band[1] - found.band[0]))
        rows.append(["95 % band of the parameters", f"{quantity(width, unit)} wide at most"])
    if found.max_error_of_band is not None:
        rows.append(["largest error within the band", error(found.max_error_of_band)])
    return [], rows


def warnings_of(found: Compensation) -> list[str]:
    """What to mind."""
    noted = []
    if not found.converged:
        noted.append("The inversion did not converge: this is the best drive it reached.")
    if found.left_out:
        noted.append(
            f"{' and '.join(found.left_out)} belonged to the recorded run and were left out: they "
            "will stand elsewhere in the next."
        )
    if found.numerics > _COARSE:
        noted.append(
            f"Halving the grid changes the prediction by {figure(100 * found.numerics)} % of the "
            "stroke: give the trajectory more samples."
        )
    return noted


def _told(stretch: Stretch, found: Compensation) -> dict[str, str]:
    unit = {"missed": found.units[1], "slew limit": f"{found.units[0]}/s"}
    return {
        "kind": stretch.kind,
        "start": f"{stretch.start:.6g}",
        "stop": f"{stretch.stop:.6g}",
        "value": quantity(stretch.largest, unit.get(stretch.kind, found.units[0])),
    }


@mpl.rc_context(_STYLE)
def _motion(found: Compensation) -> Markup:
    """Desired and predicted response over time."""
    drawing, axes = _canvas(3.4)
    panel, times = axes[0, 0], found.times
    if found.band is not None:
        panel.fill_between(times, *found.band, color=_BAND, lw=0, rasterized=True)
    panel.plot(*_thinned(times, found.desired), color=MEASURED, lw=2.4, alpha=0.5, label="desired")
    panel.plot(*_thinned(times, found.predicted), color=COLOURS[1], label="predicted")
    panel.set(xlabel="time [s]", ylabel=f"response [{pretty_unit(found.units[1])}]")
    panel.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0)
    return _svg(drawing)


@mpl.rc_context(_STYLE)
def _drive(found: Compensation) -> Markup:
    """The drive over time between its limits, and over the response."""
    drawing, axes = _canvas(3.4, 1, 2, gridspec_kw={"width_ratios": (2, 1)})
    panel, loop = axes[0]
    panel.plot(*_thinned(found.times, found.drive), color=COLOURS[0])
    for level in found.limits or ():
        panel.axhline(level, color=MEASURED, lw=0.8, ls="--")
    for stretch in found.binding:
        panel.axvspan(stretch.start, stretch.stop, color=_BAND, lw=0, zorder=0)
    unit = f"drive [{pretty_unit(found.units[0])}]"
    panel.set(xlabel="time [s]", ylabel=unit)
    loop.plot(found.predicted, found.drive, color=COLOURS[0], rasterized=True)
    loop.set(xlabel=f"response [{pretty_unit(found.units[1])}]")
    return _svg(drawing)


@mpl.rc_context(_STYLE)
def _error(found: Compensation) -> Markup:
    """Predicted less desired response over time."""
    drawing, axes = _canvas(2.6)
    panel = axes[0, 0]
    if found.band is not None:
        panel.fill_between(
            found.times, *(found.band - found.desired), color=_BAND, lw=0, rasterized=True
        )
    panel.plot(*_thinned(found.times, found.error), color=COLOURS[1], lw=0.7)
    unit = pretty_unit(found.units[1])
    panel.set(xlabel="time [s]", ylabel=f"predicted − desired [{unit}]")
    return _svg(drawing)
