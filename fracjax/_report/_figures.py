"""The report's figures: inline SVG, drawn with matplotlib's object interface."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from numpy.lib.stride_tricks import sliding_window_view

from .._diagnose import Axis, Candidate, Drive, HeldOut
from .._fit import Fit
from .._prepare import Noise
from .._show import figure, p_value, percent, pretty_unit, quantity
from .._show.drawing import (
    BAND,
    COLOURS,
    DENSE,
    MEASURED,
    MOST_POINTS,
    STYLE,
    canvas,
    noise_band,
    svg,
    thinned,
)

_AXIS_NAMES = {
    "time": "time",
    "phase": "phase of the cycle",
    "frequency": "frequency",
    "level": "drive",
    "rate": "rate of the drive",
    "reversal": "time since reversal",
    "harmonics": "harmonic of the drive",
}


@mpl.rc_context(STYLE)
def loops(fits: Sequence[Fit], index: int, noise: Noise) -> Markup:
    """Response and residual over drive, one column per model."""
    if len(fits) == 1:
        drawing, axes = canvas(4.2, 1, 2)
        panels = axes.T
    else:
        drawing, axes = canvas(
            6.4, 2, len(fits), sharex=True, sharey="row", gridspec_kw={"height_ratios": (3, 2)}
        )
        panels = axes
    take = fits[0].preparation.takes[index]
    recording, used = take.recording, take.used
    rasterized = len(recording) > DENSE
    chosen = np.flatnonzero(used)
    chosen = chosen[:: -(-chosen.size // MOST_POINTS)]
    # A long recording is drawn as points: lines between distant samples would cut across the loop.
    style = {"marker": ".", "ms": 1.5, "ls": ""} if chosen.size < used.sum() else {}
    unit = pretty_unit(recording.response_unit)
    for (top, bottom), fit, colour in zip(panels.T, fits, COLOURS, strict=False):
        for panel, signal, appearance in (
            (top, recording.response, {"color": MEASURED, "lw": 2.4, "alpha": 0.5}),
            (top, fit.simulations[index], {"color": colour}),
            (bottom, fit.residuals[index], {"color": colour, "lw": 0.7}),
        ):
            panel.plot(
                recording.drive[chosen],
                signal[chosen],
                rasterized=rasterized,
                **{**appearance, **style},
            )
        top.set_title(fit.model.name)
        top.legend(["measured", "simulated"], loc="upper left", markerscale=6)
        noise_band(bottom, noise.sigma)
        bottom.set_xlabel(f"drive [{pretty_unit(recording.drive_unit)}]")
    first_top, first_bottom = panels[:, 0]
    first_top.set_ylabel(f"response [{unit}]")
    first_bottom.set_ylabel(f"measured − simulated [{unit}]")
    first_top.set_xlabel(first_bottom.get_xlabel() if len(fits) == 1 else "")
    return svg(drawing)


@mpl.rc_context(STYLE)
def series(fits: Sequence[Fit], index: int) -> Markup:
    """Measured and simulated response over time, and a stretch where the first model errs most."""
    take = fits[0].preparation.takes[index]
    recording = take.recording
    times, unit = recording.times, pretty_unit(recording.response_unit)
    drawing, axes = canvas(5.4, 2, 1)
    residual = np.where(take.used, fits[0].residuals[index], 0.0)
    begin, end = _error_window(residual, recording.response)
    for panel, part in zip(axes[:, 0], (slice(None), slice(begin, end)), strict=True):
        panel.plot(
            *thinned(times[part], recording.response[part]),
            color=MEASURED, lw=2.4, alpha=0.5, label="measured",
        )  # fmt: skip
        for fit, colour in zip(fits, COLOURS, strict=False):
            simulation = fit.simulations[index][part]
            panel.plot(*thinned(times[part], simulation), color=colour, label=fit.model.name)
        panel.set_ylabel(f"response [{unit}]")
    whole, zoom = axes[:, 0]
    whole.axvspan(times[begin], times[end - 1], color=BAND, lw=0, zorder=0)
    whole.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=1 + len(fits), borderaxespad=0)
    zoom.set_title(f"the shaded stretch, where the error of {fits[0].model.name} is easiest to see")
    zoom.set_xlabel("time [s]")
    return svg(drawing)


def _error_window(residual: np.ndarray, response: np.ndarray) -> tuple[int, int]:
    """First and last sample of a fortieth of the recording in which the error is easy to see.

    Of all stretches with at least half the squared error of the worst one it is that with the
    smallest span of the response.  `residual`, `response`: (N,).
    """
    width = max(residual.size // 40, min(64, residual.size))
    stride = max(1, width // 8)
    errors = np.sum(sliding_window_view(residual**2, width)[::stride], axis=1)
    spans = np.ptp(sliding_window_view(response, width)[::stride], axis=1)
    begin = stride * int(np.argmin(np.where(errors >= 0.5 * errors.max(), spans, np.inf)))
    return begin, begin + width


@mpl.rc_context(STYLE)
def residuals(fits: Sequence[Fit], index: int, noise: Noise) -> Markup:
    """The residual of each model over time, with the noise band."""
    take = fits[0].preparation.takes[index]
    recording = take.recording
    drawing, axes = canvas(0.9 + 1.75 * len(fits), len(fits), 1, sharex=True, sharey=True)
    for panel, fit, colour in zip(axes[:, 0], fits, COLOURS, strict=False):
        noise_band(panel, noise.sigma)
        times = recording.times[take.used]
        panel.plot(*thinned(times, fit.residuals[index][take.used]), color=colour, lw=0.7)
        error = quantity(fit.scores.rmse, recording.response_unit)
        panel.set_title(f"{fit.model.name}: {error} rms")
    axes[-1, 0].set_xlabel("time [s]")
    drawing.supylabel(f"measured − simulated [{pretty_unit(recording.response_unit)}]", fontsize=11)
    return svg(drawing)


@mpl.rc_context({**STYLE, "axes.grid": False, "axes.spines.left": False})
def places(located: Sequence[Axis]) -> Markup:
    """One strip of equal bins per axis, darker where the mismatch is stronger.

    Brackets mark the intervals where it is significant.
    """
    drawing, panels = canvas(1.05 * len(located) + 0.2, len(located), 1)
    top = max(float(axis.strength.max()) for axis in located)
    image = None
    for panel, axis in zip(panels[:, 0], located, strict=True):
        bins = axis.strength.size
        positions = np.arange(bins + 1)
        image = panel.pcolormesh(
            positions, [0, 1], axis.strength[None, :], cmap="Blues", vmin=0, vmax=top,
            edgecolors="white", linewidth=0.5,
        )  # fmt: skip
        for interval in axis.intervals:
            low, high = np.interp(interval, axis.edges, positions)
            bracket = ([low + 0.08, low + 0.08, high - 0.08, high - 0.08], [1.12, 1.3, 1.3, 1.12])
            panel.plot(*bracket, color=COLOURS[0], lw=2, clip_on=False)
        unit = pretty_unit(axis.unit)
        name = _AXIS_NAMES[axis.axis] + (f" [{unit}]" if unit else "")
        label = f"{name}\n{p_value(axis.p_value)}"
        panel.set(xlim=(0, bins), ylim=(0, 1), yticks=[])
        panel.set_ylabel(label, rotation=0, ha="right", va="center")
        if axis.axis == "harmonics":
            orders = axis.edges[:-1] + 0.5
            panel.set_xticks(positions[:-1] + 0.5, [figure(float(order)) for order in orders])
        else:
            ticks = positions[:: -(-bins // 8)]
            edges = np.where(np.abs(axis.edges) > 1e-6 * np.abs(axis.edges).max(), axis.edges, 0)
            panel.set_xticks(ticks, [figure(float(edges[tick])) for tick in ticks])
    assert image is not None  # a diagnosis has at least one axis
    drawing.colorbar(image, ax=panels.ravel().tolist(), label="strength |z|", aspect=40, pad=0.01)
    return svg(drawing)


@mpl.rc_context({**STYLE, "axes.grid.axis": "x"})
def hidden(candidates: Sequence[Candidate], noise: Noise, span: float) -> Markup:
    """The smallest detectable amplitude of each effect, and the share that the model conceals.

    Bars end at the response's span [response], the largest possible change.
    """
    ordered = sorted(candidates, key=lambda c: c.detectable_amplitude)
    drawing, axes = canvas(0.9 + 0.32 * len(ordered))
    panel = axes[0, 0]
    amplitudes = [min(c.detectable_amplitude, span) for c in ordered]
    panel.barh([c.name for c in ordered], amplitudes, color="#56B4E9", height=0.65)
    for row, (candidate, amplitude) in enumerate(zip(ordered, amplitudes, strict=True)):
        remark = "" if candidate.is_seen_within(span) else ", not detectable"
        panel.annotate(
            f"{percent(candidate.concealment)} concealed{remark}",
            (amplitude, row), (5, 0), textcoords="offset points",
            va="center", fontsize=10, bbox={"color": "white", "pad": 1},
        )  # fmt: skip
    panel.axvline(noise.sigma, color=MEASURED, ls="--", lw=1, zorder=1.5)
    panel.annotate("noise floor", (noise.sigma, 1), (4, 2), xycoords=("data", "axes fraction"),
                   textcoords="offset points", fontsize=10)  # fmt: skip
    panel.set_xscale("log")
    panel.set_xlim(0.5 * min(*amplitudes, noise.sigma), 6 * max(amplitudes))
    panel.set_xlabel(f"smallest detectable change of the response [{pretty_unit(noise.unit)} rms]")
    return svg(drawing)


@mpl.rc_context({**STYLE, "axes.grid.axis": "y"})
def held_out(scores: HeldOut, names: Sequence[str], noise: Noise) -> Markup:
    """Error on held-out data, fold by fold."""
    drawing, axes = canvas(3.2)
    panel = axes[0, 0]
    groups = [folds for folds in (scores.base_folds, scores.extended_folds) if folds]
    width = 0.8 / len(groups)
    for k, (folds, name) in enumerate(zip(groups, names, strict=False)):
        positions = np.arange(1, len(folds) + 1) + width * (k - (len(groups) - 1) / 2)
        panel.bar(positions, folds, width=0.92 * width, color=COLOURS[k], label=name)
    panel.axhline(noise.sigma, color=MEASURED, ls="--", lw=1, label="noise floor")
    panel.xaxis.get_major_locator().set_params(integer=True)
    panel.set_xlabel("fold")
    panel.set_ylabel(f"RMSE [{pretty_unit(noise.unit)}]")
    panel.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, borderaxespad=0)
    return svg(drawing)


@mpl.rc_context(STYLE)
def drive(proposed: Drive, unit: str) -> Markup:
    """A drive over time."""
    drawing, axes = canvas(2.2)
    (panel,) = axes.flat
    panel.plot(*thinned(proposed.times, proposed.values), color=COLOURS[0])
    panel.set_xlabel("time [s]")
    panel.set_ylabel(f"drive [{pretty_unit(unit)}]")
    return svg(drawing)
