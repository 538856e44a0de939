"""Many recordings, each fitted by itself, into one table that survives being interrupted.

On one machine every core takes a recording and runs `fit` on it: of many recordings in a process of
its own, for most of a short fit is Python, whose lock lets one thread through.  All recordings of
one structure (model, length bucket, oversampling, history) run one compiled program, that of `fit`,
so that their results are its results to the last bit.  What recordings of one drive share, `fit`
keeps: the signals that span the model's responses, and their factorisation.  Mapping the program
over recordings by `lax.map` with a batch size was tried instead: with two cores busy it was no
faster at 2,000 samples, took twice as long to compile, and took another path from each start.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing
from pathlib import Path
from typing import Any, Unpack

import pandas as pd

from .._fit import Loss
from .._models import Model
from .._prepare import HistoryOption, Mask, ModelOptions, history_of, require_whole_number
from .._recording import parse_quantity
from ._cluster import on_cluster
from ._jobs import Given, Job, jobs_of
from ._parts import Parts
from ._processes import Unfit, in_processes
from ._rows import Row, Rows, Work, row_of

FITS = "fits.parquet"
_MANY = 96
"""From here on processes pay: they take as long to start as threads lose on so many fits of FOH to
5,000 samples (measured; .32 s a fit on two threads, .12 s on two processes)."""
_PATIENCE = 30.0
"""Longest time [s] for which finished rows wait to be written: what a kill may cost."""

Count = Callable[[int, int], None]


def silent(done: int, total: int) -> None:
    """Report no progress."""


def fit_batch(
    model: Model | str,
    recordings: Given | Iterable[Given],
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
    **asked: Unpack[ModelOptions],
) -> pd.DataFrame:
    """Fit a model to each of many recordings, as `fit` does to one.

    **Arguments:** `model`, or its name, then made for each recording's own size; `recordings`, in
    memory or as files, folders (searched for files with the suffix of a recording) and patterns
    such as "data/**/*.csv"; `out`, a folder for the table; `cluster`, the address of a dask
    scheduler whose workers see the same files; `read_options`, those of `read`; `history`, `mask`,
    `loss`, `starts`, `seed`, and of parameters `fixed`, `bounds`, `priors` and `tied` as in `fit`;
    `settling`, samples or a time such as "1 s"; `chunk`, rows that make a file of the table;
    `progress`, told how many of how many are done.

    **Returns:** one row per recording, in the order given.  `status` is "fitted", "not converged",
    "unreadable" or "failed", and `reason` says why; a parameter p has the columns p.value,
    p.standard_error, p.low, p.high, p.unit, p.identified and p.at_bound.

    The table stands in `out`/fits.parquet as a Parquet dataset, to which finished chunks are added
    whole.  The same call again fits what is missing, was changed, or could not be read or fitted.
    One call at a time may write to a folder.

    **Raises:** `InputError` for an unknown model or parameter, for paths that lead to no file, for
    an `out` with rows of other settings, and for a cluster that cannot be reached.
    """
    for given, name, least in ((starts, "starts", 1), (seed, "seed", 0), (chunk, "chunk", 1)):
        require_whole_number(given, name, least)
    history_of(history)
    if isinstance(settling, str):
        parse_quantity(settling, "s", "--settle")
    wishes = {**asked, "mask": mask, "loss": loss if loss != "least_squares" else None}
    told = {name: wish for name, wish in wishes.items() if wish}
    work = Work(model, history, settling, starts, seed, read_options or {}, told)
    parts = Parts(Path(out) / FITS, work.table_schema())
    jobs = jobs_of(recordings, parts.folder)
    parts.check()
    missing = parts.missing(jobs)
    done = len(jobs) - len(missing)
    progress(done, len(jobs))
    rows: list[Row] = []
    written = time.monotonic()
    found = on_cluster(cluster, missing, work) if cluster else on_this_machine(missing, work)
    try:
        with closing(found):
            for some in found:
                rows += some
                done += len(some)
                progress(done, len(jobs))
                if len(rows) >= chunk or time.monotonic() - written > _PATIENCE:
                    parts.write(rows)
                    rows, written = [], time.monotonic()
    finally:
        if rows:
            parts.write(rows)
    return parts.table(jobs)


def on_this_machine(jobs: list[Job], work: Work) -> Rows:
    """Rows in the order in which they are done: of many recordings from processes, which take
    seconds to start, of few from threads, and from threads where processes cannot do the work."""
    cores = os.cpu_count() or 1
    if len(jobs) >= _MANY and cores > 1:
        try:
            yield from in_processes(jobs, work, cores)
            return
        except Unfit:
            pass
    yield from in_threads(jobs, work)


def in_threads(jobs: list[Job], work: Work) -> Rows:
    """Rows in the order in which they are done, from as many threads as there are cores.

    Compiled programs run without the interpreter's lock; threads that meet a new one compile it
    once.
    """
    threads = os.cpu_count() or 1
    pool = ThreadPoolExecutor(threads)
    pending: set[Future[Row]] = set()
    try:
        for job in jobs:
            pending.add(pool.submit(row_of, job, work))
            if len(pending) == 2 * threads:
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                yield [future.result() for future in done]
        yield [future.result() for future in pending]
    finally:
        # After an interrupt nobody waits for the fits that are under way.
        pool.shutdown(wait=False, cancel_futures=True)
