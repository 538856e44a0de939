"""Rows from processes of this machine, one for every core.

A fit of a few thousand samples spends its time in Python, whose lock lets one thread through: two
threads were no faster than one.  Workers are started anew, not forked, for JAX's threads do not
survive a fork; and not by `multiprocessing`, which runs the caller's script again in each of them.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from queue import Queue
from threading import Lock, Thread

import jax

from ._jobs import Job
from ._rows import Row, Rows, Work, lost_row

_TASK = 4
"""Recordings sent at once: so many are lost, and done again one by one, when a process dies."""
_START = "from fracjax._batch._worker import serve; serve()"
_KEPT = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_logging_level",
)


class Unfit(Exception):
    """No process can be started that understands the work: a model of the caller's own script."""


def in_processes(jobs: list[Job], work: Work, count: int) -> Rows:
    """Rows in the order in which they are done, from `count` processes.

    A recording whose process dies becomes a row with that reason, others of its task are done
    again.  **Raises:** `Unfit`, before anything is done.
    """
    workers = [_Worker(work) for _ in range(count)]
    tasks = iter([jobs[at : at + _TASK] for at in range(0, len(jobs), _TASK)])
    found: Queue[list[Row] | None] = Queue()
    lock = Lock()

    def serve(worker: _Worker) -> None:
        while True:
            with lock:
                task = next(tasks, None)
            if task is None:
                break
            found.put(_rows_of(worker, task, work))
        found.put(None)

    threads: list[Thread] = []
    try:
        for worker in workers:
            worker.understood()
        threads += [Thread(target=serve, args=(worker,), daemon=True) for worker in workers]
        for thread in threads:
            thread.start()
        yield from _until_all_ended(found, count)
    finally:
        tasks = iter(())
        for worker in workers:
            worker.end()
        for thread in threads:
            thread.join()
        for worker in workers:
            worker.close()


def _until_all_ended(found: Queue[list[Row] | None], count: int) -> Iterator[list[Row]]:
    while count:
        rows = found.get()
        if rows is None:
            count -= 1
        else:
            yield rows


def _rows_of(worker: _Worker, task: list[Job], work: Work) -> list[Row]:
    try:
        return worker.rows(task)
    except (EOFError, OSError, pickle.UnpicklingError):
        if worker.ended:
            return []
    worker.close()
    try:
        worker.start()
        worker.understood()
    except Unfit:
        return [lost_row(job, work, "its process died, and none took its place.") for job in task]
    if len(task) == 1:
        return [lost_row(task[0], work, "the process that fitted it died.")]
    return [row for job in task for row in _rows_of(worker, [job], work)]


class _Worker:
    """A process, and the pipes to it."""

    def __init__(self, work: Work):
        self.work, self.ended = work, False
        self.start()

    def start(self) -> None:
        """A process that is told what is to be done."""
        self.process = subprocess.Popen(
            [sys.executable, "-c", _START],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # what a fit has to say stands in its row
            env=_environment(),
            start_new_session=True,  # an interrupt is the driver's to deal with
        )
        try:
            self._send(sys.path)
            self._send(self.work)
        except (OSError, AttributeError, TypeError, pickle.PicklingError) as error:
            self.close()
            raise Unfit from error

    def understood(self) -> None:
        try:
            self.rows(None)
        except (EOFError, OSError) as error:
            raise Unfit from error

    def rows(self, task: list[Job] | None) -> list[Row]:
        """The rows of a task; of none, the empty answer to the work itself."""
        if task is not None:
            self._send(task)
        assert self.process.stdout is not None  # it is a pipe
        return pickle.load(self.process.stdout)

    def end(self) -> None:
        """No more: who waits for an answer is told so by the end of the pipe."""
        self.ended = True
        self.process.kill()

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                with suppress(OSError):  # what was never sent
                    pipe.close()

    def _send(self, what: object) -> None:
        content = pickle.dumps(what)
        assert self.process.stdin is not None  # it is a pipe
        self.process.stdin.write(content)
        self.process.stdin.flush()


def _environment() -> dict[str, str]:
    """One core for each process, and JAX as the driver has it."""
    told = {name.upper(): str(value) for name in _KEPT if (value := getattr(jax.config, name))}
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    paths = {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    return single | dict(os.environ) | told | paths
