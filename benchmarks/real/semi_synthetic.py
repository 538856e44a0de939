"""Real drives and real noise, with an effect sealed into the response: is it named?

    FRACJAX_DATA=DIR python -m benchmarks.real.semi_synthetic [model|raw]

The drive is a stretch of piezo_dbo's second file: bursts, envelopes and a rest.  Each effect is
plain NumPy or SciPy and acts on the response alone.

- `model`: FOH fitted to the stretch, that effect, then real noise (as in `nulls.py`);
- `raw`: the measured response itself, with the effect on it.  The base is then the composition
  that predicts this file best (`piezo_dbo.py`); the row without effect is the control: what is
  named there is real, or an error, and does not count for the others.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
from scipy.signal import StateSpace, lsim

import fracjax as fj
from benchmarks.real.nulls import spectrum_of, surrogate
from benchmarks.real.piezo_dbo import play
from benchmarks.real.recordings import piezo_dbo, rounded, table

STRETCH = slice(2000, 6000)
RICH = "drive_lag >> (lfdh + minor_loop_memory)"
RAW = ("control", "resonance", "mains_interference", "sensor_nonlinearity")


def creep(y: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Every increment goes on growing by 2 % per decade of time after 0.1 s."""
    kernel = 0.02 * np.log10(1 + t / 0.1)
    return y + np.convolve(np.diff(y, prepend=y[0]), kernel)[: y.size]


def thermal_drift(y: np.ndarray, t: np.ndarray) -> np.ndarray:
    return y + 0.5 * (1 - np.exp(-t / 8.0)) + 0.01 * t


def mains_interference(y: np.ndarray, t: np.ndarray) -> np.ndarray:
    return y + 0.05 * np.sin(2 * np.pi * 50.02 * t + 0.7)


def resonance(y: np.ndarray, t: np.ndarray) -> np.ndarray:
    """A mode at 18 Hz, damping 0.03, integrated exactly between samples joined by lines."""
    omega, zeta = 2 * np.pi * 18.0, 0.03
    a = [[0.0, 1.0], [-(omega**2), -2 * zeta * omega]]
    mode = StateSpace(a, [[0.0], [omega**2]], [[1.0, 0.0]], [[0.0]])
    return lsim(mode, y - y[0], t)[1] + y[0]


def backlash(y: np.ndarray, t: np.ndarray) -> np.ndarray:
    return play(y, 0.3, y[0])


def sensor_nonlinearity(y: np.ndarray, t: np.ndarray) -> np.ndarray:
    x = 2 * (y - y.min()) / np.ptp(y) - 1
    return y + 0.005 * np.ptp(y) * x**2 + 0.002 * np.ptp(y) * x**3


def quantisation(y: np.ndarray, t: np.ndarray) -> np.ndarray:
    return 0.25 * np.round(y / 0.25)


EFFECTS: tuple[Callable[[np.ndarray, np.ndarray], np.ndarray], ...] = (
    creep, thermal_drift, mains_interference, resonance, backlash, sensor_nonlinearity,
    quantisation,
)  # fmt: skip


def row(kind: str, sealed: str, change: np.ndarray, diagnosis: fj.Diagnosis) -> dict:
    effects = diagnosis.effects
    print(f"{kind}, {sealed}: {diagnosis.sentence}", flush=True)
    ranked = [c.name for c in diagnosis.candidates]
    return {
        "kind": kind,
        "sealed": sealed,
        "change_um": rounded(np.std(change)),
        "floor_um": rounded(diagnosis.noise.sigma),
        "base_rmse_um": rounded(diagnosis.base.scores.rmse),
        "verdict": diagnosis.verdict,
        "effects": " and ".join(e.name for e in effects),
        "confusable_with": " ".join(sorted({o for e in effects for o in e.confusable_with})),
        "adopted": diagnosis.extended_model.name,
        "rank_of_sealed": "" if sealed == "control" else 1 + ranked.index(sealed),
    }


def on_model(stretch: fj.Recording, spectrum: tuple[np.ndarray, np.ndarray]) -> list[dict]:
    truth = fj.fit(fj.parse_model("foh"), stretch, history="constant", starts=4).model
    response = fj.simulate(truth, stretch.drive, stretch.dt).response
    rows = []
    for k, effect in enumerate(EFFECTS):
        added = surrogate(spectrum, len(stretch), np.random.default_rng(k))
        if effect is quantisation:  # what a converter does comes after the noise
            changed = effect(response + added, stretch.times)
        else:
            changed = effect(response, stretch.times) + added
        recording = fj.Recording(stretch.drive, changed, stretch.dt, source=effect.__name__)
        diagnosis = fj.diagnose(fj.parse_model("foh"), recording)
        rows.append(row("model", effect.__name__, changed - response - added, diagnosis))
    return rows


def on_raw(stretch: fj.Recording) -> list[dict]:
    from fracjax._prepare._setting import setting_of

    rows = []
    for name in RAW:
        added = [effect for effect in EFFECTS if effect.__name__ == name]
        changed = added[0](stretch.response, stretch.times) if added else stretch.response
        recording = fj.Recording(stretch.drive, changed, stretch.dt, source=name)
        model = fj.parse_model(RICH, setting_of([recording]))
        rows.append(row("raw", name, changed - stretch.response, fj.diagnose(model, recording)))
    return rows


def main() -> None:
    _, nested = piezo_dbo()
    stretch = nested.window(STRETCH.start, STRETCH.stop)
    kinds = sys.argv[1:] or ["model", "raw"]
    if "model" in kinds:
        table("semi_synthetic_model", on_model(stretch, spectrum_of(nested)))
    if "raw" in kinds:
        table("semi_synthetic_raw", on_raw(stretch))


if __name__ == "__main__":
    main()
