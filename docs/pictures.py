"""The README's pictures.

Run: FRACJAX_DATA=DIR python -m docs.pictures

The recordings of the stage are those of Yan Naing Aye (MIT licence), read and scored as by
`benchmarks/real/piezo_dbo.py`, whose table has the figures beside the picture (`tables.py`).
"""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

import fracjax as fj
from benchmarks.real.piezo_dbo import PERIOD, START_UP, unseen_rmse
from benchmarks.real.recordings import piezo_dbo
from fracjax._show import figure
from fracjax._show.drawing import COLOURS, MEASURED, STYLE, canvas, noise_band, svg, thinned

WIDTH = 7.2
"""Of the pictures [inch]: their text is legible on a phone, too."""
MODELS = ("foh", "prandtl_ishlinskii")
NESTED = slice(2900, 3700)
"""Samples of the stage's second file that are drawn as loops."""


def demonstration() -> Figure:
    """What is left of the demonstration's recording by foh, and with its truth beside foh."""
    with as_file(files("fracjax") / "_demo") as shipped:
        recording = fj.read(shipped / "training.csv")
    fits = [fj.fit(model, recording) for model in ("foh", "minor_loop_memory >> foh")]
    noise = fits[0].preparation.takes[0].noise
    assert noise is not None  # the drive rests
    drawing, rows = canvas(4.2, 2, 1, sharex=True, sharey=True)
    for axes, fit, colour in zip(rows.flat, fits, COLOURS, strict=False):
        noise_band(axes, noise.sigma)
        residual = recording.response - fit.predict(recording)
        axes.plot(*thinned(recording.times, residual, 500), color=colour, lw=0.8)
        axes.set_title(f"{fit.model.name}: {figure(fit.scores.rmse)} µm rms")
    rows.flat[-1].set_xlabel("time [s]")
    drawing.supylabel("measured − simulated [µm]", size=11)
    return drawing


def stage() -> Figure:
    """What models that are fitted to one file of a stage predict of another."""
    steady, nested = piezo_dbo()
    fits = {name: fj.fit(name, steady, history="constant", settling=PERIOD) for name in MODELS}
    noise = fits["foh"].preparation.takes[0].noise
    assert noise is not None  # the cycles repeat
    drawing, ((over_time,), (loops,)) = canvas(6.6, 2, 1)
    noise_band(over_time, noise.sigma)
    loops.plot(nested.drive[NESTED], nested.response[NESTED], color=MEASURED, lw=2.5, alpha=0.4)
    for colour, (name, fit) in zip(COLOURS, fits.items(), strict=False):
        response = fit.predict(nested, history="constant")
        zero = (nested.response - response)[START_UP:PERIOD].mean()
        error = (nested.response - response - zero)[PERIOD:]
        label = f"{name}: {unseen_rmse(nested.response, response):.2f} µm rms"
        shown = thinned(nested.times[PERIOD:], error, 500)
        over_time.plot(*shown, color=colour, lw=0.8, label=label)
        loops.plot(nested.drive[NESTED], (response + zero)[NESTED], color=colour, lw=0.9)
    over_time.set(xlabel="time [s]", ylabel="measured − predicted [µm]", ylim=(-4, 6))
    over_time.set_title("error of the prediction, second file (grey: twice the noise)")
    over_time.legend(loc="upper left", ncols=2)
    loops.set(xlabel="drive [V]", ylabel="displacement [µm]")
    first, last = nested.times[NESTED.start], nested.times[NESTED.stop]
    loops.set_title(f"from {first:g} to {last:g} s: measured (grey) and predicted")
    return drawing


def main() -> None:
    """Draw both on a white ground, for pages that are dark."""
    for draw, name in ((demonstration, "diagnosis.svg"), (stage, "stage.svg")):
        with mpl.rc_context(STYLE):
            drawing = draw()
            drawing.set_size_inches(WIDTH, drawing.get_figheight())
            text = str(svg(drawing)).replace("<svg ", '<svg style="background: white" ', 1)
        Path(__file__).with_name(name).write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
