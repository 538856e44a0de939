"""A simulated stage, driven along three trajectories by inverses of models fitted to one record.

    python -m benchmarks.compensation.run --out benchmarks/compensation/results.csv

The stage (`stage.py`) knows nothing of fracjax.  Each model is fitted to one recording of it,
inverted by `fracjax.compensate`, and the drive is sent to the stage: the error is what its sensor
then reads, less what was wanted, the mean error of each run taken out as an operator would who sets
the zero.  `line` is no compensation: drive in proportion to the motion wanted.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np

import fracjax as fj
from benchmarks.compensation.stage import NOISE, STEP, STROKE, measure
from benchmarks.versions import versions

MODELS = ("lfdh", "foh", "foh + minor_loop_memory")
COLUMNS = (
    "trajectory", "drive", "rms_percent", "max_percent", "max_after_0.5_s_percent",
    "predicted_max_percent",
)  # fmt: skip
LIMITS = (0.0, 100.0)


def record() -> fj.Recording:
    """6 s of 1 Hz, its amplitude falling, from one end of the drive's range, as a triangle last."""
    t = STEP * np.arange(1500)
    tent = 1 - 2 * np.abs(1 - 2 * (t % 1))
    shape = np.where(t < 4, -np.cos(2 * np.pi * t), tent) * (1 - t / 8)
    drive = 50 + 47 * shape
    return fj.Recording(drive, measure(drive, seed=1), STEP, source="record")


def trajectories(low: float, high: float) -> dict[str, np.ndarray]:
    """Desired motions (N,) between two ends [um]."""
    t = STEP * np.arange(750)
    tent = 1 - np.abs(1 - 2 * (t % 1))
    shapes = {
        "sine 1 Hz": (1 - np.cos(2 * np.pi * t)) / 2,
        "falling sine": (1 - np.cos(2 * np.pi * t)) / 2 * (1 - t / 4),
        "triangle and trapezoid": np.where(t < 1, tent, np.clip(1.5 * tent, 0, 1) * 0.6),
    }
    return {name: low + (high - low) * shape for name, shape in shapes.items()}


def fits(recording: fj.Recording) -> dict[str, fj.Fit]:
    """Each model fitted, compositions started at the recording's own size of things."""
    from fracjax._fit._problem import setting_of

    setting = setting_of([recording])
    found = {}
    for name in MODELS:
        found[name] = fj.fit(fj.parse_model(name, setting), recording, history="constant")
        print(f"  {name}: rmse {found[name].scores.rmse / NOISE:.1f} times the noise", flush=True)
    return found


def row(name: str, drive: str, desired: np.ndarray, used: np.ndarray, predicted) -> dict:
    """One line of the table: what the stage did with a drive (N,)."""
    error = measure(used, seed=2) - desired
    error = 100 * (error - error.mean()) / np.ptp(desired)
    late = error[round(0.5 / STEP) :]
    values = (np.sqrt(np.mean(error**2)), np.abs(error).max(), np.abs(late).max())
    told = [f"{value:.3g}" for value in values]
    share = "" if predicted is None else f"{100 * predicted / np.ptp(desired):.2g}"
    return dict(zip(COLUMNS, (name, drive, *told, share), strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    out = parser.parse_args().out
    recording = record()
    models = fits(recording)
    low, high = np.quantile(recording.response, [0, 1]) + 0.12 * STROKE * np.array([1, -1])
    slope, zero = np.polyfit(recording.response, recording.drive, 1)
    rows = []
    for name, desired in trajectories(low, high).items():
        rows.append(row(name, "line", desired, np.clip(slope * desired + zero, *LIMITS), None))
        for model, found in models.items():
            wanted = fj.Trajectory(desired, STEP, source=name)
            best = fj.compensate(found.model, wanted, limits=LIMITS, offset=found.offsets[0])
            rows.append(row(name, model, desired, best.drive, best.max_error))
    for line in rows:
        print("  ".join(f"{line[column]:>24}" for column in COLUMNS))
    if out is not None:
        with out.open("w", newline="", encoding="utf-8") as file:
            file.write(versions(("fracjax", "jax", "numpy", "scipy", "optimistix")))
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
