"""How many recordings a second, and in how much memory: `fit_batch` beside SciPy on two processes.

    python -m benchmarks.fitting.batch --recordings 1000 --samples 5000

Files of fractional-order hysteresis (FOH), each with a drive of its own or all with one drive, are
fitted a tenth, and then all of them, on from where the first call ended: if the peak of the memory
grows with their number, it shows.  The peer is what one would write in an afternoon: gains
eliminated by `lstsq`, orders by `scipy.optimize.least_squares`, on two processes, from one start,
from one with steps halved until its RMSE falls by less than 1 % (as fracjax does), and from as many
starts as fracjax; paces are told as ratios to all three.  The recordings are made by the peer's own
quadrature with 8 steps per sample, which favours it a little: of short recordings a few have a
numerical error above their noise that the peer repeats.  Both ways read the files; a last run
has the recordings in memory.  The start of fracjax's second process counts, that of SciPy's two
does not.  `stacked` counts the rows that were fitted together, and `fit_apart` is the largest
distance of their parameters from those of `fit` alone, in standard errors, over some of them.  A
kind of drive that the table holds is done.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import sys
import tempfile
import time
from functools import partial
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from benchmarks.fitting.laws import LAWS, Law, fit_by_scipy, fit_finely_by_scipy, response_of
from benchmarks.fitting.tables import HERE, Table
from fracjax import Recording, fit, fit_batch, read

STEP = 2e-3  # s
FINER = 8
STARTS = 4
PACKAGES = ("fracjax", "jax", "jaxlib", "numpy", "scipy", "pandas", "pyarrow")
PEERS = {
    "over_one_start": ("1 start", {"count": 1}),
    "over_fine_steps": ("1 start, fine steps", {"count": 1, "finely": True}),
    "over_as_many_starts": (f"{STARTS} starts", {"count": STARTS}),
}
COLUMNS = ("drive", "samples", "method", "recordings", "per_second", *PEERS, "peak_MiB",
           "fitted", "stacked", "fit_apart", "alpha_apart", "fracjax_worse",
           "scipy_worse")  # fmt: skip
COMPARED = 200


# Recordings ---------------------------------------------------------------------------------------


def several_tones(times: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """A drive [V] of five frequencies [Hz] that no period of the record keeps."""
    frequencies = np.array([0.7, 1.9, 4.3, 8.9, 14.7]) * generator.uniform(0.9, 1.1, 5)
    phases = generator.uniform(0, 2 * np.pi, 5)
    return 50 + np.sin(2 * np.pi * np.outer(times, frequencies) + phases) @ [14, 10, 7, 5, 3]


class Made(NamedTuple):
    """Times [s], drive [V] and response [um] (N, 3), the law's shapes, the noise's RMS [um]."""

    columns: np.ndarray
    shapes: list[float]
    noise: float


def made(k: int, samples: int, shared: bool, law: Law) -> Made:
    """The k-th recording of a law, at random shapes and gains, with 0.1 % of noise."""
    times = np.arange((samples - 1) * FINER + 1) * STEP / FINER
    generator = np.random.default_rng(k)
    drive = several_tones(times, np.random.default_rng(0) if shared else generator)
    response, shapes = response_of(law, drive, STEP / FINER, generator)
    response = response[::FINER]
    noise = 1e-3 * np.ptp(response) * generator.standard_normal(samples)
    columns = np.stack([STEP * np.arange(samples), drive[::FINER], response + noise], axis=1)
    return Made(columns, shapes, float(np.sqrt(np.mean(noise**2))))


def write_recordings(
    folder: Path, count: int, samples: int, shared: bool, law: Law = LAWS["foh"]
) -> list[Path]:
    """CSV files of recordings."""
    files = [folder / f"{k:05d}.csv" for k in range(count)]
    for k, file in enumerate(files):
        columns = made(k, samples, shared, law).columns
        head = "time_s,voltage_V,displacement_um"
        np.savetxt(file, columns, "%.9g", ",", header=head, comments="")
    return files


# fracjax ------------------------------------------------------------------------------------------


def run_fracjax(files: list[Path], out: Path, stages: list[int], rows: Queue) -> None:
    """Recordings per second and the driver's peak memory after each stage; of the first two, with
    which programs are compiled, the time alone."""
    began = time.perf_counter()
    fit_batch("foh", files[:2], out=out, starts=STARTS)
    print(f"  fracjax, first two, with compilation: {time.perf_counter() - began:.1f} s")
    done = 2
    for stage in stages:
        began = time.perf_counter()
        table = fit_batch("foh", files[:stage], out=out, starts=STARTS)
        pace = (stage - done) / (time.perf_counter() - began)
        rows.put({"recordings": stage, "per_second": pace, "peak_MiB": peak()} | counts(table))
        done = stage
    recordings = [read(file) for file in files]
    began = time.perf_counter()
    table = fit_batch("foh", recordings, out=out.with_name("held"), starts=STARTS)
    pace = len(files) / (time.perf_counter() - began)
    apart = max(map(distance, recordings[:COMPARED], table.to_dict("records")))
    last = {"recordings": len(files), "per_second": pace, "fit_apart": f"{apart:.1g}"}
    rows.put(last | {"method": f"fracjax, {STARTS} starts, from memory"} | counts(table))


def peak() -> int:
    """The largest memory of this process so far [MiB]."""
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(used / (2**20 if sys.platform == "darwin" else 2**10))


def counts(table: pd.DataFrame) -> dict[str, int]:
    """How many recordings were fitted, and how many of them together with others."""
    return {
        "fitted": int((table["status"] == "fitted").sum()),
        "stacked": int(table["stacked"].sum()),
    }


def distance(recording: Recording, row: dict) -> float:
    """The largest distance of a row's parameters from those of `fit`, in standard errors."""
    alone = fit("foh", recording, starts=STARTS)
    return max(abs(row[f"{e.name}.value"] - e.value) / e.standard_error for e in alone.estimates)


# The peer -----------------------------------------------------------------------------------------


def fit_file_by_scipy(
    file: Path, count: int, law: Law = LAWS["foh"], finely: bool = False
) -> tuple[float, float]:
    """RMSE [um] and first shape of a law, of FOH the order alpha, from `count` starts; with
    `finely`, from one."""
    _, drive, response = np.loadtxt(file, delimiter=",", skiprows=1).T
    if finely:
        return fit_finely_by_scipy(law, drive, response, STEP)
    return fit_by_scipy(law, drive, response, STEP, count)


def run_scipy(files: list[Path], options: dict[str, Any]) -> tuple[float, np.ndarray]:
    """Recordings per second of two processes, and what each fit found."""
    one = partial(fit_file_by_scipy, **options)
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        pool.map(one, files[:2])
        began = time.perf_counter()
        found = pool.map(one, files, chunksize=1)
    return len(files) / (time.perf_counter() - began), np.array(found)


def compare(kind: str, count: int, samples: int, folder: Path) -> list[dict]:
    """One kind of drive: both ways, and whether they agree."""
    print(f"{count} recordings of {samples} samples, {kind} drive", flush=True)
    folder.mkdir()
    files = write_recordings(folder, count, samples, kind == "one")
    stages = sorted({max(count // 10, 3), count})
    # In a process of its own: a peak of memory never comes down again.
    out, context = folder / "results", multiprocessing.get_context("spawn")
    queue = context.Queue()
    child = context.Process(target=run_fracjax, args=(files, out, stages, queue))
    child.start()
    rows = [{"method": f"fracjax, {STARTS} starts"} | queue.get() for _ in [*stages, "memory"]]
    child.join()
    table = pd.read_parquet(out / "fits.parquet").sort_values("source")
    paces = {}
    for name, (how, options) in PEERS.items():
        paces[name], found = run_scipy(files, options)
        apart = np.abs(table["alpha.value"] - found[:, 1]) / table["alpha.standard_error"]
        rows.append(
            {
                "method": f"SciPy, two processes, {how}",
                "recordings": count,
                "per_second": paces[name],
                "alpha_apart": f"{np.median(apart):.2g}",
                "fracjax_worse": f"{np.mean(table['rmse'] > 1.01 * found[:, 0]):.3f}",
                "scipy_worse": f"{np.mean(found[:, 0] > 1.01 * table['rmse']):.3f}",
            }
        )
    blank = dict.fromkeys(COLUMNS, "") | {"drive": kind, "samples": samples}
    return [
        blank
        | row
        | {"per_second": f"{row['per_second']:.3g}"}
        | {name: f"{row['per_second'] / pace:.3g}" for name, pace in paces.items()}
        for row in rows
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=1000)
    parser.add_argument("--samples", type=int, default=5000)
    parser.add_argument("--out", type=Path, default=HERE / "batch.csv")
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    table = Table(options.out, COLUMNS, ("drive", "samples"), PACKAGES)
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("own", "one"):
            if (kind, str(options.samples)) not in table.done():
                table.add(compare(kind, options.recordings, options.samples, Path(folder) / kind))


if __name__ == "__main__":
    main()
