"""How fast posteriors are: the density, and draws, beside NumPy's way and beside NUTS.

    python -m benchmarks.posterior.speed

FOH with white noise on several tones, at each length in one run.  Densities:

- `NumPy`: the plain way, one call for each walker, two transforms of the drive's length in it, the
  offset at its best;
- `full`: the same in JAX, priors included, all walkers in one call;
- `compressed`: the same from inner products alone, which `fracjax posterior` starts from;
- `marginal`: that with the three gains integrated out, which its walkers move over.

Told of each: log-densities per second; steps per second of emcee's 32 walkers from end to end, in
JAX sixteen at a time, as half of them move at once; and effective draws per second of the slowest
number: draws over autocorrelation time, from as many steps as the time allows (`steps`; of few
steps the time is underestimated, and the rate flattered).  All chains start within the posterior.
`NUTS` is numpyro's on the compressed density in the chain's own whitened coordinates, its
adaptation not counted, where numpyro is installed.

Fit and compression count as `prepared`, compilation as `compiled`; `error` is the largest
difference from the full model's log-density over draws of the posterior's width.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import emcee
import jax
import jax.numpy as jnp
import numpy as np

import fracjax as fj
from benchmarks.fitting.run import Foh, record, several_tones
from benchmarks.versions import versions
from fracjax._posterior import Target, compressed, laplace, log_posteriors_of, target_of
from fracjax._posterior._laplace import Laplace
from fracjax._posterior._marginal import marginal_of
from fracjax._posterior._posterior import _starts
from fracjax._posterior._sample import MOVES, in_batches

WALKERS = 32
PACKAGES = ("fracjax", "jax", "jaxlib", "emcee", "numpyro", "numpy", "scipy")
COLUMNS: tuple[str, ...] = (
    "samples",
    "density",
    "per_second",
    "times_numpy",
    "emcee_steps_per_second",
    "times_numpy_emcee",
    "steps",
    "ess_per_second",
    "times_numpy_ess",
    "prepared_s",
    "compiled_s",
    "error",
)
STEPS = 20
NUTS_WARMUP, NUTS_DRAWS = 500, 2000

Densities = Callable[[np.ndarray], np.ndarray]


def timed(density: Densities, points: np.ndarray, seconds: float) -> float:
    """Log-densities per second, the best of the rounds that fit in."""
    fastest, until = np.inf, time.perf_counter() + seconds
    while time.perf_counter() < until or not np.isfinite(fastest):
        began = time.perf_counter()
        density(points)
        fastest = min(fastest, time.perf_counter() - began)
    return len(points) / fastest


def walked(density: Densities, points: np.ndarray, seconds: float) -> tuple[float, float, int]:
    """Steps per second of emcee's walkers from points (W, D), effective draws per second of the
    slowest number, and how many steps."""
    sampler = emcee.EnsembleSampler(
        len(points), points.shape[1], density, vectorize=True, moves=MOVES
    )
    state, taken, began = points, 0, time.perf_counter()
    while time.perf_counter() - began < seconds:
        state = sampler.run_mcmc(state, STEPS, skip_initial_state_check=True)
        taken += STEPS
    elapsed = time.perf_counter() - began
    slowest = float(np.max(sampler.get_autocorr_time(tol=0, quiet=True)))
    return taken / elapsed, taken * len(points) / slowest / elapsed, taken


def nuts(target: Target, found: Laplace) -> float:
    """Effective draws per second of the slowest number by numpyro's NUTS, adaptation left out."""
    from numpyro.diagnostics import effective_sample_size  # type: ignore[import-not-found]
    from numpyro.infer import MCMC, NUTS  # type: ignore[import-not-found]

    def potential(coordinates: jax.Array) -> jax.Array:
        return -target.log_posterior(
            jnp.asarray(found.mode) + jnp.asarray(found.factor) @ coordinates
        )

    # The chain's own coordinates are whitened already: no mass matrix is adapted.
    kernel = NUTS(potential_fn=potential, adapt_mass_matrix=False)
    chain = MCMC(kernel, num_warmup=NUTS_WARMUP, num_samples=NUTS_DRAWS, progress_bar=False)
    start = jnp.zeros(found.mode.size)
    chain.warmup(jax.random.key(0), init_params=start)
    chain.run(chain.post_warmup_state.rng_key)  # compiles
    began = time.perf_counter()
    chain.post_warmup_state = chain.last_state
    chain.run(chain.post_warmup_state.rng_key)
    draws = np.asarray(jax.block_until_ready(chain.get_samples()))
    elapsed = time.perf_counter() - began
    return float(np.min(effective_sample_size(draws[None]))) / elapsed


def in_numpy(recording: fj.Recording) -> Densities:
    """ln p of rows alpha, beta, k_l, k_h, k_p, ln σ: flat between bounds, offset at its best."""
    model = Foh(recording)

    def one(row: np.ndarray) -> float:
        if not np.all((row[:5] > model.low) & (row[:5] < model.high)):
            return -np.inf
        residual = model.residual(row[:5])
        return float(-residual @ residual / (2 * np.exp(2 * row[5])) - residual.size * row[5])

    return lambda rows: np.array([one(row) for row in rows])


def rows_for(samples: int, seconds: float) -> list[dict[str, Any]]:
    """All densities at one length."""
    recording, sigma = record(several_tones, samples)
    noise = fj.Noise(sigma, recording.response_unit, "specification", np.ones(1), sigma)
    began = time.perf_counter()
    fit = fj.fit(fj.parse_model("foh"), recording, noise=noise, history="constant", settling=0)
    target, terms = target_of(fit, fj.WhiteNoise(), {})
    starts = _starts(terms)
    fast = compressed(target, starts)
    prepared = time.perf_counter() - began
    marginal, short = marginal_of(fast, starts)
    found = laplace(fast, starts)
    draws = np.random.default_rng(0).standard_normal((WALKERS, len(terms)))
    points = found.at(draws)
    names = [term.name for term in terms]
    physical = np.stack([np.asarray(target.values(point)) for point in points])
    order = [names.index(n) for n in ("alpha", "beta", "k_l", "k_h", "k_p", "noise.sigma")]
    plain = physical[:, order]
    plain[:, 5] = np.log(plain[:, 5])
    densities: dict[str, tuple[Densities, np.ndarray]] = {
        "NumPy": (in_numpy(recording), plain),
        "full": (log_posteriors_of(target), points),
        "compressed": (log_posteriors_of(fast), points),
        "marginal": (log_posteriors_of(marginal), short.at(draws[:, : len(marginal.sampled)])),
    }
    compiled, heights = {}, {}
    for name, (density, where) in densities.items():
        began = time.perf_counter()
        heights[name] = density(where)
        compiled[name] = time.perf_counter() - began
    error = float(np.abs(heights["compressed"] - heights["full"]).max())
    rows: list[dict[str, Any]] = []
    for name, (density, where) in densities.items():
        rate = timed(density, where, seconds)
        moved = density if name == "NumPy" else in_batches(density)
        moved(where)  # compiles
        steps, ess, taken = walked(moved, where, seconds)
        first = rows[0] if rows else dict(per_second=rate, emcee_steps_per_second=steps,
                                          ess_per_second=ess)  # fmt: skip
        told = (samples, name, rate, rate / first["per_second"], steps,
                steps / first["emcee_steps_per_second"], taken, ess, ess / first["ess_per_second"],
                prepared, compiled[name], error if name == "compressed" else 0.0)  # fmt: skip
        rows.append(dict(zip(COLUMNS, told, strict=True)))
    if find_spec("numpyro"):
        ess = nuts(fast, found)
        rows.append({"samples": samples, "density": "NUTS", "steps": NUTS_DRAWS,
                     "ess_per_second": ess, "times_numpy_ess": ess / rows[0]["ess_per_second"],
                     "prepared_s": prepared})  # fmt: skip
    for row in rows:
        print(*(f"{v:.4g}" if isinstance(v, float) else v for v in row.values()), sep="  ")
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("speed.csv"))
    parser.add_argument("--samples", type=int, nargs="+", default=[5_000, 50_000])
    parser.add_argument("--seconds", type=float, default=10.0, help="for each measurement")
    options = parser.parse_args()
    with jax.enable_x64(True):
        rows = [row for samples in options.samples for row in rows_for(samples, options.seconds)]
    with options.out.open("w", encoding="utf-8", newline="") as file:
        file.write(versions(PACKAGES))
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(rows)


if __name__ == "__main__":
    main()
