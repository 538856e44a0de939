"""What a batch survives: kills, a worker that dies, bad files; and whether its memory grows.

    python -m benchmarks.fitting.faults

Recordings are short creep loops (250 samples), unless said otherwise, so that the whole takes some
three minutes on two cores.  Five trials, one row each, with what was found beside what is wanted:

- the batch is killed (SIGKILL) ten times, each time at a random moment, then run to its end: no
  row is torn, none is there twice, and what was on disk at a kill is not done again; once with
  recordings fitted one by one, once with FOH recordings of `batch.py` fitted in stacks;
- two dask workers, one killed on the way: all rows arrive;
- fifty bad files of ten kinds among a thousand: fifty rows with reasons, the others are fitted;
- the peak of the driver's memory at a quarter, a half and all of the recordings.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from benchmarks.fitting.batch import write_recordings as write_foh_recordings
from benchmarks.fitting.tables import HERE, Table

STEP, SAMPLES = 0.01, 250
PACKAGES = ("fracjax", "jax", "jaxlib", "numpy", "pandas", "pyarrow", "distributed")
COLUMNS = ("trial", "recordings", "wanted", "found", "passed", "seconds")
ONE_BY_ONE, STACKED = ("creep", 2), ("foh", 4)
"""Models and numbers of starts: from few starts nothing is fitted in stacks."""


def write_recordings(folder: Path, count: int) -> None:
    """CSV files of a drive [V] that does not repeat and a response [um] that lags behind it."""
    folder.mkdir()
    times = STEP * np.arange(SAMPLES)
    for k in range(count):
        generator = np.random.default_rng(k)
        drive = 40 + 15 * np.sin(3.1 * times) + 10 * np.sin(8.3 * times + k)
        response = 0.1 * drive - 2e-3 * np.gradient(drive, STEP)
        response += generator.normal(0, 0.02, SAMPLES)
        save(folder / f"{k:05d}.csv", np.stack([times, drive, response], axis=1))


def save(path: Path, columns: np.ndarray) -> None:
    head = "time_s,voltage_V,displacement_um"
    np.savetxt(path, columns, "%.9g", ",", header=head, comments="")


def spoilt(path: Path, kind: int) -> None:
    """A file made useless in one of ten ways."""
    text = path.read_text(encoding="utf-8")
    head, *lines = text.splitlines()
    ways: list[Callable[[], str]] = [
        lambda: "",
        lambda: "\x00\x01\x02",
        lambda: "\n".join([head, *lines[:9]]),
        lambda: "\n".join([head, *lines[:50], "oops,1,2", *lines[51:]]),
        lambda: "\n".join([head, *lines[:50], *lines[90:]]),
        lambda: "\n".join([head, *lines[:50], lines[50] + ",7", *lines[51:]]),
        lambda: "\n".join([head.replace("_um", " [wibble]"), *lines]),
        lambda: "\n".join([head, *(f"{line.split(',')[0]},5,{k}" for k, line in enumerate(lines))]),
        lambda: "\n".join([head, *lines[:50], "nan,nan,nan", *lines[51:]]),
        lambda: "no numbers at all",
    ]
    path.write_text(ways[kind % len(ways)](), encoding="utf-8")


def batch(model: str, starts: int) -> None:
    """The batch of the present folder, in a process of its own."""
    from fracjax import fit_batch

    fit_batch(model, "data", out="results", starts=starts, chunk=8)


def rows_in(folder: Path) -> pd.DataFrame:
    """All that is on disk; a torn file would not be read."""
    parts = sorted((folder / "results" / "fits.parquet").glob("*.parquet"))
    tables = [pq.read_table(part).to_pandas() for part in parts]
    return pd.concat(tables) if tables else pd.DataFrame({"key": []})


# Trials -------------------------------------------------------------------------------------------


def killed(folder: Path, count: int, kills: int, way: tuple[str, int]) -> tuple[str, str]:
    if way == STACKED:
        (folder / "data").mkdir()
        write_foh_recordings(folder / "data", count, 5000, shared=False)
    else:
        write_recordings(folder / "data", count)
    moments = np.random.default_rng(0)
    twice, again, done, struck = 0, 0, set(), 0
    for _ in range(kills):
        child = start(folder, way)
        # Anywhere from the start of the interpreter to the middle of what is left.
        time.sleep(float(moments.uniform(0, 12)))
        child.send_signal(signal.SIGKILL)
        struck += child.wait() == -signal.SIGKILL
        rows = rows_in(folder)
        twice += int(rows["key"].duplicated().sum())
        again += len(done - set(rows["key"]))
        done = set(rows["key"])
    kept = rows_in(folder)
    assert start(folder, way).wait() == 0
    rows = rows_in(folder)
    parts = {part.name for part in (folder / "results" / "fits.parquet").iterdir()}
    torn = sum(not name.endswith(".parquet") for name in parts)
    again += len(set(kept["key"]) - set(rows["key"]))
    twice += int(rows["key"].duplicated().sum())
    fitted = int((rows["status"] == "fitted").sum())
    return (
        f"{count} fitted, 0 twice, 0 lost, 0 torn",
        f"{fitted} fitted, {twice} twice, {again} lost, {torn} torn",
    )


def start(folder: Path, way: tuple[str, int]) -> subprocess.Popen:
    call = f"from benchmarks.fitting.faults import batch; batch(*{way})"
    paths = os.pathsep.join([str(Path.cwd()), *filter(None, [os.environ.get("PYTHONPATH")])])
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen(
        [sys.executable, "-c", call], cwd=folder, env=os.environ | {"PYTHONPATH": paths}, **quiet
    )


def worker_killed(folder: Path, count: int) -> tuple[str, str]:
    from distributed import LocalCluster

    from fracjax import fit_batch

    write_recordings(folder / "data", count)
    struck = []
    with LocalCluster(
        n_workers=2, threads_per_worker=1, silence_logs=50, dashboard_address=None,
        local_directory=str(folder / "dask"),
    ) as cluster:  # fmt: skip
        first = next(iter(cluster.workers.values()))
        process = first.process.process  # type: ignore[union-attr]

        def strike(done: int, total: int) -> None:
            if done > total // 4 and not struck:
                struck.append(process.pid)
                os.kill(process.pid, signal.SIGKILL)

        rows = fit_batch(
            "creep", folder / "data", out=folder / "results", starts=2,
            cluster=cluster.scheduler_address, progress=strike,
        )  # fmt: skip
    fitted = int((rows["status"] == "fitted").sum())
    return f"1 killed, {count} fitted", f"{len(struck)} killed, {fitted} fitted"


def bad_files(folder: Path, count: int, bad: int) -> tuple[str, str]:
    from fracjax import fit_batch

    write_recordings(folder / "data", count)
    chosen = np.random.default_rng(1).choice(count, bad, replace=False)
    for kind, k in enumerate(chosen):
        spoilt(folder / "data" / f"{k:05d}.csv", kind)
    rows = fit_batch("creep", folder / "data", out=folder / "results", starts=2)
    # A drive that does not move can be read, but nothing can be fitted to it.
    useless = rows[rows["status"].isin(["unreadable", "failed"])]
    right = {Path(source).stem for source in useless["source"]} == {f"{k:05d}" for k in chosen}
    reasons = int((useless["reason"].str.len() > 0).sum())
    fitted = int((rows["status"] == "fitted").sum())
    return (
        f"{count - bad} fitted, {bad} rows with reasons, those that were spoilt: True",
        f"{fitted} fitted, {reasons} rows with reasons, those that were spoilt: {right}",
    )


def peak(folder: Path, count: int, queue: multiprocessing.Queue) -> None:
    """The driver's peak memory [MiB], in a process of its own: a peak never comes down again."""
    os.chdir(folder)
    from fracjax import fit_batch

    fit_batch("creep", sorted(Path("data").iterdir())[:count], out=f"of {count}", starts=2)
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    queue.put(size / (2**20 if sys.platform == "darwin" else 2**10))


def memory(folder: Path, count: int) -> tuple[str, str]:
    write_recordings(folder / "data", count)
    context = multiprocessing.get_context("spawn")
    peaks = []
    for some in (count // 4, count // 2, count):
        queue = context.Queue()
        child = context.Process(target=peak, args=(folder, some, queue))
        child.start()
        peaks.append(queue.get())
        child.join()
    told = ", ".join(f"{some:.0f}" for some in peaks)
    grown = peaks[-1] - peaks[0]
    return (
        "grows by less than 64 MiB: True",
        f"grows by less than 64 MiB: {grown < 64} ({told} MiB)",
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HERE / "faults.csv")
    parser.add_argument("--recordings", type=int, default=1000, help="Of the last two trials.")
    parser.add_argument("--bad", type=int, default=50)
    parser.add_argument("--killed", type=int, default=2000, help="Recordings of the first trial.")
    parser.add_argument("--kills", type=int, default=10)
    options = parser.parse_args()
    trials: dict[str, tuple[int, Callable[[Path], tuple[str, str]]]] = {
        f"killed {options.kills} times": (
            options.killed,
            lambda folder: killed(folder, options.killed, options.kills, ONE_BY_ONE),
        ),
        f"killed {options.kills} times, in stacks": (
            options.killed,
            lambda folder: killed(folder, options.killed, options.kills, STACKED),
        ),
        "one of two workers killed": (200, lambda folder: worker_killed(folder, 200)),
        f"{options.bad} bad files": (
            options.recordings,
            lambda folder: bad_files(folder, options.recordings, options.bad),
        ),
        "peak of memory": (options.recordings, lambda folder: memory(folder, options.recordings)),
    }
    table = Table(options.out, COLUMNS, ("trial", "recordings"), PACKAGES)
    for name, (count, trial) in trials.items():
        if (name, str(count)) in table.done():
            continue
        began = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            wanted, found = trial(Path(folder))
        passed = found.startswith(wanted)
        seconds = f"{time.perf_counter() - began:.0f}"
        values = (name, count, wanted, found, passed, seconds)
        table.add([dict(zip(COLUMNS, values, strict=True))])


if __name__ == "__main__":
    main()
