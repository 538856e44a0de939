"""A picture of a recording: drive and response over time, and the loop."""

import matplotlib as mpl
import numpy as np

from fracjax._show import pretty_unit
from fracjax._show.drawing import COLOURS, DENSE, MEASURED, STYLE, Drawing, canvas, thinned


@mpl.rc_context(STYLE)
def draw_recording(
    times: np.ndarray,
    signals: tuple[np.ndarray, np.ndarray],
    units: tuple[str, str],
    masked: np.ndarray | None,
) -> Drawing:
    """Draw the drive and the response (N,) over times (N,) [s], and one over the other.

    Masked samples are left out of the loop and marked over time.
    """
    drawing, panels = canvas(4.6, 2, 2, sharex="col", gridspec_kw={"width_ratios": (1.7, 1)})
    for panel in panels[:, 1]:
        panel.remove()
    loop = drawing.add_subplot(panels[0, 0].get_gridspec()[:, 1])
    names = [f"drive [{pretty_unit(units[0])}]", f"response [{pretty_unit(units[1])}]"]
    colours = (MEASURED, COLOURS[0])
    for panel, signal, name, colour in zip(panels[:, 0], signals, names, colours, strict=True):
        panel.plot(*thinned(times, signal), color=colour, lw=0.9)
        panel.set_ylabel(name)
        if masked is not None:
            panel.plot(times[masked], signal[masked], "x", color=COLOURS[1], ms=4)
    panels[1, 0].set_xlabel("time [s]")
    drive, response = (np.where(masked, np.nan, s) if masked is not None else s for s in signals)
    loop.plot(drive, response, color=COLOURS[0], lw=0.8, rasterized=times.size > DENSE)
    loop.set_xlabel(names[0])
    loop.set_ylabel(names[1])
    return drawing
