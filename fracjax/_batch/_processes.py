"""Rows from processes of this machine, one for every core.

A fit of a few thousand samples spends its time in Python, whose lock lets only one thread run: two
threads were no faster than one.  The processes are started anew instead of forked, because JAX's
threads do not survive a fork, and without `multiprocessing`, which would run the caller's script
again in each of them.
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

_START = "from fracjax._batch._worker import serve; serve()"
_JAX_SETTINGS = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_logging_level",
)
"""JAX's settings that the processes share with the caller."""


class CannotStart(Exception):
    """No process can load the work, such as a model from the caller's own script."""


def in_processes(jobs: list[Job], work: Work, count: int, size: int) -> Rows:
    """Rows in the order in which they are finished, from `count` processes, `size` at a time.

    A recording whose process dies becomes a row with that reason; the other recordings of its task
    are fitted again.

    Raises:
        CannotStart: The processes cannot do the work; no recording was fitted.
    """
    workers = [_Worker(work) for _ in range(count)]
    tasks = iter([jobs[at : at + size] for at in range(0, len(jobs), size)])
    row_queue: Queue[list[Row] | None] = Queue()
    lock = Lock()

    def feed(worker: _Worker) -> None:
        """Give tasks to one worker until none remain, then put None."""
        while True:
            with lock:
                task = next(tasks, None)
            if task is None:
                break
            row_queue.put(_rows_of(worker, task, work))
        row_queue.put(None)

    threads: list[Thread] = []
    try:
        for worker in workers:
            worker.confirm()
        threads += [Thread(target=feed, args=(worker,), daemon=True) for worker in workers]
        for thread in threads:
            thread.start()
        yield from _until_all_have_ended(row_queue, count)
    finally:
        tasks = iter(())
        for worker in workers:
            worker.end()
        for thread in threads:
            thread.join()
        for worker in workers:
            worker.close()


def _until_all_have_ended(row_queue: Queue[list[Row] | None], count: int) -> Iterator[list[Row]]:
    """The rows in a queue, until `count` times None has come."""
    while count:
        rows = row_queue.get()
        if rows is None:
            count -= 1
        else:
            yield rows


def _rows_of(worker: _Worker, task: list[Job], work: Work) -> list[Row]:
    """The rows of a task; if its process dies, each recording is tried alone in a new one."""
    try:
        return worker.rows(task)
    except (EOFError, OSError, pickle.UnpicklingError):
        if worker.ended:
            return []
    worker.close()
    try:
        worker.start()
        worker.confirm()
    except CannotStart:
        return [
            lost_row(job, work, "its process died, and no new one could be started.")
            for job in task
        ]
    if len(task) == 1:
        return [lost_row(task[0], work, "the process that fitted it died.")]
    return [row for job in task for row in _rows_of(worker, [job], work)]


class _Worker:
    """A process and the pipes to it."""

    def __init__(self, work: Work):
        self.work, self.ended = work, False
        self.start()

    def start(self) -> None:
        """Start a process and send it the work."""
        self.process = subprocess.Popen(
            [sys.executable, "-c", _START],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # a fit's messages are in its row
            env=_environment(),
            start_new_session=True,  # interrupts are handled by the caller's process
        )
        try:
            self._send(sys.path)
            self._send(self.work)
        except (OSError, AttributeError, TypeError, pickle.PicklingError) as error:
            self.close()
            raise CannotStart from error

    def confirm(self) -> None:
        """Wait until the process has loaded the work; CannotStart if it cannot."""
        try:
            self.rows(None)
        except (EOFError, OSError) as error:
            raise CannotStart from error

    def rows(self, task: list[Job] | None) -> list[Row]:
        """The rows of a task; with None, the empty answer that confirms the work."""
        if task is not None:
            self._send(task)
        assert self.process.stdout is not None  # it is a pipe
        return pickle.load(self.process.stdout)

    def end(self) -> None:
        """Kill the process; whoever waits for an answer sees the end of the pipe."""
        self.ended = True
        self.process.kill()

    def close(self) -> None:
        """Kill the process, wait for its end, and close its pipes."""
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                with suppress(OSError):  # data that could not be sent
                    pipe.close()

    def _send(self, message: object) -> None:
        """Send an object, pickled."""
        content = pickle.dumps(message)
        assert self.process.stdin is not None  # it is a pipe
        self.process.stdin.write(content)
        self.process.stdin.flush()


def _environment() -> dict[str, str]:
    """The environment of a process: one core, and JAX's settings as in the caller."""
    jax_settings = {
        name.upper(): str(value) for name in _JAX_SETTINGS if (value := getattr(jax.config, name))
    }
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    paths = {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    return threads | dict(os.environ) | jax_settings | paths
