"""How fast the posterior's density is: compressed, full, and as one writes it in NumPy.

    python -m benchmarks.posterior.speed --out benchmarks/posterior/speed.csv

FOH with white noise on several tones, at each length in one run: log-densities per second, and
emcee's 32 walkers from end to end.  The NumPy row is the plain way: one call for each walker, two
transforms of the drive's length in it, the offset at its best.  Fit and compression count as
`prepared`, compilation as `compiled`; `error` is the largest difference from the full model's
log-density over draws of the posterior's width.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Callable
from pathlib import Path

import emcee
import jax
import numpy as np

import fracjax as fj
from benchmarks.fitting.run import Foh, record, several_tones
from benchmarks.versions import versions
from fracjax._posterior import compressed, laplace, log_posteriors_of, target_of
from fracjax._posterior._posterior import _starts
from fracjax._posterior._sample import in_batches

WALKERS = 32
PACKAGES = ("fracjax", "jax", "jaxlib", "emcee", "numpy", "scipy")
COLUMNS = ("samples", "density", "per_second", "times_numpy", "emcee_steps_per_second",
           "times_numpy_emcee", "prepared_s", "compiled_s", "error")  # fmt: skip

Densities = Callable[[np.ndarray], np.ndarray]


def timed(density: Densities, points: np.ndarray, seconds: float) -> float:
    """Log-densities per second, the best of the rounds that fit in."""
    fastest, until = np.inf, time.perf_counter() + seconds
    while time.perf_counter() < until or not np.isfinite(fastest):
        began = time.perf_counter()
        density(points)
        fastest = min(fastest, time.perf_counter() - began)
    return len(points) / fastest


def walked(density: Densities, points: np.ndarray, seconds: float) -> float:
    """Steps per second of emcee's walkers from points (W, D)."""
    sampler = emcee.EnsembleSampler(len(points), points.shape[1], density, vectorize=True)
    began = time.perf_counter()
    for taken, _ in enumerate(sampler.sample(points, iterations=10**6, store=False), 1):
        if time.perf_counter() - began > seconds:
            return taken / (time.perf_counter() - began)
    raise AssertionError("more steps than anybody has time for")


def in_numpy(recording: fj.Recording) -> Densities:
    """ln p of rows alpha, beta, k_l, k_h, k_p, ln σ: flat between bounds, offset at its best."""
    model = Foh(recording)

    def one(row: np.ndarray) -> float:
        if not np.all((row[:5] > model.low) & (row[:5] < model.high)):
            return -np.inf
        residual = model.residual(row[:5])
        return float(-residual @ residual / (2 * np.exp(2 * row[5])) - residual.size * row[5])

    return lambda rows: np.array([one(row) for row in rows])


def rows_for(samples: int, seconds: float) -> list[dict]:
    """Three densities at one length."""
    recording, sigma = record(several_tones, samples)
    noise = fj.Noise(sigma, recording.response_unit, "specification", np.ones(1), sigma)
    began = time.perf_counter()
    fit = fj.fit(fj.parse_model("foh"), recording, noise=noise, history="constant", settling=0)
    target, terms = target_of(fit, fj.WhiteNoise(), {})
    fast = compressed(target, _starts(terms))
    prepared = time.perf_counter() - began
    compiled = {"NumPy": 0.0}
    for name, one in (("full", target), ("compressed", fast)):
        began = time.perf_counter()
        in_batches(log_posteriors_of(one))(_starts(terms)[None])
        compiled[name] = time.perf_counter() - began
    found = laplace(fast, _starts(terms))
    generator = np.random.default_rng(0)
    points = generator.standard_normal((WALKERS, len(terms))) @ found.factor.T + found.mode
    names = [term.name for term in terms]
    physical = np.stack([np.asarray(target.values(point)) for point in points])
    order = [names.index(n) for n in ("alpha", "beta", "k_l", "k_h", "k_p", "noise.sigma")]
    plain = physical[:, order]
    plain[:, 5] = np.log(plain[:, 5])

    densities: dict[str, tuple[Densities, np.ndarray]] = {
        "NumPy": (in_numpy(recording), plain),
        "full": (in_batches(log_posteriors_of(target)), points),
        "compressed": (in_batches(log_posteriors_of(fast)), points),
    }
    full, short = (densities[name][0](points) for name in ("full", "compressed"))
    error = float(np.abs(short - full).max())
    rows = []
    for name, (density, where) in densities.items():
        rate, steps = timed(density, where, seconds), walked(density, where, seconds)
        first = rows[0] if rows else {"per_second": rate, "emcee_steps_per_second": steps}
        told = (samples, name, rate, rate / first["per_second"], steps,
                steps / first["emcee_steps_per_second"], prepared, compiled[name],
                error if name == "compressed" else 0.0)  # fmt: skip
        rows.append(dict(zip(COLUMNS, told, strict=True)))
        print(*(f"{v:.4g}" if isinstance(v, float) else v for v in told), sep="  ", flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--samples", type=int, nargs="+", default=[5_000, 50_000])
    parser.add_argument("--seconds", type=float, default=10.0, help="for each measurement")
    options = parser.parse_args()
    with options.out.open("w", newline="") as file, jax.enable_x64(True):
        file.write(versions(PACKAGES))
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        for samples in options.samples:
            table.writerows(rows_for(samples, options.seconds))


if __name__ == "__main__":
    main()
