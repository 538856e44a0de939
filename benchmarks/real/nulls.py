"""Recordings with real noise and nothing missing: a diagnosis must say `none`.

    FRACJAX_DATA=DIR python -m benchmarks.real.nulls

The noise is that of piezo_dbo's sensor: its spectrum at the second file's two rests, lines near
58 and 99.8 Hz among it, with phases by lot, so that each null is another one.

- `lineless`: a model fitted to the steady cycles, and that noise without its lines; floor from
  repeats;
- `steady`: the same with the lines;
- `rest`: the same on a stretch of the second file's drive that holds a rest; floor from the rest;
- `split`: eight measured cycles in a row, against a model that is a table, the mean of all others.
  The table's own noise makes every score sqrt(1 + 8/30) = 1.13 times too large;
- `levelled`: the same, each of the eight rid of its own departure in offset, stroke and timing.
  These change from cycle to cycle, the timing as a saw-tooth: 0.08 ms earlier each cycle, and
  back by 0.8 ms every 13th.  A cycle that holds such a jump is no null; the eight avoid them.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.ndimage import median_filter
from scipy.signal import detrend, welch

import fracjax as fj
from benchmarks.real.recordings import attempt, piezo_dbo, rounded, table

STEP, PERIOD = 5e-3, 200  # s, samples
HELD = slice(3400, 6000)  # the second file's first rest, and what is before and after it
CASES = (
    ("lineless", "foh", 5),
    ("steady", "foh", 3),
    ("steady", "lfdh", 2),
    ("rest", "lfdh", 5),
    ("levelled", "table", 5),
    ("split", "table", 3),
)
LATE = 2  # cycles after which the loop is steady
BETWEEN_JUMPS = (13, 16, 26, 29, 14)  # first of eight cycles, counted from there


class MeanCycle(fj.AbstractBlock):
    """A cycle known by its samples, times a gain: y = g ȳ(t mod T)."""

    cycle: np.ndarray
    gain: fj.Parameter
    linear = False

    def __init__(self, cycle: np.ndarray):
        self.cycle, self.gain = cycle, fj.Parameter(1.0, gain=True)

    def __call__(self, drive: Array, grid: fj.Grid) -> Array:
        turns = jnp.arange(drive.shape[0]) * grid.step / (PERIOD * STEP)
        places = np.arange(PERIOD) / PERIOD
        return self.gain.value * jnp.interp(turns % 1, places, jnp.asarray(self.cycle), period=1.0)


def cycles_of(recording: fj.Recording) -> np.ndarray:
    """Whole cycles of the response (K, 200)."""
    count = len(recording) // PERIOD
    return recording.response[: count * PERIOD].reshape(count, PERIOD)


def spectrum_of(nested: fj.Recording) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and power density [um²/Hz] of the sensor's noise at both rests."""
    found = []
    for start, stop in nested.static_stretches(1.0):
        y = detrend(nested.response[start + (stop - start) // 10 : stop])
        found.append(welch(y, nested.rate, nperseg=400, detrend=False))
    return found[0][0], np.mean([power for _, power in found], axis=0)


def surrogate(
    spectrum: tuple[np.ndarray, np.ndarray], samples: int, generator: np.random.Generator
) -> np.ndarray:
    """Gaussian noise (samples,) of a spectrum, cut from a longer stretch that closes on itself."""
    frequencies = np.fft.rfftfreq(2 * samples, STEP)
    size = np.sqrt(np.interp(frequencies, *spectrum) * samples / STEP / 2)
    lines = size * (generator.standard_normal((2, size.size)) * [[1], [1j]]).sum(axis=0)
    lines[0] = 0.0
    return np.fft.irfft(lines, 2 * samples)[:samples]


def levelled(cycle: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """A cycle (200,) without its own departure from the mean in offset, stroke and timing."""
    ways = np.stack([np.ones(PERIOD), mean - mean.mean(), np.gradient(mean)], axis=1)
    return cycle - ways @ np.linalg.lstsq(ways, cycle - mean, rcond=None)[0]


def table_of(steady: fj.Recording, first: int, level: bool) -> tuple[fj.Model, fj.Recording]:
    """Eight cycles in a row, and the mean of all others as a model."""
    cycles = cycles_of(steady)[LATE:]
    drawn = cycles[first : first + 8]
    mean = np.delete(cycles, np.s_[first : first + 8], axis=0).mean(axis=0)
    if level:
        drawn = np.array([levelled(cycle, mean) for cycle in drawn])
    recording = fj.Recording(steady.drive[: drawn.size], drawn.ravel(), steady.dt)
    return fj.Model(MeanCycle(mean), "table"), recording


def main() -> None:
    steady, nested = piezo_dbo()
    truths = {
        name: fj.fit(fj.parse_model(name), steady, history="constant").model
        for name in ("foh", "lfdh")
    }
    spectrum = spectrum_of(nested)
    smooth = spectrum[0], median_filter(spectrum[1], 21)
    rows = []
    for kind, name, count in CASES:
        for seed in range(count):
            if name == "table":
                model, recording = table_of(steady, BETWEEN_JUMPS[seed], kind == "levelled")
            else:
                model = fj.parse_model(name)
                drive = nested.drive[HELD] if kind == "rest" else steady.drive[: 13 * PERIOD]
                response = fj.simulate(truths[name], drive, STEP).response
                colour = smooth if kind == "lineless" else spectrum
                noise = surrogate(colour, drive.size, np.random.default_rng(seed))
                recording = fj.Recording(drive, response + noise, STEP)
            diagnosis, stopped = attempt(model, recording)
            told = {"kind": kind, "model": name, "seed": seed}
            rows.append(told | (row(diagnosis) if diagnosis else {"verdict": stopped}))
            print(*rows[-1].values(), flush=True)
    table("nulls", rows)


def row(diagnosis: fj.Diagnosis) -> dict:
    frequency = next(axis for axis in diagnosis.axes if axis.axis == "frequency")
    bands = frequency.intervals if frequency.p_value < 0.01 else ()
    return {
        "verdict": diagnosis.verdict,
        "effects": " and ".join(e.name for e in diagnosis.effects),
        "p_value": rounded(diagnosis.p_value),
        "axis": diagnosis.axes[0].axis,
        "axis_p_value": rounded(diagnosis.axes[0].p_value),
        "best": diagnosis.candidates[0].name,
        "best_score": rounded(diagnosis.candidates[0].score),
        "floor_um": rounded(diagnosis.noise.sigma),
        "floor_from": diagnosis.noise.method,
        "rmse_um": rounded(diagnosis.base.scores.rmse),
        "frequency_bins_Hz": " ".join(f"{low:.3g}-{high:.3g}" for low, high in bands),
    }


if __name__ == "__main__":
    main()
