"""Simulation-based calibration: are truths drawn from the prior ranked evenly by their posteriors?

    python -m benchmarks.posterior.calibration --draws 200 --out calibration.csv

For each model and noise, truths are drawn from the prior, recordings simulated from them, and the
posterior sampled under that prior.  If all is right, the rank of a truth among its posterior's
draws is uniform (Talts, Betancourt, Simpson, Vehtari, Gelman, arXiv:1804.06788), and intervals of
95 % hold it in 95 % of cases.  One row per draw and parameter goes into the table as it is done; a
summary with Kolmogorov–Smirnov p-values and coverage is printed at the end.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import jax
import numpy as np
from scipy import stats

import fracjax as fj
from fracjax._fit import layout_of, prepare
from fracjax._parameters import named_parameters, set_values
from fracjax._posterior import AbstractPrior, Logarithmic, Normal, Uniform, prior_of

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
)


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
    """A recording of the model on the grid that it will be fitted on, with noise."""
    blank = fj.Recording(drive(), drive(), STEP)
    level = fj.Noise(1.0, "um", "specification", np.ones(1), 1.0)
    problem = prepare([blank], noise=level, history="constant").problems()[0]
    values = {n: v for n, v in truth.items() if not n.startswith("noise.")}
    clean = np.asarray(problem.simulate(set_values(model.block, values)))[:SAMPLES]
    noise, white = np.zeros(2 * SAMPLES), generator.standard_normal(2 * SAMPLES)
    for t in range(2 * SAMPLES):
        past = truth.get("noise.partial[1]", 0.0) * noise[t - 1]
        noise[t] = past + truth["noise.sigma"] * white[t]
    return fj.Recording(drive(), clean + noise[SAMPLES:], STEP)


def one_draw(model: fj.Model, noise: str, draw: int, steps: int) -> list[dict[str, Any]]:
    """Rows of one truth."""
    generator = np.random.default_rng([draw, len(model.name), len(noise)])
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
    rows = []
    for name, value in truth.items():
        draws = found.samples[name].ravel()
        low, high = np.percentile(draws, [2.5, 97.5])
        rows.append(
            {
                "model": model.name,
                "noise": noise,
                "draw": draw,
                "parameter": name,
                "truth": value,
                "rank": float(np.mean(draws < value)),
                "covered": bool(low <= value <= high),
                "converged": found.converged,
            }
        )
    return rows


def told(rows: list[dict[str, Any]]) -> None:
    """One line for each parameter: evenness of its ranks, coverage, chains that arrived."""
    for key in dict.fromkeys((r["model"], r["noise"], r["parameter"]) for r in rows):
        those = [r for r in rows if (r["model"], r["noise"], r["parameter"]) == key]
        even = stats.kstest([r["rank"] for r in those], "uniform").pvalue
        covered, converged = (
            100 * np.mean([r[field] for r in those]) for field in ("covered", "converged")
        )
        print(
            f"{' '.join(key):40s} KS p = {even:.3f}, 95 % interval holds the truth in "
            f"{covered:.1f} %, converged {converged:.0f} % of {len(those)}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--steps", type=int, default=6000, help="at most, for each chain")
    parser.add_argument("--models", nargs="+", choices=MODELS, default=MODELS)
    parser.add_argument("--noises", nargs="+", choices=NOISES, default=list(NOISES))
    parser.add_argument("--out", type=Path, default=Path("calibration.csv"))
    options = parser.parse_args()
    rows = []
    with options.out.open("w", encoding="utf-8", newline="") as file, jax.enable_x64(True):
        table = csv.DictWriter(file, FIELDS)
        table.writeheader()
        for name in options.models:
            for noise in options.noises:
                for draw in range(options.draws):
                    found = one_draw(fj.parse_model(name), noise, draw, options.steps)
                    table.writerows(found)
                    file.flush()
                    rows += found
    told(rows)


if __name__ == "__main__":
    main()
