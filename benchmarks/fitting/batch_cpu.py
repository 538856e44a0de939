"""How much CPU time a recording of a batch takes, beside SciPy, whatever else the machine does.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python -m benchmarks.fitting.batch_cpu

Stacks of recordings, as a batch's processes fit them, and SciPy's fits from one start take turns in
one process, and the least CPU time per recording of each counts: unlike paces by the clock
(`batch.py`), of which the start of processes is a part, it holds on a busy machine.  No two stacks
in a row have a drive in common, unless all have one.  Linear algebra is on one thread, as in a
batch's processes.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from itertools import cycle, product
from pathlib import Path

from benchmarks.fitting.batch import PACKAGES, STARTS, fit_file_by_scipy, write_recordings
from benchmarks.fitting.laws import LAWS
from benchmarks.fitting.tables import HERE, Table
from fracjax import Recording, read
from fracjax._batch._jobs import File, Held
from fracjax._batch._rows import Work, rows_of

STACK, STACKS, BY_SCIPY = 64, 3, 16
COLUMNS = ("model", "drive", "samples", "rounds", "files_ms", "memory_ms", "scipy_ms", "over_files",
           "over_memory")  # fmt: skip


def milliseconds(run: Callable[[], object], recordings: int) -> float:
    """CPU time per recording [ms]."""
    began = time.process_time()
    run()
    return 1e3 * (time.process_time() - began) / recordings


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
    times: dict[str, list[float]] = {"files_ms": [], "memory_ms": [], "scipy_ms": []}
    order = cycle(stacks)
    for _ in range(rounds):
        some = [File(file) for file in next(order)]
        times["files_ms"].append(milliseconds(lambda some=some: rows_of(some, work), STACK))
        for_scipy = next(order)
        held = [Held(anew(read(file))) for file in for_scipy]
        times["memory_ms"].append(milliseconds(lambda held=held: rows_of(held, work), STACK))
        some = for_scipy[:BY_SCIPY]
        times["scipy_ms"].append(
            milliseconds(
                lambda some=some: [fit_file_by_scipy(each, 1, LAWS[model]) for each in some],
                BY_SCIPY,
            )
        )
    least = {name: min(values) for name, values in times.items()}
    ratios = {"over_files": "files_ms", "over_memory": "memory_ms"}
    return {
        "model": model,
        "drive": kind,
        "samples": str(samples),
        "rounds": str(rounds),
        **{name: f"{value:.3g}" for name, value in least.items()},
        **{name: f"{least['scipy_ms'] / least[own]:.3g}" for name, own in ratios.items()},
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
