"""Recordings with real noise and nothing missing: a diagnosis must say `none`.

    FRACJAX_DATA=DIR python -m benchmarks.real.nulls

The noise is that of piezo_dbo's sensor, from the steady cycles: the second difference of three
successive cycles, /√6, holds neither the loop nor its drift.  Triples that share no cycle give 13
independent cycles of noise, which each null takes in another order, with other signs.

- `steady`: a model fitted to the steady cycles, and that noise on it; floor from repeats;
- `rest`: the same on a stretch of the second file's drive that holds a rest; floor from the rest;
- `split`: eight of the measured cycles drawn by lot, against a model that is a table, the mean of
  the thirty others.  Order by lot turns the drift into noise from cycle to cycle.  The table's own
  noise makes every score sqrt(1 + 8/30) = 1.13 times too large.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

import fracjax as fj
from benchmarks.real.recordings import piezo_dbo, rounded, table

PERIOD = 200  # samples
HELD = slice(3400, 6000)  # the second file's first rest, and what is before and after it
CASES = (("steady", "foh", 6), ("steady", "lfdh", 4), ("rest", "lfdh", 4), ("split", "table", 6))
LATE = 2  # cycles after which the loop is steady


class MeanCycle(fj.AbstractBlock):
    """A cycle known by its samples, times a gain: y = g ȳ(t mod T)."""

    cycle: np.ndarray
    gain: fj.Parameter
    linear = False

    def __init__(self, cycle: np.ndarray):
        self.cycle, self.gain = cycle, fj.Parameter(1.0, gain=True)

    def __call__(self, drive: Array, grid: fj.Grid) -> Array:
        turns = jnp.arange(drive.shape[0]) * grid.step / (PERIOD * 5e-3)
        places = np.arange(PERIOD) / PERIOD
        return self.gain.value * jnp.interp(turns % 1, places, jnp.asarray(self.cycle), period=1.0)


def cycles_of(recording: fj.Recording) -> np.ndarray:
    """Whole cycles of the response (K, 200)."""
    count = len(recording) // PERIOD
    return recording.response[: count * PERIOD].reshape(count, PERIOD)


def noise_of(cycles: np.ndarray) -> np.ndarray:
    """Independent cycles of noise (K // 3, 200)."""
    triples = cycles[: len(cycles) // 3 * 3].reshape(-1, 3, PERIOD)
    return (triples[:, 0] - 2 * triples[:, 1] + triples[:, 2]) / np.sqrt(6)


def shuffled(noise: np.ndarray, samples: int, generator: np.random.Generator) -> np.ndarray:
    """Noise (samples,) from cycles in another order, each with a sign by lot."""
    order = np.concatenate([generator.permutation(len(noise)) for _ in range(2)])
    signs = generator.choice([-1.0, 1.0], (order.size, 1))
    return (signs * noise[order]).ravel()[:samples]


def null(
    kind: str, model: fj.Model, steady: fj.Recording, nested: fj.Recording, seed: int
) -> tuple[fj.Model, fj.Recording]:
    """A model and a recording that it lacks nothing of."""
    generator = np.random.default_rng(seed)
    cycles = cycles_of(steady)[LATE:]
    if kind == "split":
        order = generator.permutation(len(cycles))
        drawn, others = cycles[order[:8]], cycles[order[8:]]
        recording = fj.Recording(steady.drive[: 8 * PERIOD], drawn.ravel(), steady.dt)
        return fj.Model(MeanCycle(others.mean(axis=0)), "table"), recording
    drive = steady.drive[: 13 * PERIOD] if kind == "steady" else nested.drive[HELD]
    response = fj.simulate(model, drive, steady.dt).response
    noise = shuffled(noise_of(cycles), drive.size, generator)
    return model, fj.Recording(drive, response + noise, steady.dt)


def main() -> None:
    steady, nested = piezo_dbo()
    truths = {
        name: fj.fit(fj.parse_model(name), steady, history="constant").model
        for name in ("foh", "lfdh")
    }
    rows = []
    for kind, name, count in CASES:
        for seed in range(count):
            truth = truths.get(name, fj.Model(fj.blocks.FOH()))
            model, recording = null(kind, truth, steady, nested, seed)
            start = model if kind == "split" else fj.parse_model(name)
            diagnosis = fj.diagnose(start, recording)
            rows.append(
                {
                    "kind": kind,
                    "model": name,
                    "seed": seed,
                    "verdict": diagnosis.verdict,
                    "effects": " and ".join(e.name for e in diagnosis.effects),
                    "p_value": rounded(diagnosis.p_value),
                    "axis": diagnosis.axes[0].axis,
                    "best": diagnosis.candidates[0].name,
                    "floor_um": rounded(diagnosis.noise.sigma),
                    "floor_from": diagnosis.noise.method,
                    "rmse_um": rounded(diagnosis.base.scores.rmse),
                }
            )
            print(*rows[-1].values(), flush=True)
    table("nulls", rows)


if __name__ == "__main__":
    main()
