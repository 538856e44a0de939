"""Rows from other processes of this machine.

They are started anew instead of forked, because JAX's threads do not survive a fork, and without
`multiprocessing`, which would run the caller's script again in each of them.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from queue import SimpleQueue
from threading import Thread

import jax

from ._jobs import Job
from ._rows import Row, Work, lost_row
from ._waiting import Waiting

_START = "from fracjax._batch._worker import serve; serve()"
_JAX_SETTINGS = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_logging_level",
)
"""JAX's settings that the processes share with the caller."""


class Processes:
    """Processes that take recordings from a list which others may take from too.

    A recording whose process dies becomes a row with that reason; the other recordings of its task
    are fitted again.  What no process can load, such as a model from the caller's own script, stays
    in the list.  Nothing runs before `start`, and nothing after `close`.
    """

    def __init__(self, jobs: Waiting, work: Work):
        self._jobs, self._work = jobs, work
        self._rows: SimpleQueue[list[Row] | None] = SimpleQueue()
        self._workers: list[_Worker] = []
        self._threads: list[Thread] = []
        self._running = 0
        self.started = False

    def start(self, count: int, size: int) -> None:
        """Start so many processes, of which each takes at most `size` recordings at once."""
        self.started = True
        self._workers = [_Worker(self._work) for _ in range(count)]
        self._threads = [
            Thread(target=self._feed, args=(worker, size), daemon=True) for worker in self._workers
        ]
        self._running = count
        for thread in self._threads:
            thread.start()

    def finished(self) -> Iterator[list[Row]]:
        """The rows that are there."""
        while not self._rows.empty():
            yield from self._next()

    def rest(self) -> Iterator[list[Row]]:
        """Rows as they are finished, until no process takes another recording.

        Processes that are still starting are not waited for where nothing is left for them.
        """
        for worker in self._workers:
            if not (worker.ready or self._jobs):
                worker.end()
        while self._running:
            yield from self._next()

    def close(self) -> None:
        """End the processes; what they had begun is lost."""
        self._jobs.clear()
        for worker in self._workers:
            worker.end()
        for thread in self._threads:
            thread.join()
        for worker in self._workers:
            worker.close()

    def _next(self) -> Iterator[list[Row]]:
        """The next rows, unless a process has ended instead."""
        rows = self._rows.get()
        if rows is None:
            self._running -= 1
        else:
            yield rows

    def _feed(self, worker: _Worker, size: int) -> None:
        """Give recordings to one process until none remain, then put None."""
        try:
            with suppress(_CannotStart):
                worker.confirm()
                while task := self._jobs.take(size):
                    self._rows.put(_rows_of(worker, task, self._work))
        finally:
            self._rows.put(None)


class _CannotStart(Exception):
    """The process cannot load the work."""


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
    except _CannotStart:
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
        self.work, self.ready, self.ended = work, False, False
        self.start()

    def start(self) -> None:
        """Start a process."""
        self.process = subprocess.Popen(
            [sys.executable, "-c", _START],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # a fit's messages are in its row
            env=_environment(),
            start_new_session=True,  # interrupts are handled by the caller's process
        )

    def confirm(self) -> None:
        """Send the process its work and wait until it is loaded; _CannotStart if it cannot be."""
        try:
            self._send(sys.path)
            self._send(self.work)
            self.rows(None)
            self.ready = True
        except (EOFError, OSError, AttributeError, TypeError, pickle.PicklingError) as error:
            raise _CannotStart from error

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
