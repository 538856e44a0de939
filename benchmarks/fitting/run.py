"""FOH fitted by fracjax's cross-check and by its peers, in one run and one table.

    python -m benchmarks.fitting.run

Two recordings with 0.1 % of noise from the exam's simulator, which shares no numerics with any of
the methods: several tones, which determine alpha, and one at 1 Hz, which hardly does.  A run is at
the floor when its rmse is within 1 % of the least that any method reached; the table says how large
a share of a method's starts or seeds came there.  Seconds are those of all its starts together,
warm unless the row says otherwise; at the end they are told per arrival at the floor, over those of
fracjax's gradient fit.  Peers that are not installed are left out: pyswarms, cma.  A quarter of an
hour at full size, most of it the peers'; a case that the table holds is done.
"""

from __future__ import annotations

import argparse
import importlib
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np
import optimistix
import scipy.fft
from scipy.optimize import differential_evolution, least_squares

import fracjax as fj
from benchmarks.concealed.truth import BASES, OVER
from benchmarks.fitting.tables import HERE, Table
from fracjax._crosscheck._variable_projection import projected_residual
from fracjax._prepare import prepare
from fracjax._prepare._layout import with_shapes_at

STEP = 2e-3  # s
LAW = {"alpha": 0.14, "beta": -0.13, "k_l": 0.07, "k_h": 0.04, "k_p": 1.5e-6}
NOISE = 1e-3  # of the span
ORDER, ROOM = 0.95, 3.0
AT_FLOOR = 1.01
GRADIENT = "fracjax, gradient fit"
PACKAGES = ("fracjax", "jax", "jaxlib", "optimistix", "jaxopt", "numpy", "scipy", "pyswarms", "cma")
COLUMNS = ("case", "samples", "method", "rmse_over_noise", "at_floor", "of", "evaluations",
           "seconds", "note")  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """Where each start or seed of a method ended (rmse [um]), and what all of them took."""

    method: str
    rmse: tuple[float, ...]
    evaluations: int
    seconds: float
    note: str = ""


# Recordings ---------------------------------------------------------------------------------------


def several_tones(times: np.ndarray) -> np.ndarray:
    """A drive [V] that determines alpha."""
    parts = ((14, 0.7, 0.0), (10, 1.9, 1.0), (7, 4.3, 2.0), (5, 8.9, 3.0), (3, 14.7, 4.0))
    return 50 + np.sum([a * np.sin(2 * np.pi * f * times + p) for a, f, p in parts], axis=0)


def one_tone(times: np.ndarray) -> np.ndarray:
    """A drive [V] at 1 Hz, on which k_l and k_h D^alpha are nearly one column."""
    return 50 + 40 * np.sin(2 * np.pi * times)


CASES = {"several tones": several_tones, "1 Hz": one_tone}


def record(drive_of: Callable[[np.ndarray], np.ndarray], samples: int) -> tuple:
    """Recording and noise [um] of FOH, simulated on a grid 32 times finer."""
    drive = drive_of(np.arange((samples - 1) * OVER + 1) * STEP / OVER)
    clean = BASES["foh"].response(drive, STEP / OVER, LAW)[::OVER]
    sigma = NOISE * np.ptp(clean)
    noise = sigma * np.random.default_rng(0).standard_normal(samples)
    return fj.Recording(drive[::OVER], clean + noise, STEP), sigma


# The peers' model, as one writes it in NumPy ------------------------------------------------------


class Foh:
    """FOH's residuals, by second-order convolution quadrature and one FFT of the drive."""

    def __init__(self, recording: fj.Recording):
        self.drive, self.response = recording.drive, recording.response
        self.count = len(recording)
        self.length = 2 ** int(np.ceil(np.log2(2 * self.count)))
        radius = 1e-10 ** (1 / self.length)
        zeta = radius * np.exp(-2j * np.pi * np.arange(self.length // 2 + 1) / self.length)
        self.slope = np.log(((1 - zeta) + (1 - zeta) ** 2 / 2) / STEP)
        self.damping = radius ** np.arange(self.count)
        moved = (self.drive - self.drive[0]) * self.damping
        self.transform = scipy.fft.rfft(moved, self.length)
        self.speed = np.abs(np.gradient(self.drive, STEP))
        self.evaluations = 0
        columns = self.columns(0.1, -0.1)[:, :3]
        reach = ROOM * np.ptp(self.response) / np.ptp(columns, axis=0)
        self.low = np.concatenate([[-ORDER, -ORDER], -reach])
        self.high = -self.low

    def derivative(self, order: float) -> np.ndarray:
        product = np.exp(order * self.slope) * self.transform
        return scipy.fft.irfft(product, self.length)[: self.count] / self.damping

    def columns(self, alpha: float, beta: float) -> np.ndarray:
        """k_l, k_h, k_p and the offset's columns (N, 4)."""
        self.evaluations += 1
        rate_weighted = self.speed * self.derivative(beta)
        parts = [self.drive, self.derivative(alpha), rate_weighted, np.ones(self.count)]
        return np.stack(parts, axis=1)

    def residual(self, parameters: np.ndarray) -> np.ndarray:
        """Of alpha, beta, k_l, k_h, k_p; the offset at its best."""
        found = self.response - self.columns(*parameters[:2])[:, :3] @ parameters[2:]
        return found - found.mean()

    def projected(self, orders: np.ndarray) -> np.ndarray:
        """Of alpha and beta; gains and offset at their best."""
        columns = self.columns(*orders)
        return self.response - columns @ np.linalg.lstsq(columns, self.response, rcond=None)[0]

    def rmse(self, parameters: np.ndarray) -> float:
        return float(np.sqrt(np.mean(self.residual(parameters) ** 2)))


def repeated(name: str, model: Foh, runs: int, one: Callable[[int], float], note="") -> Outcome:
    """A method from several starts or seeds."""
    model.evaluations, began = 0, time.perf_counter()
    found = tuple(one(seed) for seed in range(runs))
    return Outcome(name, found, model.evaluations, time.perf_counter() - began, note)


# The methods --------------------------------------------------------------------------------------


def by_optimistix(recording: fj.Recording, starts: int) -> Outcome:
    """Levenberg–Marquardt on fracjax's compiled residual with gains eliminated, orders by a
    logistic curve between their bounds."""
    block = fj.parse_model("foh").block
    with jax.enable_x64(True):
        problems = prepare([recording], history="constant", settling=0).problems()
        solver = optimistix.LevenbergMarquardt(rtol=1e-8, atol=1e-8)

        @jax.jit
        def solved(start: jax.Array) -> tuple[jax.Array, jax.Array]:
            def residual(z: jax.Array, _: None) -> jax.Array:
                return projected_residual(with_shapes_at(block, jax.nn.sigmoid(z)), problems)

            found = optimistix.least_squares(residual, solver, start, max_steps=100, throw=False)
            left = residual(found.value, None)
            return jax.numpy.sqrt(jax.numpy.mean(left[: len(recording)] ** 2)), found.stats[
                "num_steps"
            ]

        generator = np.random.default_rng(0)
        positions = generator.uniform(-1.5, 1.5, (starts, 2))
        jax.block_until_ready(solved(positions[0]))
        began = time.perf_counter()
        ended = [solved(position) for position in positions]
        rmse = tuple(float(found) for found, _ in ended)
        seconds = time.perf_counter() - began
    steps = sum(int(count) for _, count in ended)
    return Outcome(
        "optimistix LM, gains eliminated", rmse, steps, seconds, "steps, not evaluations"
    )


def by_peers(recording: fj.Recording, starts: int, seeds: int, swarm: tuple) -> Iterator[Outcome]:
    model = Foh(recording)
    low, high, (particles, iterations) = model.low, model.high, swarm
    size = f"{particles} × {iterations}"

    def drawn(seed: int) -> np.ndarray:
        return np.random.default_rng(seed).uniform(low, high)

    def root_mean_square(residual: np.ndarray) -> float:
        return float(np.sqrt(np.mean(residual**2)))

    def from_five(seed: int) -> float:
        found = least_squares(model.residual, drawn(seed), bounds=(low, high), x_scale=high)
        return root_mean_square(found.fun)

    def from_two(seed: int) -> float:
        found = least_squares(model.projected, drawn(seed)[:2], bounds=(low[:2], high[:2]))
        return root_mean_square(found.fun)

    def evolved(seed: int) -> float:
        box = list(zip(low, high, strict=True))
        return float(differential_evolution(model.rmse, box, polish=True, rng=seed).fun)

    yield repeated("SciPy least_squares, all parameters", model, starts, from_five)
    yield repeated("SciPy least_squares, gains eliminated", model, starts, from_two)
    yield repeated("SciPy differential_evolution", model, seeds, evolved, "polished")
    if pyswarms := _installed("pyswarms"):

        def swarmed(seed: int) -> float:
            np.random.seed(seed)  # noqa: NPY002  pyswarms has no other way
            options = {"c1": 1.49618, "c2": 1.49618, "w": 0.7298}
            best = pyswarms.single.GlobalBestPSO(particles, 5, options, bounds=(low, high))
            cost, _ = best.optimize(lambda x: [*map(model.rmse, x)], iterations, verbose=False)
            return float(cost)

        yield repeated("pyswarms", model, seeds, swarmed, size)
    if cma := _installed("cma"):

        def adapted(seed: int) -> float:
            options = {"bounds": [0, 1], "seed": seed + 1, "verbose": -9}
            start = np.random.default_rng(seed).uniform(size=5)

            def cost(share: np.ndarray) -> float:
                return model.rmse(low + share * (high - low))

            return float(cma.fmin2(cost, start, 0.3, options)[1].result.fbest)

        yield repeated("CMA-ES", model, seeds, adapted)


def by_fracjax(recording: fj.Recording, starts: int, seeds: int, swarm: tuple) -> Iterator[Outcome]:
    """The rows of `crosscheck`, whose fits start anew for each seed; and a fit with compilation."""
    model = fj.parse_model("foh")
    sigma = NOISE * np.ptp(recording.response)
    noise = fj.Noise(sigma, recording.response_unit, "specification", np.ones(1), sigma)
    options = {"noise": noise, "history": "constant", "settling": 0, "starts": starts}
    jax.clear_caches()
    began = time.perf_counter()
    cold = fj.fit(model, recording, **options)
    seconds = time.perf_counter() - began
    floors = tuple(cold.scores.rmse * np.sqrt(c / min(cold.start_costs)) for c in cold.start_costs)
    name = GRADIENT
    note = "cold: with compilation; poor starts are given up early"
    checks = [
        fj.crosscheck(
            model, recording, seed=seed, population=swarm[0], iterations=swarm[1], **options
        )
        for seed in range(seeds)
    ]
    yield Outcome(name, floors, 0, seconds, note)
    for rows in zip(*(check.rows for check in checks), strict=True):
        yield Outcome(
            f"fracjax, {rows[0].method}",
            tuple(row.rmse for row in rows),
            sum(row.evaluations for row in rows),
            sum(row.seconds for row in rows),
            f"each the best of {starts} starts"
            if rows[0].derivatives
            else f"{swarm[0]} × {swarm[1]}",
        )


def _installed(name: str):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return importlib.import_module(name)
    except ImportError:
        return None


def rows_for(case: str, samples: int, starts: int, seeds: int, swarm: tuple) -> list[dict]:
    """All methods on one recording."""
    recording, sigma = record(CASES[case], samples)
    outcomes = [
        *by_fracjax(recording, starts, seeds, swarm),
        by_optimistix(recording, starts),
        *by_peers(recording, starts, seeds, swarm),
    ]
    floor = min(min(outcome.rmse) for outcome in outcomes)
    rows = []
    for found in outcomes:
        arrived = sum(rmse <= AT_FLOOR * floor for rmse in found.rmse)
        ratio = f"{np.median(found.rmse) / sigma:.4g}" if len(found.rmse) else ""
        values = (case, samples, found.method, ratio, arrived, len(found.rmse),
                  found.evaluations or "", f"{found.seconds:.3g}", found.note)  # fmt: skip
        rows.append(dict(zip(COLUMNS, values, strict=True)))
    return rows


def told(rows: list[dict[str, str]]) -> None:
    """Seconds per arrival at the floor, over those of the gradient fit, method by method."""
    for case in dict.fromkeys(row["case"] for row in rows):
        those = [row for row in rows if row["case"] == case]
        per_arrival = {
            row["method"]: float(row["seconds"]) / int(row["at_floor"])
            for row in those
            if int(row["at_floor"]) and not row["note"].startswith("cold")
        }
        print(f"{case}: seconds per arrival at the floor, in those of {GRADIENT}")
        for row in those:
            if not row["note"].startswith("cold"):
                ratio = per_arrival.get(row["method"], np.inf) / per_arrival[GRADIENT]
                print(f"  {row['method']:42s} {ratio:10.3g}  ({row['at_floor']} of {row['of']})")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HERE / "results.csv")
    parser.add_argument("--samples", type=int, default=5000)
    parser.add_argument("--starts", type=int, default=16)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--swarm", type=int, nargs=2, default=(40, 200), metavar=("P", "T"))
    options = parser.parse_args()
    table = Table(options.out, COLUMNS, ("case", "samples"), PACKAGES)
    for case in CASES:
        if (case, str(options.samples)) not in table.done():
            swarm = tuple(options.swarm)
            table.add(rows_for(case, options.samples, options.starts, options.seeds, swarm))
    told(table.rows())


if __name__ == "__main__":
    main()
