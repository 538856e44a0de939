"""A simulated stage, driven along three motions by inverses of models identified from one record.

    python -m benchmarks.compensation.run --out benchmarks/compensation

The stage (`stage.py`) knows nothing of fracjax; record and motions (`signals.py`) start at rest at
0 V, where its sensor is zeroed.  The two laws are fitted to the record's swings at 1 Hz, as in the
paper of 2012; what `fracjax.diagnose` makes of foh is fitted to all of it.  A diagnosis is asked
again about the model it has extended, up to three times in all, and its extended fit is used
whatever the last verdict.  The fits are kept in fits/; `--identify` finds them anew, in ten minutes
or more.

results.csv: error of the sensor's reading in shares of the motion's stroke, over the whole run and
over its steady part, which is the last of three repeats.  `zeroed`: the steady part's mean taken
out, as an operator would who sets the zero.  `line` is no compensation: drive in proportion to the
motion wanted; `real time` is the same model's streaming inverse, to which the motion is not known
ahead.  Bounds: `no error` reads what the sensor's noise alone would leave, `best sinusoid`
what is left of the sine by the best that any linear law could drive, whose answer to a sine is a
sine, and `learned` by a drive that the stage itself has corrected in turns.

models.csv: what was identified, and its error on a second record that no fit has seen.
"""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

import fracjax as fj
from benchmarks.compensation.signals import (
    PERIOD,
    SWINGS,
    motions,
    record,
    second_record,
    steady,
)
from benchmarks.compensation.stage import NOISE, STEP, measure
from benchmarks.versions import versions

LAWS, BASE, EXTENDED = ("lfdh", "foh"), "foh", "foh-extended.json"
COLUMNS = (
    "trajectory", "drive", "rms_percent", "max_percent", "steady_rms_percent",
    "steady_max_percent", "zeroed_max_percent", "predicted_max_percent", "method",
)  # fmt: skip
MODELS = (
    "drive", "model", "rmse_over_noise", "second_record_rms_percent",
    "second_record_max_percent",
)  # fmt: skip
LIMITS = (-20.0, 120.0)  # V, as such stacks bear
BAND = (0.01, 5.0)  # Hz, of the inverse in real time
_INSET, _TURNS, _SMOOTHED, _DIAGNOSES = 0.12, 8, 1.5, 3


class Identified(NamedTuple):
    """A model with the sensor's zero and the history its drive is found with."""

    name: str
    model: fj.Model
    offset: float
    rmse: float
    history: Literal["constant", "rest"]


def law(name: str, recording: fj.Recording) -> fj.Fit:
    """A law fitted to the record's swings."""
    others = (0.0, SWINGS[0]), (SWINGS[1], STEP * len(recording.drive))
    return fj.fit(fj.parse_model(name), recording, history="constant", mask=others)


def extended(name: str, recording: fj.Recording, second: fj.Recording) -> fj.Fit:
    """A law with what diagnosis after diagnosis adds to it."""
    model, found = fj.parse_model(name), None
    for _ in range(_DIAGNOSES):
        diagnosis = fj.diagnose(model, recording, holdout=second, history="rest")
        print(f"  {diagnosis.verdict}: {diagnosis.sentence}", flush=True)
        found, model = diagnosis.extended or diagnosis.base, diagnosis.extended_model
        if diagnosis.extended is None:
            break
    assert found is not None  # there is one diagnosis at least
    return found


def identify(fits: Path, recording: fj.Recording, second: fj.Recording) -> None:
    """Write every fit."""
    fits.mkdir(exist_ok=True)
    for name in LAWS:
        law(name, recording).save(fits / f"{name}.json")
    extended(BASE, recording, second).save(fits / EXTENDED)


def identified(fits: Path) -> list[Identified]:
    """The fits that were written.

    Before the laws' part of the record something unknown was held; what was extended has seen the
    rest at 0 V.
    """
    found = []
    for name in (*(f"{law}.json" for law in LAWS), EXTENDED):
        path = fits / name
        said = json.loads(path.read_text(encoding="utf-8"))
        zero, rmse = said["offsets"][0], said["scores"]["rmse"]
        history = "rest" if name == EXTENDED else "constant"
        drive = f"{BASE}, extended" if name == EXTENDED else path.stem
        found.append(Identified(drive, fj.load_model(path), zero, rmse, history))
    return found


def told(one: Identified, second: fj.Recording) -> dict:
    """One line of models.csv."""
    simulated = fj.simulate(one.model, second.drive, STEP, one.history).response
    missed = second.response - simulated - one.offset
    share = 100 * missed / np.ptp(second.response)
    values = (one.rmse / NOISE, np.sqrt(np.mean(share**2)), np.abs(share).max())
    texts = (one.name, one.model.name)
    return dict(zip(MODELS, (*texts, *(f"{value:.3g}" for value in values)), strict=True))


def row(motion: str, drive: str, desired: np.ndarray, read: np.ndarray, found=None) -> dict:
    """One line of results.csv: how far what was read (N,) is from what was desired (N,)."""
    error = 100 * (read - desired) / np.ptp(steady(desired))
    last = steady(error)
    values = (
        np.sqrt(np.mean(error**2)), np.abs(error).max(), np.sqrt(np.mean(last**2)),
        np.abs(last).max(), np.abs(last - last.mean()).max(),
    )  # fmt: skip
    own = ("", "")
    if found is not None:
        own = f"{100 * found.max_error / np.ptp(steady(desired)):.2g}", found.method
    return dict(zip(COLUMNS, (motion, drive, *(f"{v:.3g}" for v in values), *own), strict=True))


def learned(desired: np.ndarray, drive: np.ndarray, slope: float) -> np.ndarray:
    """The reading (N,) after turns that each send what was missed once more, at half the gain and
    without what is faster than the lag and the resonance let through."""
    for turn in range(_TURNS):
        missed = gaussian_filter1d(desired - measure(drive, seed=100 + turn), _SMOOTHED)
        drive = drive + 0.5 * slope * missed
    return measure(drive, seed=2)


def best_sinusoid(desired: np.ndarray, drive: np.ndarray) -> np.ndarray:
    """The reading (N,) by a drive whose steady part is a sine that leaves no error at its rate."""
    t = STEP * np.arange(desired.size) - (STEP * desired.size - PERIOD)
    shapes = np.stack([np.ones_like(t), np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)])
    repeats = t >= -2 * PERIOD
    gain = np.linalg.lstsq(steady(shapes.T), steady(drive), rcond=None)[0]
    aim = np.linalg.lstsq(steady(shapes.T), steady(desired), rcond=None)[0]
    read = desired
    for _ in range(_TURNS):
        used = np.where(repeats, gain @ shapes, drive)
        read = measure(used, seed=2)
        got = np.linalg.lstsq(steady(shapes.T), steady(read), rcond=None)[0]
        # As complex amplitudes, and the means by the ratio of the heights.
        asked, came, wanted = (complex(one[1], one[2]) for one in (gain, got, aim))
        mean = gain[0] + (aim[0] - got[0]) * abs(asked) / abs(came)
        turned = asked * wanted / came
        gain = np.array([mean, turned.real, turned.imag])
    return read


def in_real_time(one: Identified, recording: fj.Recording) -> list[dict]:
    """Every motion by a model's streaming inverse, to which it is not known ahead."""
    inverse, rows = (
        fj.streaming_inverse(one.model, STEP, BAND, limits=LIMITS, offset=one.offset),
        [],
    )
    low, high, _, _ = ends(recording)
    for name, desired in motions(low, high).items():
        drive = inverse.run(desired, inverse.start(0.0)).output
        rows.append(row(name, f"{one.name}, real time", desired, measure(drive, seed=2)))
    return rows


def ends(recording: fj.Recording) -> tuple[float, float, float, float]:
    """The ends of the motions [um], and the slope [V/um] and zero [V] of a line between them."""
    # A swing after the first rise, which the stage never makes again.
    swing = slice(round(SWINGS[0] / STEP), round((SWINGS[0] + 1) / STEP))
    cycle = recording.response[swing]
    low, high = cycle.min(), cycle.max()
    low, high = low + _INSET * (high - low), high - _INSET * (high - low)
    slope, zero = np.polyfit(cycle, recording.drive[swing], 1)
    return low, high, slope, zero


def tracked(models: list[Identified], recording: fj.Recording) -> list[dict]:
    """Every motion by every drive."""
    low, high, slope, zero = ends(recording)
    rows = []
    for name, desired in motions(low, high).items():
        line = np.clip(slope * desired + zero, *LIMITS)
        rows.append(row(name, "line", desired, measure(line, seed=2)))
        for one in models:
            wanted = fj.Trajectory(desired, STEP, source=name)
            options = {"limits": LIMITS, "history": one.history, "offset": one.offset}
            found = fj.compensate(one.model, wanted, **options)
            rows.append(row(name, one.name, desired, measure(found.drive, seed=2), found))
            line = found.drive
        if name.startswith("sine"):
            rows.append(row(name, "bound: best sinusoid", desired, best_sinusoid(desired, line)))
        rows.append(row(name, "bound: learned", desired, learned(desired, line, slope)))
        noise = NOISE * np.random.default_rng(2).standard_normal(desired.size)
        rows.append(row(name, "bound: no error", desired, desired + noise))
    return rows


def written(path: Path, columns: tuple[str, ...], rows: list[dict]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(versions(("fracjax", "jax", "numpy", "scipy", "optimistix")))
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="The folder of the two tables.")
    parser.add_argument("--identify", action="store_true", help="Find the models in fits/ anew.")
    parser.add_argument(
        "--streamed", action="store_true", help="Replace the rows of the real-time inverse alone."
    )
    given = parser.parse_args()
    out, fits = given.out, given.out / "fits"
    recording, second = (
        fj.Recording(drive, measure(drive, seed), STEP, source=source)
        for seed, (source, drive) in enumerate(
            {"record": record(), "second record": second_record()}.items(), 10
        )
    )
    if given.identify:
        identify(fits, recording, second)
    models = identified(fits)
    streamed = in_real_time(models[-1], recording)
    if given.streamed:
        with (out / "results.csv").open(encoding="utf-8") as file:
            rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
        rows = [each for each in rows if "real time" not in each["drive"]]
    else:
        written(out / "models.csv", MODELS, [told(one, second) for one in models])
        rows = tracked(models, recording)
    rows += streamed
    written(out / "results.csv", COLUMNS, rows)
    for line in rows:
        print("  ".join(f"{value:>24}" for value in line.values()))


if __name__ == "__main__":
    main()
