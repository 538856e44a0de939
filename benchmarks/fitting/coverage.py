"""Do 95 % intervals hold the truth in 95 % of fits, and do fits end at the noise floor?

    python -m benchmarks.fitting.coverage --recordings 200 --jobs 2

For each model, truths are drawn around where it stands, recordings simulated from them on a finer
grid, and fitted with the noise called white of its true level: white it is, or AR(1) with a
coefficient of 0.8.  A fit is at the floor when its RMSE is within 1 % of that of the noise that was
put in.
One row per recording and parameter goes into a file of rows as it is done, which goes on where it
was interrupted; coverage.csv has the coverage of each parameter, with what chance allows in 99 %.
"""

from __future__ import annotations

import argparse
import csv
import multiprocessing
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

import fracjax as fj
from benchmarks.fitting.tables import HERE, Table
from benchmarks.versions import versions
from fracjax._parameters import named_parameters
from fracjax._prepare import layout_of

STEP = 4e-3  # s
SAMPLES = 1000
NOISE = 1e-3  # of the response's span
COLOUR = {"white": 0.0, "ar1": 0.8}
MODELS = {
    "foh": {"k_l": 0.07, "k_h": 0.04, "k_p": 1.5e-4, "alpha": 0.14, "beta": -0.13},
    "lfdh": {"k_0": 0.02, "k_delta": 0.12, "chi": 0.2, "delta": 0.3, "mu": 0.6},
    "creep": {"k_c": 0.1, "mu": 0.02},
    "coupled": {
        "foh.k_l": 0.07,
        "foh.k_h": 0.04,
        "foh.k_p": 1.5e-4,
        "foh.alpha": 0.2,
        "foh.beta": -0.13,
        "creep.mu": 0.01,
    },
    "pea_dynamics": {
        "gain": 0.1,
        "creep_gain": 0.02,
        "mu": -0.15,
        "frequency": 25.0,
        "damping": 0.3,
    },
    "bouc_wen": {},  # where the model stands
}
PACKAGES = ("fracjax", "jax", "jaxlib", "numpy", "scipy")
FIELDS = (
    "model", "noise", "recording", "parameter", "truth", "value", "standard_error", "identified",
    "covered", "rmse_over_noise", "residual_order", "converged",
)  # fmt: skip


def drive() -> np.ndarray:
    """Four tones [V] that no period of the record keeps."""
    times = STEP * np.arange(SAMPLES)
    tones = ((15, 0.7, 0.0), (10, 2.3, 1.0), (7, 5.9, 2.0), (5, 11.7, 3.0))
    return 50 + np.sum([a * np.sin(2 * np.pi * f * times + p) for a, f, p in tones], axis=0)


def noise_of(generator: np.random.Generator, coefficient: float) -> np.ndarray:
    """AR(1) noise (N,) of unit variance, begun long before."""
    white = generator.standard_normal(2 * SAMPLES)
    noise = np.zeros(2 * SAMPLES)
    for t in range(1, 2 * SAMPLES):
        noise[t] = coefficient * noise[t - 1] + np.sqrt(1 - coefficient**2) * white[t]
    return noise[SAMPLES:]


def one(name: str, noise: str, number: int) -> list[dict[str, Any]]:
    """Rows of one recording: each value is moved from its middle by up to a fifth."""
    generator = np.random.default_rng([number, *name.encode(), *noise.encode()])
    model = fj.parse_model(name).with_values(MODELS[name])
    parameters = named_parameters(model.block)
    truth = {}
    for label, size in (*layout_of(model.block).shapes, *layout_of(model.block).gains):
        middle = parameters[label].value
        moved = middle * (1 + 0.2 * generator.uniform(-1, 1, np.shape(middle)))
        truth[label] = np.clip(moved, parameters[label].lower, parameters[label].upper)
        assert size == 1
    clean = fj.simulate(model.with_values(truth), drive(), STEP).response
    sigma = NOISE * float(np.ptp(clean))
    added = sigma * noise_of(generator, COLOUR[noise])
    recording = fj.Recording(drive(), clean + added, STEP, source=f"{name} {noise} {number}")
    known = fj.Noise(sigma, "um", "specification", np.ones(1), sigma)
    found = fj.fit(
        fj.parse_model(name),
        recording,
        noise=known,
        history="constant",
        settling=0,
        seed=number,
    )
    ratio = found.scores.rmse / float(np.sqrt(np.mean(added**2)))
    return [
        {
            "model": name,
            "noise": noise,
            "recording": number,
            "parameter": estimate.name,
            "truth": float(truth[estimate.name]),
            "value": estimate.value,
            "standard_error": estimate.standard_error,
            "identified": estimate.identified,
            "covered": estimate.interval[0] <= truth[estimate.name] <= estimate.interval[1],
            "rmse_over_noise": ratio,
            "residual_order": found.residual_order,
            "converged": found.converged,
        }
        for estimate in found.estimates
    ]


def summary(rows: list[dict[str, str]]) -> list[dict[str, Any]]:
    """One row for each parameter of each model and noise."""
    fitted, found = [row for row in rows if row["rmse_over_noise"]], []
    for model, noise in dict.fromkeys((r["model"], r["noise"]) for r in rows):
        of_pair = [r for r in rows if (r["model"], r["noise"]) == (model, noise)]
        those = [r for r in fitted if (r["model"], r["noise"]) == (model, noise)]
        ratios = {r["recording"]: float(r["rmse_over_noise"]) for r in those}
        failed = len({r["recording"] for r in of_pair} - set(ratios))
        floor = np.mean([ratio < 1.01 for ratio in ratios.values()]) if ratios else np.nan
        for name in dict.fromkeys(r["parameter"] for r in those):
            covered = [r["covered"] == "True" for r in those if r["parameter"] == name]
            identified = [r["identified"] == "True" for r in those if r["parameter"] == name]
            low, high = stats.binom.interval(0.99, len(covered), 0.95)
            found.append(
                {
                    "model": model,
                    "noise": noise,
                    "parameter": name,
                    "fits": len(covered),
                    "failed": failed,
                    "at_floor": f"{floor:.3f}",
                    "covered": sum(covered),
                    "chance_low": int(low),
                    "chance_high": int(high),
                    "identified": sum(identified),
                }
            )
    return found


def attempted(case: tuple[str, str, int]) -> list[dict[str, Any]]:
    """Rows of one recording; of a fit that fails, one row that says so."""
    try:
        return one(*case)
    except Exception as error:
        name, noise, number = case
        blank = dict.fromkeys(FIELDS, "") | {"model": name, "noise": noise, "recording": number}
        return [blank | {"parameter": f"{type(error).__name__}: {error}"[:200]}]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=200)
    parser.add_argument("--models", nargs="+", choices=MODELS, default=list(MODELS))
    parser.add_argument("--noises", nargs="+", choices=COLOUR, default=list(COLOUR))
    parser.add_argument("--jobs", type=int, default=2, help="Processes.")
    parser.add_argument("--rows", type=Path, default=Path("coverage_rows.csv"))
    parser.add_argument("--out", type=Path, default=HERE / "coverage.csv")
    options = parser.parse_args()
    table = Table(options.rows, FIELDS, ("model", "noise", "recording"), PACKAGES)
    done = table.done()
    missing = [
        (name, noise, number)
        for name in options.models
        for noise in options.noises
        for number in range(options.recordings)
        if (name, noise, str(number)) not in done
    ]
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for rows in pool.imap_unordered(attempted, missing):
            table.add(rows)
    found = summary(table.rows())
    with options.out.open("w", encoding="utf-8", newline="") as file:
        file.write(versions(PACKAGES))
        writer = csv.DictWriter(file, list(found[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(found)
    for row in found:
        print(*row.values(), sep="  ")


if __name__ == "__main__":
    main()
