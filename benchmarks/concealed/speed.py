"""How long a diagnosis takes, beside a refit of every candidate by SciPy from several starts.

    python -m benchmarks.concealed.speed --out benchmarks/concealed/speed.csv

One recording of 10,000 samples with one effect concealed, the full catalogue.  Told of each way:
seconds, and what it found best.

- `diagnose, cold` and `diagnose, warm`: `fracjax.diagnose` from the recording to the verdict, the
  first time in a process and again;
- `refit all`: every law of every effect of the catalogue (creep has two, friction has two) fitted
  together with the base by SciPy's `least_squares` on the same jitted simulation, whitened alike,
  on the same grid, its derivatives by differences, from four or ten starts: the fitted base and the
  nominal point, with trials drawn from the law's; effects ranked by BIC.  It has no floor, no
  places and no held-out data: it is the ceiling of what evidence alone tells.  Ten starts are what
  a diagnosis takes for most of the laws that it refits.
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path

import jax
import numpy as np
from scipy.optimize import least_squares

import fracjax as fj
from benchmarks.concealed.build import Spec, build
from benchmarks.versions import versions
from fracjax._blocks import EFFECTS, AbstractBlock
from fracjax._parameters import named_parameters, set_values
from fracjax._prepare import Preparation
from fracjax._solve import simulate

SAMPLES = 10_000
STARTS = (4, 10)
COLUMNS = ("effect", "level", "way", "seconds", "times_warm", "best", "verdict")


def recording_of(effect: str, level: float) -> fj.Recording:
    """A case of the exam's kind, longer."""
    spec = Spec("main", (effect,), (level,), "foh", "bursts", 500.0, SAMPLES, "white", 1e-3, 31)
    time_s, drive, response = build(spec).recording.T
    return fj.Recording(drive, response, float(np.diff(time_s).mean()), "V", "um")


def refit_all(
    preparation: Preparation, base: AbstractBlock, nominal: AbstractBlock, starts: int
) -> str:
    """The effect of the lowest BIC."""
    generator, found = np.random.default_rng(0), {}
    for name, effect in EFFECTS.items():
        laws: dict[type, list[AbstractBlock]] = {}
        for trial in effect.trials(preparation.setting):
            laws.setdefault(type(trial), []).append(trial)
        inside = [base, nominal] * (starts // 2)
        first = [
            effect.insert(b, trials[k])
            for trials in laws.values()
            for b, k in zip(inside, generator.integers(len(trials), size=starts), strict=True)
        ]
        found[name] = min(bic_of(start, preparation) for start in first)
    return min(found, key=lambda name: found[name])


def bic_of(start: AbstractBlock, preparation: Preparation) -> float:
    """BIC of one descent, every free number a parameter."""
    free = {n: p for n, p in named_parameters(start).items() if not p.fixed}
    ends = np.cumsum([np.size(p.value) for p in free.values()])[:-1]
    problems = preparation.problems()
    wanted = np.concatenate([p.whiten(np.asarray(p.response)) for p in problems])
    counted = np.concatenate([np.asarray(p.weights) for p in problems]) > 0
    unit = np.concatenate([p.whiten(np.ones(p.response.shape[0])) for p in problems])

    def residual(flat: np.ndarray) -> np.ndarray:
        values = dict(zip(free, np.split(flat, ends), strict=True))
        shaped = {n: v.reshape(np.shape(free[n].value)) for n, v in values.items()}
        block = set_values(start, shaped)
        simulated = np.concatenate([p.whiten(simulate(block, p)) for p in problems])
        error = np.where(np.isfinite(simulated), wanted - simulated, 1e6)
        return (error - unit * (unit @ error) / (unit @ unit))[counted]

    def joined(end: str) -> np.ndarray:
        return np.concatenate(
            [np.broadcast_to(getattr(p, end), np.shape(p.value)).ravel() for p in free.values()]
        )

    low, high = joined("lower"), joined("upper")
    first = np.clip(joined("value"), low, high)
    scale = np.maximum(np.abs(first), 1e-3)
    found = least_squares(residual, first, bounds=(low, high), x_scale=scale, max_nfev=60)
    return float(2 * found.cost + (first.size + 1) * np.log(counted.sum()))


def rows_of(effect: str, level: float) -> list[dict]:
    """One recording, all ways."""
    recording, model = recording_of(effect, level), fj.parse_model("foh")
    rows = []
    for way in ("diagnose, cold", "diagnose, warm"):
        began = time.perf_counter()
        diagnosis = fj.diagnose(model, recording)
        seconds = time.perf_counter() - began
        best = " or ".join(n for e in diagnosis.effects for n in (e.name, *e.confusable_with))
        rows.append({"way": way, "seconds": seconds, "best": best, "verdict": diagnosis.verdict})
    warm = rows[-1]["seconds"]
    for starts in STARTS:
        began = time.perf_counter()
        with jax.enable_x64(True):
            found = diagnosis.base
            best = refit_all(found.preparation, found.model.block, model.block, starts)
        seconds = time.perf_counter() - began
        way = f"refit all, {starts} starts"
        rows.append({"way": way, "seconds": seconds, "best": best, "verdict": ""})
    told = [
        {"seconds": f"{row['seconds']:.1f}", "times_warm": f"{row['seconds'] / warm:.1f}"}
        for row in rows
    ]
    named = {"effect": effect, "level": level}
    return [{**named, **row, **text} for row, text in zip(rows, told, strict=True)]


def main() -> None:
    """Command line: measure, print and write the table."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path)
    out = parser.parse_args().out
    rows = [row for effect in ("electrostriction", "creep") for row in rows_of(effect, 1.0)]
    for row in rows:
        print("  ".join(f"{row[column]!s:>16}" for column in COLUMNS), flush=True)
    if out is not None:
        with out.open("w", newline="", encoding="utf-8") as file:
            file.write(versions(("fracjax", "jax", "numpy", "scipy")))
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
