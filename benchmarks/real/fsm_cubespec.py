"""A mirror's modes and couplings, hidden from the diagnosis, then unsealed.

    FRACJAX_DATA=DIR python -m benchmarks.real.fsm_cubespec

Three axes, driven together to 3 kHz by orthogonal multisines; the modes begin at about 620 Hz.

*Modes.* Three realisations, superposed frequency by frequency as their design provides, give what
one axis answers to its own drive alone.  Drive and response alike lose everything above 400 Hz (a
zero-phase filter, then every 2nd sample), so that no mode is driven.  Every recording is one period
of steady motion.  Each axis is diagnosed on one triple of realisations; the second period is the
repeat, the other triple is held out.  Then the full band is unsealed: the mode of an axis is the
highest peak of its frequency response, of which there are several.

What superposing makes of the hysteresis of three actuators repeats with the period and follows no
law of the one drive: `linear_nm` is what any smooth linear law leaves over.  Beside a repeat it is
a mismatch.  It is another one for other phases, so `scatter` gives as the noise how far two triples
lie from the law that they have in common (the stochastic nonlinear distortions of Pintelon &
Schoukens, System Identification, 2012, §4.3): then only what all of them share is a mismatch.

*Coupling.* One realisation as it was recorded: all three drives act, one is shown.  What the base
fit leaves is regressed on the drives that were hidden.
"""

from __future__ import annotations

import numpy as np

import fracjax as fj
from benchmarks.real.recordings import (
    FSM_PERIOD,
    FSM_RATE,
    fsm_cubespec,
    low_passed,
    rounded,
    table,
)

CUTOFF, DECIMATION = 400.0, 2  # Hz; 3200 Hz are left
FIRST, SECOND = slice(0, 3), slice(3, 6)


def alone(drives: np.ndarray, responses: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Drive (8192, 2) of one axis and its answer to it alone, from (8192, 3, 3, 2)."""
    u, y = np.fft.rfft(drives, axis=0), np.fft.rfft(responses, axis=0)
    strength = np.abs(u[:, axis, 0, 0])
    driven = (np.linalg.cond(u[..., 0]) < 10) & (strength > 1e-3 * strength.max())
    shares = np.zeros((len(u), 3), complex)  # of each realisation
    wanted = np.zeros((len(u), 3, 1), complex)
    wanted[:, axis, 0] = u[:, axis, 0, 0]
    shares[driven] = np.linalg.solve(u[driven, :, :, 0], wanted[driven])[..., 0]
    answer = np.einsum("krp,kr->kp", y[:, axis], shares)
    drive = np.where(driven[:, None], u[:, axis, 0], 0)
    return np.fft.irfft(drive, FSM_PERIOD, axis=0), np.fft.irfft(answer, FSM_PERIOD, axis=0)


def recordings(drives: np.ndarray, responses: np.ndarray, source: str) -> list[fj.Recording]:
    """Both periods of signals (8192, 2), below the modes."""
    u, y = (low_passed(signals, CUTOFF, DECIMATION) for signals in (drives, responses))
    dt = DECIMATION / FSM_RATE
    return [fj.Recording(u[:, p], y[:, p], dt, source=f"{source}, period {p}") for p in (0, 1)]


def unsealed_mode(drives: np.ndarray, responses: np.ndarray, axis: int) -> float:
    """The frequency [Hz] of the highest peak of an axis' own frequency response."""
    u, y = alone(drives, responses, axis)
    frequencies = np.fft.rfftfreq(FSM_PERIOD, 1 / FSM_RATE)
    inside = (frequencies > 500) & (frequencies < 2900)
    lines = np.abs(np.fft.rfft(u[:, 0]))[inside]
    gains = np.abs(np.fft.rfft(y.mean(axis=1)))[inside]
    excited = lines > 0.1 * np.median(lines)
    return float(frequencies[inside][excited][np.argmax(gains[excited] / lines[excited])])


def left_by_any_linear_law(train: fj.Recording) -> float:
    """The rms [um] that the best frequency response leaves, a polynomial of degree 8 in ln f."""
    u, y = np.fft.rfft(train.drive), np.fft.rfft(train.response)
    frequencies = np.fft.rfftfreq(len(train), train.dt)
    within = (frequencies > 0) & (frequencies < CUTOFF) & (np.abs(u) > 0.1 * np.abs(u).max())
    logarithms = np.log(frequencies[within])
    places = np.interp(logarithms, [logarithms.min(), logarithms.max()], [-1.0, 1.0])
    columns = np.polynomial.legendre.legvander(places, 8) * u[within, None]
    left = y[within] - columns @ np.linalg.lstsq(columns, y[within], rcond=None)[0]
    return rms_of(left, len(train))


def rms_of(lines: np.ndarray, samples: int) -> float:
    """The rms of a signal of so many samples with these lines and no others."""
    return float(np.sqrt(2 * np.sum(np.abs(lines) ** 2)) / samples)


def scatter(one: fj.Recording, other: fj.Recording) -> float:
    """The rms [um] by which an answer scatters about the linear law that both have in common."""
    (u, y), (v, z) = ((np.fft.rfft(r.drive), np.fft.rfft(r.response)) for r in (one, other))
    driven = (np.abs(u) > 0.1 * np.abs(u).max()) & (np.abs(v) > 0.1 * np.abs(v).max())
    apart = np.abs(u[driven]) * (y[driven] / u[driven] - z[driven] / v[driven]) / np.sqrt(2)
    return rms_of(apart, len(one))


def predicted_mode(diagnosis: fj.Diagnosis) -> float | None:
    """The frequency [Hz] of the mode in what the diagnosis ends on, if it holds one."""
    parameters = diagnosis.extended_model.parameters.items()
    found = [float(p.value) for name, p in parameters if name.endswith("frequency")]
    return found[0] if found else None


def mode(kind: str, axis: int, model: str, drives: np.ndarray, responses: np.ndarray) -> dict:
    """One axis, its modes concealed; its noise by a `repeat` or by its `scatter`."""
    train, repeat = recordings(
        *alone(drives[:, :, FIRST], responses[:, :, FIRST], axis), f"axis {axis}"
    )
    held, _ = recordings(
        *alone(drives[:, :, SECOND], responses[:, :, SECOND], axis), f"axis {axis}, held out"
    )
    diagnosis = fj.diagnose(
        fj.parse_model(model),
        train,
        repeat=repeat if kind == "repeat" else None,
        noise=scatter(train, held) if kind == "scatter" else None,
        holdout=held,
        history="periodic",
    )
    unsealed = unsealed_mode(drives[:, :, FIRST], responses[:, :, FIRST], axis)
    predicted = predicted_mode(diagnosis)
    return row(f"mode, {kind}", axis, model, diagnosis) | {
        "linear_nm": rounded(1e3 * left_by_any_linear_law(train)),
        "mode_Hz": rounded(unsealed),
        "predicted_Hz": "" if predicted is None else rounded(predicted),
        "coupling_found": "",
    }


def coupling(axis: int, model: str, drives: np.ndarray, responses: np.ndarray) -> dict:
    """One axis, the other drives hidden from it."""
    train, repeat = recordings(drives[:, axis, 0], responses[:, axis, 0], f"axis {axis}, coupled")
    diagnosis = fj.diagnose(fj.parse_model(model), train, repeat=repeat, history="periodic")
    left = diagnosis.base.residuals[0]
    shares = []
    for other in range(3):
        hidden = low_passed(drives[:, other, 0], CUTOFF, DECIMATION)[:, 0]
        taps = np.stack([np.roll(hidden, k) for k in range(-2, 6)], axis=1)
        fitted = taps @ np.linalg.lstsq(taps, left, rcond=None)[0]
        shares.append(f"{np.var(fitted) / np.var(left):.2f}")
    return row("coupling", axis, model, diagnosis) | {
        "linear_nm": "",
        "mode_Hz": "",
        "predicted_Hz": "",
        "coupling_found": " ".join(shares),
    }


def row(kind: str, axis: int, model: str, diagnosis: fj.Diagnosis) -> dict:
    effects = diagnosis.effects
    proposed = diagnosis.next_experiment
    print(f"{kind}, axis {axis}: {diagnosis.sentence}", flush=True)
    return {
        "kind": kind,
        "axis": axis,
        "model": model,
        "verdict": diagnosis.verdict,
        "effects": " and ".join(e.name for e in effects),
        "confusable_with": " ".join(sorted({o for e in effects for o in e.confusable_with})),
        "adopted": diagnosis.extended_model.name,
        "where": diagnosis.axes[0].axis,
        "floor_nm": rounded(1e3 * diagnosis.noise.sigma),
        "base_nm": rounded(1e3 * diagnosis.held_out.base_rmse),
        "extended_nm": rounded(1e3 * (diagnosis.held_out.extended_rmse or np.nan)),
        "numerics": rounded(diagnosis.numerics),
        "next_drive": proposed.drive.description if proposed else "",
        "separates": rounded(proposed.probability) if proposed else "",
    }


def main() -> None:
    drives, responses = fsm_cubespec()
    rows = [
        mode(kind, axis, model, drives, responses)
        for kind in ("repeat", "scatter")
        for axis in range(3)
        for model in ("lfdh", "foh")
    ]
    rows.append(coupling(0, "lfdh", drives, responses))
    table("fsm_cubespec", rows)


if __name__ == "__main__":
    main()
