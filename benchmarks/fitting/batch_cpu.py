"""How much CPU time a recording of a batch takes, beside SciPy, whatever else the machine does.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python -m benchmarks.fitting.batch_cpu

Stacks of recordings, as a batch's processes fit them, and SciPy's fits from one start take turns in
one process, and the least CPU time per recording of each counts: unlike paces by the clock
(`batch.py`), of which the start of processes is a part, it holds on a busy machine.  SciPy fits at
the recording's own steps, and (`finely`) with steps halved until its RMSE falls by less than 1 %,
as fracjax does; `worse` is the share of its fits whose RMSE is more than 1 % above fracjax's.  No
two stacks in a row have a drive in common, unless all have one.  Linear algebra is on one thread,
as in a batch's processes.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from functools import partial
from itertools import cycle, product
from pathlib import Path
from typing import TypeVar

import numpy as np

from benchmarks.fitting.batch import PACKAGES, STARTS, fit_file_by_scipy, write_recordings
from benchmarks.fitting.laws import LAWS
from benchmarks.fitting.tables import HERE, Table
from fracjax import Recording, read
from fracjax._batch._jobs import File, Held
from fracjax._batch._rows import Work, rows_of

STACK, STACKS, BY_SCIPY = 64, 3, 16
TIMES = ("files_ms", "memory_ms", "scipy_ms", "scipy_finely_ms")
COLUMNS = ("model", "drive", "samples", "rounds", *TIMES, "over_files", "over_memory",
           "finely_over_files", "scipy_worse", "scipy_finely_worse")  # fmt: skip

_Result = TypeVar("_Result")


def timed(run: Callable[[], list[_Result]]) -> tuple[float, list[_Result]]:
    """CPU time per result [ms], and the results."""
    began = time.process_time()
    results = run()
    return 1e3 * (time.process_time() - began) / len(results), results


def anew(recording: Recording) -> Recording:
    """The recording without what it has kept."""
    return recording.window(0, len(recording))


def compare(model: str, kind: str, samples: int, rounds: int, folder: Path) -> dict[str, str]:
    """The row of one model, kind of drive and length."""
    folder.mkdir()
    files = write_recordings(folder, STACK * STACKS, samples, kind == "one", LAWS[model])
    stacks = [files[at : at + STACK] for at in range(0, len(files), STACK)]
    work = Work(model, None, None, STARTS, 0)
    rows_of([File(file) for file in files[:STACK]], work)

    def by_scipy(some: list[Path], finely: bool) -> list[tuple[float, float]]:
        return [fit_file_by_scipy(file, 1, LAWS[model], finely) for file in some]

    times: dict[str, list[float]] = {name: [] for name in TIMES}
    worse: dict[str, list[bool]] = {"scipy_worse": [], "scipy_finely_worse": []}
    order = cycle(stacks)
    for _ in range(rounds):
        jobs = [File(file) for file in next(order)]
        taken, _ = timed(partial(rows_of, jobs, work))
        times["files_ms"].append(taken)
        for_scipy = next(order)
        held = [Held(anew(read(file))) for file in for_scipy]
        taken, rows = timed(partial(rows_of, held, work))
        times["memory_ms"].append(taken)
        some = for_scipy[:BY_SCIPY]
        for finely, name in enumerate(("scipy", "scipy_finely")):
            taken, ends = timed(partial(by_scipy, some, bool(finely)))
            times[f"{name}_ms"].append(taken)
            worse[f"{name}_worse"] += [
                rmse > 1.01 * row["rmse"] for (rmse, _), row in zip(ends, rows, strict=False)
            ]
    least = {name: min(values) for name, values in times.items()}
    ratios = {
        "over_files": least["scipy_ms"] / least["files_ms"],
        "over_memory": least["scipy_ms"] / least["memory_ms"],
        "finely_over_files": least["scipy_finely_ms"] / least["files_ms"],
    }
    shares = {name: float(np.mean(values)) for name, values in worse.items()}
    return {
        "model": model,
        "drive": kind,
        "samples": str(samples),
        "rounds": str(rounds),
        **{name: f"{value:.3g}" for name, value in (least | ratios).items()},
        **{name: f"{value:.2f}" for name, value in shares.items()},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--models", nargs="+", choices=LAWS, default=[*LAWS])
    parser.add_argument("--samples", type=int, nargs="+", default=[500, 5000])
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--out", type=Path, default=HERE / "batch_cpu.csv")
    options = parser.parse_args()
    table = Table(options.out, COLUMNS, ("model", "drive", "samples"), PACKAGES)
    with tempfile.TemporaryDirectory() as folder:
        cases = product(options.models, options.samples, ("own", "one"))
        for at, (model, samples, kind) in enumerate(cases):
            if (model, kind, str(samples)) not in table.done():
                place = Path(folder) / f"{at}"
                table.add([compare(model, kind, samples, options.rounds, place)])


if __name__ == "__main__":
    main()
