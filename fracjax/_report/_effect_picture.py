"""A picture of an effect: the change that it causes for a drive of two amplitudes and speeds."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import jax
import matplotlib as mpl
import numpy as np

from .._blocks import EFFECTS, AbstractBlock, Effect, Gain, Setting
from .._models import parse_model
from .._operators import Grid
from .._prepare import prepare
from .._recording import Recording
from .._show import figure
from .._show.drawing import COLOURS, MEASURED, STYLE, canvas

_STEP = 5e-4
"""Time step of the picture's drive [s]."""
_SPAN = 10.0
"""Span of the response without the effect [µm]."""
_RESOLUTION = 0.1
"""Step between the codes of the response [µm], for quantisation."""
_NARROW = 5.2
"""Width of a stacked picture [inch]."""
_VISIBLE = 0.15
"""Share of the response's span to which a smaller change is magnified in the loop."""


def _drive() -> np.ndarray:
    """A drive [V] of 0 to 100 V over 4 s."""
    t = np.arange(0, 4, _STEP)
    slow, later, fast = (np.sin(np.pi * x) ** 2 for x in (t, t - 1.5, 4 * t))
    times = [t < 1, t < 1.5, t < 2.5, t < 3]
    return np.select(times, [100 * slow, 0.0, 50 * later, 0.0], 70 * fast)


@cache
def _without() -> tuple[AbstractBlock, Setting, np.ndarray]:
    """The model foh, the scales of the drive, and its response [µm]."""
    drive = _drive()
    codes = np.round(_SPAN / _RESOLUTION * drive / np.ptp(drive))
    setting = prepare([Recording(drive, _RESOLUTION * codes, _STEP, "V", "um")]).setting
    foh = parse_model("foh", setting).block
    base = foh >> Gain(_SPAN / float(np.ptp(foh.respond(drive, _grid()))))
    return base, setting, np.asarray(base.respond(drive, _grid()))


def _grid() -> Grid:
    return Grid(np.asarray(_STEP), "constant")


def _largest_change(effect: Effect) -> np.ndarray:
    """The change of the response [µm] by that trial of an effect that changes it most."""
    drive = _drive()
    with jax.enable_x64(True):
        base, setting, plain = _without()
        trials = effect.trials(setting)
        changes = [effect.respond(base, t, drive, plain, _grid()) - plain for t in trials]
    return max(changes, key=lambda change: float(change.std()))


def draw_effect(name: str, path: Path, *, stacked: bool = False) -> None:
    """Draw an effect on the hysteresis model foh: loops with and without it, and the change.

    The suffix of the path sets the format, such as .svg or .png.  Stacked, the change stands below
    the loop, for a narrow page.
    """
    drive, change = _drive(), _largest_change(EFFECTS[name])
    plain = _without()[2]
    times = _STEP * np.arange(drive.size)
    factor = max(1.0, _VISIBLE * np.ptp(plain) / max(float(np.abs(change).max()), 1e-12))
    factor = float(f"{factor:.1g}")
    with mpl.rc_context(STYLE):
        drawing, axes = canvas(6.4, 2, 1) if stacked else canvas(4.0, 1, 2)
        if stacked:
            drawing.set_size_inches(_NARROW, 6.4)
        loop, series = axes.flat
        loop.plot(drive, plain, color=MEASURED, lw=2.4, alpha=0.5, label="without")
        magnified = "" if factor == 1 else f", magnified {factor:g} times"
        loop.plot(drive, plain + factor * change, color=COLOURS[0], label=f"with{magnified}")
        loop.legend(loc="lower right")
        loop.set_title(name)
        loop.set_xlabel("drive [V]")
        loop.set_ylabel("response [µm]")
        series.plot(times, change, color=COLOURS[0])
        series.set_title(f"change of the response, at most {figure(np.abs(change).max())} µm")
        series.set_xlabel("time [s]")
        series.set_ylabel("change [µm]")
        second = series.twinx()
        second.plot(times, drive, color=MEASURED, lw=0.8, alpha=0.5)
        second.set_ylabel("drive [V]")
        second.grid(visible=False)
        drawing.savefig(path)
