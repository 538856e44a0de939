"""Pictures of a compensation: motion, drive, and predicted error."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np

from .._show import pretty_unit
from .._show.drawing import BAND, COLOURS, MEASURED, STYLE, Drawing, canvas, thinned


@mpl.rc_context(STYLE)
def draw_compensation(
    times: np.ndarray,
    signals: Mapping[str, np.ndarray],
    band: np.ndarray | None,
    units: tuple[str, str],
    limits: tuple[float, float] | None,
) -> Drawing:
    """Draw the signals (N,) "desired", "predicted" and "drive", and the predicted error, over times
    (N,) [s], with the band (2, N) of the prediction and the limits of the drive."""
    drawing, axes = canvas(7.2, 3, 1, sharex=True, gridspec_kw={"height_ratios": (3, 2, 2)})
    motion, drive, error = axes[:, 0]
    desired, predicted = signals["desired"], signals["predicted"]
    if band is not None:
        motion.fill_between(times, *band, color=BAND, lw=0, rasterized=True)
        error.fill_between(times, *(band - desired), color=BAND, lw=0, rasterized=True)
    motion.plot(*thinned(times, desired), color=MEASURED, lw=2.4, alpha=0.5, label="desired")
    motion.plot(*thinned(times, predicted), color=COLOURS[1], label="predicted")
    motion.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0)
    drive.plot(*thinned(times, signals["drive"]), color=COLOURS[0])
    for level in limits or ():
        drive.axhline(level, color=MEASURED, lw=0.8, ls="--")
    error.plot(*thinned(times, predicted - desired), color=COLOURS[1], lw=0.7)
    response = pretty_unit(units[1])
    motion.set_ylabel(f"response [{response}]")
    drive.set_ylabel(f"drive [{pretty_unit(units[0])}]")
    error.set(xlabel="time [s]", ylabel=f"error [{response}]")
    return drawing


@mpl.rc_context(STYLE)
def draw_error(times: np.ndarray, error: np.ndarray, unit: str) -> Drawing:
    """Draw the predicted error (N,) over times (N,) [s]."""
    drawing, axes = canvas(2.6)
    axes[0, 0].plot(*thinned(times, error), color=COLOURS[1], lw=0.7)
    axes[0, 0].set(xlabel="time [s]", ylabel=f"predicted − desired [{pretty_unit(unit)}]")
    return drawing
