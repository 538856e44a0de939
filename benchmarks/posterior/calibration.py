"""Simulation-based calibration: are truths drawn from the prior ranked evenly by their posteriors?

    python -m benchmarks.posterior.calibration --draws 200 --jobs 2 --rows calibration_rows.csv

For each model and noise, truths are drawn from the prior, recordings simulated from them, and the
posterior sampled under that prior.  If all is right, the rank of a truth among independent draws of
its posterior is uniform (Talts, Betancourt, Simpson, Vehtari, Gelman, arXiv:1804.06788), and
intervals of 95 % hold it in 95 % of cases.

Neither the fit that a chain starts from nor its noise floor knows the truth: both begin at the
middle of the prior.  Ranks are among 99 draws picked at random out of a chain's thousands, whose
autocorrelation then no longer counts.  Chains that did not converge are counted, not left out: to
leave them out would favour truths that are easy to sample.

Rows, one per draw and parameter, go into a file as they are done; draws that are in it already are
skipped.  The summary of all rows, with chi-squared p-values over 20 bins and coverage, replaces
calibration.csv beside this program.
"""

from __future__ import annotations

import argparse
import csv
import multiprocessing
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import jax
import numpy as np
from scipy import stats

import fracjax as fj
from benchmarks.versions import versions
from fracjax._parameters import named_parameters, set_values
from fracjax._posterior import AbstractPrior, Logarithmic, Normal, Uniform, prior_of
from fracjax._prepare import layout_of, prepare

STEP = 4e-3  # s
SAMPLES = 400
NOISE = 0.02  # of the response, in the middle of its prior
MODELS = ("foh", "lfdh", "coupled", "bouc_wen")
NOISES = {"white": fj.WhiteNoise(), "ar1": fj.ARNoise(1)}
FIELDS: tuple[str, ...] = (
    "model",
    "noise",
    "draw",
    "parameter",
    "truth",
    "rank",
    "covered",
    "converged",
    "seconds",
)
SUMMARY: tuple[str, ...] = (
    "model",
    "noise",
    "parameter",
    "draws",
    "unconverged",
    "chi_squared_p",
    "coverage_95",
)
PACKAGES = ("fracjax", "jax", "emcee", "numpy", "scipy")
FINER = 8
RANKED = 99
BINS = 20

Case = tuple[str, str, int]


def drive() -> np.ndarray:
    """Three tones [V] that no period of the record keeps."""
    times = STEP * np.arange(SAMPLES)
    tones = ((15, 1.3, 0.0), (10, 4.1, 1.0), (6, 11.7, 2.0))
    return 40 + np.sum([a * np.sin(2 * np.pi * f * times + p) for a, f, p in tones], axis=0)


def priors_of(model: fj.Model, noise: str) -> dict[str, AbstractPrior]:
    """The parameters' own priors for shapes; gains within a fifth of where the model stands."""
    parameters, layout = named_parameters(model.block), layout_of(model.block)
    found: dict[str, AbstractPrior] = {n: prior_of(parameters[n], 0, 1.0) for n, _ in layout.shapes}
    for name, _ in layout.gains:
        value = float(parameters[name].value) or 1e-3
        found[name] = Normal(value, abs(value) / 5)
    if noise == "ar1":
        found["noise.partial[1]"] = Uniform(0.2, 0.9)
    return found


def simulated(
    model: fj.Model, truth: dict[str, float], generator: np.random.Generator
) -> fj.Recording:
    """A recording of the model with noise, on a grid finer than a fit asks for: of a coarser one
    the noise's level would have to take up the difference."""
    blank = fj.Recording(drive(), drive(), STEP)
    level = fj.Noise(1.0, "um", "specification", np.ones(1), 1.0)
    prepared = prepare([blank], noise=level, history="constant")
    problem = prepared.with_oversampling(FINER * prepared.oversampling).problems()[0]
    values = {n: v for n, v in truth.items() if not n.startswith("noise.")}
    clean = np.asarray(problem.simulate(set_values(model.block, values)))[:SAMPLES]
    noise, white = np.zeros(2 * SAMPLES), generator.standard_normal(2 * SAMPLES)
    for t in range(2 * SAMPLES):
        past = truth.get("noise.partial[1]", 0.0) * noise[t - 1]
        noise[t] = past + truth["noise.sigma"] * white[t]
    return fj.Recording(drive(), clean + noise[SAMPLES:], STEP)


def one_draw(model: fj.Model, noise: str, draw: int, steps: int) -> list[dict[str, Any]]:
    """Rows of one truth."""
    began = time.perf_counter()
    generator = np.random.default_rng([draw, MODELS.index(model.name), list(NOISES).index(noise)])
    nominal = simulated(model, {"noise.sigma": 0.0}, generator)
    sigma = NOISE * float(nominal.response.std())
    priors = priors_of(model, noise)
    priors["noise.sigma"] = Logarithmic(Normal(np.log(sigma), 0.5))
    truth = {n: float(p.value(generator.standard_normal())) for n, p in priors.items()}
    recording = simulated(model, truth, generator)
    known = fj.Noise(sigma, "um", "specification", np.ones(1), sigma)
    fit = fj.fit(model, recording, noise=known, history="constant", settling=0, starts=4, seed=draw)
    found = fj.sample_posterior(
        fit, noise_model=NOISES[noise], priors=priors, steps=steps, seed=draw
    )
    picked = generator.choice(found.log_posterior.size, RANKED, replace=False)
    intervals = {row.name: row.interval for row in found.rows}
    rows = []
    for name, value in truth.items():
        low, high = intervals[name]
        rows.append(
            {
                "model": model.name,
                "noise": noise,
                "draw": draw,
                "parameter": name,
                "truth": value,
                "rank": int(np.sum(found.samples[name].ravel()[picked] < value)),
                "covered": int(low <= value <= high),
                "converged": int(found.converged),
                "seconds": round(time.perf_counter() - began, 2),
            }
        )
    return rows


def worked(job: tuple[Case, int]) -> list[dict[str, Any]]:
    """What a worker does."""
    (name, noise, draw), steps = job
    with jax.enable_x64(True):
        return one_draw(fj.parse_model(name), noise, draw, steps)


def case_of(row: dict[str, Any]) -> Case:
    return row["model"], row["noise"], int(row["draw"])


def kept(path: Path) -> list[dict[str, Any]]:
    """Rows of the draws that are whole; a run that was killed may have left a part of one."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    # Its last row, and the last number of that.
    whole = {case_of(r) for r in rows if r["parameter"] == "noise.sigma" and r["seconds"]}
    return [row for row in rows if case_of(row) in whole]


def run(jobs: list[tuple[Case, int]], workers: int) -> Iterator[list[dict[str, Any]]]:
    """Rows of each draw as it is done."""
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        yield from pool.imap_unordered(worked, jobs)


def summary_of(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row for each parameter: evenness of its ranks, coverage, chains that did not arrive."""
    found = []
    for key in dict.fromkeys((r["model"], r["noise"], r["parameter"]) for r in rows):
        those = [r for r in rows if (r["model"], r["noise"], r["parameter"]) == key]
        # RANKED + 1 possible ranks, in bins of equally many.
        ranks = np.array([int(r["rank"]) for r in those]) * BINS // (RANKED + 1)
        even = stats.chisquare(np.bincount(ranks, minlength=BINS)).pvalue
        told = (*key, len(those), sum(r["converged"] == 0 for r in those), round(float(even), 4),
                round(float(np.mean([r["covered"] for r in those])), 4))  # fmt: skip
        found.append(dict(zip(SUMMARY, told, strict=True)))
    return found


def typed(row: dict[str, Any]) -> dict[str, Any]:
    return row | {name: int(row[name]) for name in ("draw", "rank", "covered", "converged")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--steps", type=int, default=6000, help="at most, for each chain")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--models", nargs="+", choices=MODELS, default=MODELS)
    parser.add_argument("--noises", nargs="+", choices=NOISES, default=list(NOISES))
    parser.add_argument("--rows", type=Path, default=Path("calibration_rows.csv"))
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("calibration.csv"))
    options = parser.parse_args()
    rows = [typed(row) for row in kept(options.rows)]
    done = {case_of(row) for row in rows}
    cases = product(options.models, options.noises, range(options.draws))
    jobs = [(case, options.steps) for case in cases if case not in done]
    with options.rows.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, FIELDS)
        table.writeheader()
        table.writerows(rows)
        file.flush()
        for found in run(jobs, options.jobs):
            table.writerows(found)
            file.flush()
            rows += found
            print(*case_of(found[0]), f"{found[0]['seconds']} s", flush=True)
    with options.out.open("w", encoding="utf-8", newline="") as file:
        file.write(versions(PACKAGES))
        table = csv.DictWriter(file, SUMMARY)
        table.writeheader()
        for row in summary_of(sorted(rows, key=lambda r: (MODELS.index(r["model"]), r["noise"]))):
            table.writerow(row)
            print(*row.values())


if __name__ == "__main__":
    main()
