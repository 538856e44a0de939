"""A real actuator: our drive beside the one its authors sent, on paper.

    python -m benchmarks.compensation.piezo_dbo --data DIR --out benchmarks/compensation

DIR holds piezo_dbo (see FRACJAX_DATA in CONTRIBUTING.md).  Its first file identifies a model; its
second holds a desired displacement, the voltage that the authors' inverse model made of it, and
what the sensor read.  Nothing can be driven here.  What can be told: how well the model predicts
the sensor under the authors' voltage, and whether our voltage differs from theirs in the sense
that their measured error calls for.

piezo_dbo.csv, in shares of the stroke or of the drive's span, the mean taken out:

- by model: its rms error on the first file; how it predicts the sensor under the authors' drive;
  its own drive beside theirs, and the correlation of the difference with the correction that
  their error calls for;
- in real time: how far the streaming inverse of the motion that the sensor read, and of the desired
  one, is from the authors' drive, with the linear part in its place, and the ratio of the two.
  The desired one cannot come nearer than the authors' own error, which stands first;
- the motion that our drive would have given is by the model the desired one; its band of 95 %, from
  the model's errors under the authors' drive just before, and the share of the later readings under
  their drive that lie in it.  What error our drive would leave on the actuator nothing here tells.
"""

from __future__ import annotations

import argparse
import csv
import os
from pathlib import Path

import numpy as np

import fracjax as fj
from benchmarks.versions import versions

STEP = 5e-3  # s
BEGIN = 5300  # where the authors' inverse begins
SAMPLES = slice(7000, 8600)  # the authors' inverse at work, amplitudes changing
MODELS = ("lfdh", "foh", "foh + minor_loop_memory", "prandtl_ishlinskii")
STREAMED = "prandtl_ishlinskii"
BAND = 0.05, 4.0  # Hz
COLUMNS = "model", "figure", "value", "unit"


class Table:
    """The rows, printed as they come."""

    def __init__(self):
        self.rows: list[dict[str, str]] = []

    def add(self, model: str, figure: str, value: float, unit: str = "%") -> None:
        row = dict(zip(COLUMNS, (model, figure, f"{value:.3g}", unit), strict=True))
        self.rows.append(row)
        print("  ".join(row.values()), flush=True)

    def write(self, path: Path) -> None:
        with path.open("w", newline="", encoding="utf-8") as file:
            file.write(versions(("fracjax", "jax", "numpy", "scipy", "optimistix")))
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(self.rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=os.environ.get("FRACJAX_DATA"))
    parser.add_argument("--out", type=Path, required=True, help="The folder of piezo_dbo.csv.")
    given = parser.parse_args()
    if given.data is None or not (Path(given.data) / "piezo_dbo").is_dir():
        raise SystemExit("Give --data DIR, a folder that holds piezo_dbo.")
    first, second = (
        np.loadtxt(Path(given.data) / "piezo_dbo" / name)
        for name in ("Model_Vi_Do.dat", "Test_Vi_Do_Di.dat")
    )
    recording = fj.Recording(first[:2000, 0], first[:2000, 4], STEP, source="Model_Vi_Do.dat")
    applied, read, desired = (second[SAMPLES, column] for column in (0, 4, 8))
    desired = desired + (read - desired).mean()
    table = Table()
    table.add("the authors'", "stroke", float(np.ptp(desired)), "um")
    table.add("the authors'", "read less desired", percent(read - desired, desired))
    for name in MODELS:
        model, offset = report(table, name, recording, applied, read, desired)
        if name == STREAMED:
            in_real_time(table, model, offset, second)
    table.write(given.out / "piezo_dbo.csv")


def in_real_time(table: Table, model: fj.Model, offset: float, second: np.ndarray) -> None:
    """The streaming inverse beside the authors' drive, from where theirs begins."""
    applied, read, desired = (second[BEGIN : SAMPLES.stop, column] for column in (0, 4, 8))
    before = slice((SAMPLES.start - BEGIN) // 2, SAMPLES.start - BEGIN)
    last = slice(SAMPLES.start - BEGIN, None)
    options = {"limits": (applied.min() - 0.5, applied.max() + 0.5), "offset": offset}
    whole = fj.streaming_inverse(model, STEP, BAND, **options)
    slope = np.ptp(read) / np.ptp(applied)
    line = fj.streaming_inverse(
        fj.Model(fj.blocks.QuasiStaticForce(slope), "linear part"), STEP, BAND, limits=(-99, 99)
    )
    aim = desired + (read - desired)[last].mean()
    for motion, wanted in {"read": read, "desired": aim}.items():
        apart = [
            percent(inverse.run(wanted).output[last] - applied[last], applied[last])
            for inverse in (whole, line)
        ]
        for name, value in zip((STREAMED, "linear part"), apart, strict=True):
            table.add(name, f"inverse of the {motion} motion less the authors' drive", value)
        table.add(STREAMED, f"the same of the linear part over it, {motion} motion",
                  apart[1] / apart[0], "")  # fmt: skip
    observer = fj.streaming_model(model, STEP, BAND, **options)
    error = read - observer.run(applied).output
    band = 1.96 * error[before].std()
    inside = np.abs(error[last] - error[before].mean()) < band
    table.add(
        STREAMED,
        "95 % band of the motion that its drive would have given",
        100 * band / np.ptp(aim[last]),
        "± %",
    )
    table.add(STREAMED, "readings under the authors' drive within the band", 100 * inside.mean())


def percent(error: np.ndarray, motion: np.ndarray) -> float:
    """An error's rms without its mean, in percent of what a motion spans."""
    return float(100 * np.std(error) / np.ptp(motion))


def report(
    table: Table,
    name: str,
    recording: fj.Recording,
    applied: np.ndarray,
    read: np.ndarray,
    desired: np.ndarray,
) -> tuple[fj.Model, float]:
    """One model: its prediction of their run, its drive, and the sense of the difference."""
    from fracjax._prepare._setting import setting_of

    fit = fj.fit(fj.parse_model(name, setting_of([recording])), recording, history="constant")
    predicted = fj.simulate(fit.model, applied, STEP).response
    # The model's zero is set so that the authors' mean drive answers to the mean motion.
    offset = float((read - predicted).mean())
    wanted = fj.Trajectory(desired, STEP, source="Test_Vi_Do_Di.dat")
    change = fj.compensate(fit.model, wanted, offset=offset).drive - applied
    # Where their sensor read too much, a better drive is lower.
    sense = np.corrcoef(change, desired - read)[0, 1]
    table.add(name, "error on the first file, rms", fit.scores.rmse, "um")
    table.add(name, "sensor less prediction under the authors' drive",
              percent(read - predicted, desired))  # fmt: skip
    table.add(name, "its drive less the authors'", percent(change, applied))
    table.add(name, "correlation with the correction called for", sense, "")
    return fit.model, offset


if __name__ == "__main__":
    main()
