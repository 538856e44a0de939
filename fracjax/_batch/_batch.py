"""Many recordings, each fitted by itself, into one table that survives interruptions.

Recordings alike are fitted together, as stacks (`fit_all`), and the others one by one by `fit`,
which is a stack of one: both are one path of code.  Stacks are fitted in this process, and in a
further one for every other core as soon as the pace shows that these are worth their start; threads
would not do, because much of a short fit is Python code, whose lock lets only one of them run.  If
a stack fails, its recordings are fitted one by one, and a recording that cannot be fitted is a row
with its reason.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from .._fit import Loss
from .._models import Model
from .._prepare import HistoryOption, Mask, ModelOptions, history_of, require_whole_number
from .._recording import parse_quantity
from ._cluster import on_cluster
from ._jobs import Job, RecordingInput, jobs_of
from ._parts import Parts
from ._processes import Processes
from ._rows import Row, Rows, Work, rows_of
from ._waiting import Waiting

if TYPE_CHECKING:
    import pandas as pd

FITS = "fits.parquet"
_MANY = 96
"""Number of recordings fitted one by one from which processes are faster than threads: the time
that they take to start equals what threads lose on so many fits of FOH to 5,000 samples."""
_SMALLEST = 4
"""Recordings of the first stack, and the fewest however long they are: fewer would not share the
signals of a common drive.  Chosen by judgement."""
_WORTH_PROCESSES = 3.2
"""Expected time [s] for the rest, from which a process for each other core is worth its start of
1.6 s: what one more at best saves is half of it."""
_ANSWER = 1.0
"""Longest time [s] between two signs of progress, where the pace allows it."""
_PATIENCE = 30.0
"""Longest time [s] that finished rows wait to be written, and so the most that a killed run loses;
chosen by judgement."""

Count = Callable[[int, int], None]


def silent(done: int, total: int) -> None:
    """Report no progress."""


def fit_batch(
    model: Model | str,
    recordings: RecordingInput | Iterable[RecordingInput],
    *,
    out: str | os.PathLike[str],
    cluster: str | None = None,
    read_options: dict[str, Any] | None = None,
    history: HistoryOption | None = None,
    settling: int | str | None = None,
    mask: Mask = (),
    loss: Loss = "least_squares",
    starts: int = 4,
    seed: int = 0,
    chunk: int = 64,
    progress: Count = silent,
    **options: Unpack[ModelOptions],
) -> pd.DataFrame:
    """Fit a model to each of many recordings, as `fit` does to one.

    The table is stored in `out`/fits.parquet as a Parquet dataset, to which finished chunks are
    added as whole files.  The same call again fits only the recordings that are missing, were
    changed, or could not be read or fitted.  Only one call at a time may write to a folder.

    Args:
        model: The model, or its name; a name is made into a model for each recording's own size.
        recordings: Recordings in memory (drive and response (N,) in their units), files, folders
            (searched for files with the suffix of a recording), or patterns such as
            "data/**/*.csv".
        out: Folder for the table.
        cluster: Address of a dask scheduler whose workers see the same files; by default this
            machine's cores are used.
        read_options: Options of `read`, for files.
        history: Assumption on the prior history of the drive, as in `fit`.
        settling: Samples at the start that do not count, or a time such as "1 s".
        mask: Time intervals [s] whose samples do not count, as in `fit`.
        loss: Loss function, as in `fit`.
        starts: Number of starting points of each fit.
        seed: Seed of the random starting points.
        chunk: Number of rows in each file of the table.
        progress: Called with the number of finished recordings and of all.
        **options: `fixed`, `bounds`, `priors` and `tied`, as in `fit`.

    Returns:
        One row per recording, in the order given.  `status` is "fitted", "not converged",
        "unreadable" or "failed", and `reason` says why.  A parameter p has the columns p.value,
        p.standard_error, p.low, p.high (in p.unit), p.unit, p.identified and p.at_bound.  `stacked`
        says whether it was fitted together with others.

    Raises:
        InputError: The model or a parameter is unknown, a path leads to no file, `out` holds rows
            of other settings, or the cluster cannot be reached.
    """
    for value, name, least in ((starts, "starts", 1), (seed, "seed", 0), (chunk, "chunk", 1)):
        require_whole_number(value, name, least)
    history_of(history)
    if isinstance(settling, str):
        parse_quantity(settling, "s", "--settle")
    all_options = {**options, "mask": mask, "loss": loss if loss != "least_squares" else None}
    used_options = {name: wish for name, wish in all_options.items() if wish}
    work = Work(model, history, settling, starts, seed, read_options or {}, used_options)
    parts = Parts(Path(out) / FITS, work.table_schema())
    jobs = jobs_of(recordings, parts.folder)
    parts.check()
    missing = parts.missing(jobs)
    done = len(jobs) - len(missing)
    progress(done, len(jobs))
    rows: list[Row] = []
    last_write = time.monotonic()
    row_groups = on_cluster(cluster, missing, work) if cluster else on_this_machine(missing, work)
    try:
        with closing(row_groups):
            for group in row_groups:
                rows += group
                done += len(group)
                progress(done, len(jobs))
                if len(rows) >= chunk or time.monotonic() - last_write > _PATIENCE:
                    parts.write(rows)
                    rows, last_write = [], time.monotonic()
    finally:
        if rows:
            parts.write(rows)
    return parts.table(jobs)


def on_this_machine(jobs: list[Job], work: Work) -> Rows:
    """Rows in the order in which they are finished, from this process and from others."""
    waiting = Waiting(jobs, takers=_cores())
    with closing(Processes(waiting, work)) as processes:
        if work.is_stacked:
            yield from in_stacks(waiting, work, processes)
        else:
            yield from one_by_one(waiting, work, processes)


def in_stacks(waiting: Waiting, work: Work, processes: Processes) -> Rows:
    """Rows by stacks in this process, beside which others work where they are worth their start."""
    size, first = _SMALLEST, True
    while stack := waiting.take(size):
        began = time.monotonic()
        rows = rows_of(stack, work)
        each = (time.monotonic() - began) / len(stack)
        size = min(max(int(_ANSWER / each), _SMALLEST), work.task)
        # The first ones also load and compile what the others need.
        if not first and not processes.started and len(waiting) * each > _WORTH_PROCESSES:
            processes.start(_cores() - 1, size)
        first = False
        yield rows
        yield from processes.finished()
    yield from processes.rest()


def one_by_one(waiting: Waiting, work: Work, processes: Processes) -> Rows:
    """Rows by single fits: many in processes, few, and what no process can load, in threads."""
    if len(waiting) >= _MANY and _cores() > 1:
        processes.start(_cores(), work.task)
        yield from processes.rest()
    yield from in_threads(waiting, work)


def in_threads(waiting: Waiting, work: Work) -> Rows:
    """Rows in the order in which they are finished, from as many threads as there are cores.

    Compiled programs run without the interpreter's lock; a program that several threads need is
    compiled once.
    """
    threads = _cores()
    pool = ThreadPoolExecutor(threads)
    pending: set[Future[list[Row]]] = set()
    try:
        while job := waiting.take(1):
            pending.add(pool.submit(rows_of, job, work))
            if len(pending) == 2 * threads:
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                yield [row for future in done for row in future.result()]
        yield [row for future in pending for row in future.result()]
    finally:
        # After an interrupt, running fits are not waited for.
        pool.shutdown(wait=False, cancel_futures=True)


def _cores() -> int:
    """The cores of this machine."""
    return os.cpu_count() or 1
