"""The README's proof on a real stage: models fitted to one file, and what they predict of another.

Run: FRACJAX_DATA=DIR python docs/stage.py

The recordings are those of Yan Naing Aye (MIT licence), read and scored as by
`benchmarks/real/piezo_dbo.py`, whose table has the figures beside the picture (`tables.py`).
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

import fracjax as fj
from benchmarks.real.piezo_dbo import PERIOD, START_UP, unseen_rmse
from benchmarks.real.recordings import piezo_dbo
from fracjax._show.drawing import COLOURS, MEASURED, STYLE, canvas, noise_band, svg, thinned

PICTURE = Path(__file__).with_name("stage.svg")
MODELS = ("foh", "prandtl_ishlinskii")
NESTED = slice(2900, 3700)
"""Samples of the second file that are drawn as loops."""


def main() -> None:
    """Fit to the first file, predict the second, and draw."""
    steady, nested = piezo_dbo()
    fits = {name: fj.fit(name, steady, history="constant", settling=PERIOD) for name in MODELS}
    predicted = {name: fit.predict(nested, history="constant") for name, fit in fits.items()}
    unseen = {name: unseen_rmse(nested.response, it) for name, it in predicted.items()}
    noise = fits["foh"].preparation.takes[0].noise
    assert noise is not None  # the cycles repeat
    with mpl.rc_context(STYLE):
        drawing, ((over_time,), (loops,)) = canvas(6.6, 2, 1)
        drawing.set_size_inches(7.2, 6.6)
        noise_band(over_time, noise.sigma)
        loops.plot(nested.drive[NESTED], nested.response[NESTED], color=MEASURED, lw=2.5, alpha=0.4)
        for colour, (name, response) in zip(COLOURS, predicted.items(), strict=False):
            zero = (nested.response - response)[START_UP:PERIOD].mean()
            error = nested.response - response - zero
            label = f"{name}: {unseen[name]:.2f} µm rms"
            times, shown = thinned(nested.times[PERIOD:], error[PERIOD:], 500)
            over_time.plot(times, shown, color=colour, lw=0.8, label=label)
            loops.plot(nested.drive[NESTED], (response + zero)[NESTED], color=colour, lw=0.9)
        over_time.set(xlabel="time [s]", ylabel="measured − predicted [µm]")
        over_time.set_title("error of the prediction, second file (grey: twice the noise)")
        over_time.set_ylim(-4, 6)
        over_time.legend(loc="upper left", ncols=2)
        loops.set(xlabel="drive [V]", ylabel="displacement [µm]")
        first, last = nested.times[NESTED.start], nested.times[NESTED.stop]
        loops.set_title(f"from {first:g} to {last:g} s: measured (grey) and predicted")
        drawn = str(svg(drawing)).replace("<svg ", '<svg style="background: white" ', 1)
    PICTURE.write_text(drawn + "\n", encoding="utf-8")
    print(unseen)


if __name__ == "__main__":
    main()
