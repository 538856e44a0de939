"""A picture of an effect: the change that it causes for a drive of two amplitudes and speeds."""

from __future__ import annotations

from pathlib import Path

import jax
import matplotlib as mpl
import numpy as np

from .._blocks import EFFECTS, AbstractBlock
from .._models import parse_model
from .._operators import Grid
from .._prepare import prepare
from .._recording import Recording
from ._colours import COLOURS
from ._figures import _STYLE, MEASURED, _canvas
from ._numbers import figure

_STEP = 5e-4
"""Time step of the picture's drive [s]."""
_VISIBLE = 0.15
"""Share of the response's span to which a smaller change is magnified in the loop."""


def _drive() -> np.ndarray:
    """A drive [V] of 0 to 100 V over 4 s."""
    t = np.arange(0, 4, _STEP)
    slow, later, fast = (np.sin(np.pi * x) ** 2 for x in (t, t - 1.5, 4 * t))
    times = [t < 1, t < 1.5, t < 2.5, t < 3]
    return np.select(times, [100 * slow, 0.0, 50 * later, 0.0], 70 * fast)


def draw_effect(name: str, path: Path) -> None:
    """Draw an effect on the hysteresis model foh: loops with and without it, and the change.

    The suffix of the path sets the format, such as .svg or .png.
    """
    effect, drive = EFFECTS[name], _drive()
    with jax.enable_x64(True):
        grid = Grid(np.asarray(_STEP), "constant")
        setting = prepare([Recording(drive, 0.1 * drive, _STEP, "V", "um")]).setting
        base = parse_model("foh", setting).block
        plain = base.respond(drive, grid)
        plain = plain * (10 / np.ptp(plain))

        def changed(trial: AbstractBlock) -> np.ndarray:
            return effect.respond(base, trial, drive, plain, grid) - plain

        changes = [changed(trial) for trial in effect.trials(setting)]
    change = max(changes, key=lambda c: float(c.std()))
    times = _STEP * np.arange(drive.size)
    factor = max(1.0, _VISIBLE * np.ptp(plain) / max(float(np.abs(change).max()), 1e-12))
    factor = float(f"{factor:.1g}")
    with mpl.rc_context(_STYLE):
        drawing, axes = _canvas(4.0, 1, 2)
        loop, series = axes.flat
        loop.plot(drive, plain, color=MEASURED, lw=2.4, alpha=0.5, label="without")
        magnified = "" if factor == 1 else f", magnified {factor:g} times"
        loop.plot(drive, plain + factor * change, color=COLOURS[0], label=f"with{magnified}")
        loop.legend(loc="upper left")
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
