"""Cases: a base law, one concealed effect at a chosen visible level after the refit, and noise.

Run: python -m benchmarks.concealed.cases --effect creep --drive bursts --level 3 --out D
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as File

import numpy as np
from scipy.optimize import least_squares

from .drives import DRIVES, Array, Drive
from .truth import BASES, EFFECTS, OVER, Base, Path, Scene, noise, response_side

# The drive with about the largest least separability a^2 |P d|^2 (1 - rho^2) from the other eight,
# at residual level 1 on FOH (creep: at its cap); drive_lag and delay part only at sharp corners.
SEPARATING_DRIVE: dict[str, str] = {
    "creep": "steps",
    "drive_lag": "reversal_curves",
    "delay": "reversal_curves",
    "resonance": "rich",
    "electrostriction": "bursts",
    "minor_loop_memory": "reversal_curves",
    "saturation": "bursts",
    "thermal_drift": "rich",
    "mains_interference": "bursts",
}


def fine_grid(drive: Drive, over: int = OVER) -> Array:
    """Times in s, `over` steps per recorded sample, ending at the last sample."""
    return np.arange((len(drive.times) - 1) * over + 1) / (drive.rate * over)


class Refit:
    """Variable projection: least squares over the base's shapes; gains and offset are linear."""

    def __init__(self, base: Base, u: Array, h: float, truth: Sequence[float]) -> None:
        self.base, self.path = base, Path(u, h, base.thinning, cache=True)
        self.low, self.high = np.array(list(base.shapes.values())).T
        others = [np.multiply(base.nominal, c) for c in (1.0, 0.4, 2.0)]
        if "beta" in base.shapes:  # |du/dt| D^beta u has basins at both ends of beta
            others += [np.array([base.nominal[0], b, *base.nominal[2:]]) for b in (-0.7, 0.7)]
        self.starts = [np.asarray(truth), *others]

    def project(self, shape: Array, y: Array) -> tuple[Array, Array]:
        """Best prediction in um at the recorded samples and its gains (offset last)."""
        columns = self.base.columns(self.path, *shape)
        step = OVER // self.base.thinning
        a = np.column_stack([*(c[::step] for c in columns), np.ones(len(y))])
        size = np.linalg.norm(a, axis=0) + 1e-300
        gains = np.linalg.lstsq(a / size, y, rcond=1e-12)[0] / size
        return a @ gains, gains

    def __call__(self, y: Array, thorough: bool = False) -> tuple[Array, dict[str, float]]:
        """Prediction in um and parameters; `thorough` tries every start, else the best so far."""
        best = None
        span = self.high - self.low
        for start in self.starts if thorough else self.starts[:1]:
            x0 = np.clip(start, self.low + 1e-6 * span, self.high - 1e-6 * span)
            fit = least_squares(
                lambda x: self.project(x, y)[0] - y, x0, bounds=(self.low, self.high),
                x_scale=np.maximum(np.abs(x0), 0.05), xtol=1e-9, ftol=1e-9, max_nfev=60,
            )  # fmt: skip
            if best is None or fit.cost < best.cost:
                best = fit
        self.starts[0] = best.x
        prediction, gains = self.project(best.x, y)
        names = [*self.base.shapes, *self.base.gains, "offset"]
        values = [*best.x, *gains]
        return prediction, {k: float(v) for k, v in zip(names, values, strict=True)}


@dataclass(frozen=True)
class Case:
    """A recording (s, V, um), its noise-free parts and its label."""

    time: Array
    voltage: Array
    displacement: Array
    clean: Array
    refit: Array
    label: dict

    def write(self, folder: File) -> None:
        """Write case.csv and label.json."""
        folder.mkdir(parents=True, exist_ok=True)
        write_csv(folder / "case.csv", self.time, self.voltage, self.displacement, (6, 9, 9))
        (folder / "label.json").write_text(json.dumps(self.label, indent=1) + "\n")


def write_csv(file: File, t: Array, u: Array, y: Array, digits: tuple[int, int, int]) -> None:
    """Write a recording with the header time_s,voltage_V,displacement_um."""
    fmt = [f"%.{d}f" for d in digits]
    header = "time_s,voltage_V,displacement_um"
    np.savetxt(file, np.column_stack([t, u, y]), fmt, ",", header=header, comments="")


def rms(x: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def make_case(
    base: str = "foh",
    effect: str = "none",
    drive: str | Drive = "bursts",
    level: float = 1.0,
    noise_kind: str = "white",
    seed: int = 0,
    noise_fraction: float = 1e-3,
    intersample: str = "continuous",
    law: dict[str, float] | None = None,
) -> Case:
    """Simulate one case, scaling the effect so that refitting the base leaves level x noise sd.

    `noise_fraction` is the noise sd over the base response's range. `intersample` is what
    the actuator receives between samples (see Drive.between). The amplitude is capped at the
    effect's physical range; the label says what was reached.
    Concealment is 1 - (residual RMS after the refit)^2 / (RMS of the effect's change)^2.
    """
    rng = np.random.default_rng([seed, 7])
    d = DRIVES[drive](seed) if isinstance(drive, str) else drive
    t, times, model = fine_grid(d), d.times, BASES[base]
    recorded = d(times)
    signal = d.between(intersample)
    law = law or model.draw(rng)
    u = signal(t)
    plain = model.response(u, t[1] - t[0], law)
    stroke = float(np.ptp(plain))
    sd = noise_fraction * stroke
    scene = Scene.of(u, plain, t[1] - t[0], 1 / d.rate)
    refit = Refit(model, u, t[1] - t[0], [law[k] for k in model.shapes])
    clean, params, amplitude, capped = plain[::OVER], {}, 0.0, False  # the null
    if effect != "none":
        e = EFFECTS[effect]
        shape = e.shape(rng)

        def at(a: float) -> tuple[Array, dict]:
            p = e.parameters(a, shape, scene)
            if e.side == "I":
                return e.simulate(signal, t, model, law, p)[::OVER], p
            return response_side([(e, p)], signal, t, plain)[::OVER], p

        amplitude = e.cap / 10
        for _ in range(3):  # again from the better basin, if the thorough refit finds one
            power, before = 1.0, None
            for _ in range(10):
                clean, params = at(amplitude)
                left = rms(clean - refit(clean)[0])
                error = np.log(max(left, 1e-12) / (level * sd))
                if abs(error) < 0.01 or (amplitude == e.cap and error < 0):
                    break
                if before is not None and abs(np.log(amplitude / before[0])) > 1e-9:
                    slope = (error - before[1]) / np.log(amplitude / before[0])
                    power = float(np.clip(slope, 0.4, 6.0))
                before = (amplitude, error)
                amplitude = min(e.cap, amplitude * float(np.exp(np.clip(-error / power, -4, 4))))
            final = rms(clean - refit(clean, thorough=True)[0])
            if final > 0.98 * left:
                break
        capped = bool(amplitude == e.cap)
    prediction, fitted = refit(clean, thorough=True)
    change, left = rms(clean - plain[::OVER]), rms(clean - prediction)
    y = clean + noise(noise_kind, len(clean), sd, np.random.default_rng([seed, 11]))
    label = {
        "effect": effect,
        "parameters": params,
        "amplitude": amplitude,
        "capped": capped,
        "level_requested": level if effect != "none" else 0.0,
        "level": left / sd,
        "concealment": 1 - (left / change) ** 2 if change > 0 else None,
        "R2": float(1 - np.sum((y - prediction) ** 2) / np.sum((y - y.mean()) ** 2)),
        "base": base,
        "base_parameters": law,
        "refit_parameters": fitted,
        "noise": noise_kind,
        "noise_sd_um": sd,
        "stroke_um": stroke,
        "drive": d.name,
        "intersample": intersample,
        "rests_s": d.rests,
        "period_s": d.period,
        "rate_Hz": d.rate,
        "grid": OVER,
        "seed": seed,
    }
    return Case(times, recorded, y, clean, prediction, label)


def main() -> None:
    """Command line: write case.csv and label.json."""
    p = argparse.ArgumentParser(description=main.__doc__)
    p.add_argument("--base", default="foh", choices=BASES)
    p.add_argument("--effect", default="none", choices=["none", *EFFECTS])
    p.add_argument("--drive", default="bursts", choices=DRIVES)
    p.add_argument("--level", type=float, default=1.0)
    p.add_argument("--noise", default="white", choices=["white", "ar", "heavy", "varying"])
    p.add_argument("--noise-fraction", type=float, default=1e-3)
    p.add_argument("--intersample", default="continuous", choices=["linear", "cubic", "continuous"])
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--out", type=File, required=True)
    a = p.parse_args()
    case = make_case(
        a.base, a.effect, a.drive, a.level, a.noise, a.seed, a.noise_fraction, a.intersample
    )
    case.write(a.out)
    keys = ("effect", "level", "capped", "concealment", "R2")
    print(json.dumps({k: case.label[k] for k in keys}))


if __name__ == "__main__":
    main()
