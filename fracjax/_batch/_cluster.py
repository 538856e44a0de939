"""Rows from the workers of a dask cluster."""

from __future__ import annotations

import pickle
import socket
from collections.abc import Hashable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from itertools import islice
from queue import Empty, Queue
from typing import TYPE_CHECKING, Any

from .._recording import InputError
from ._jobs import Job
from ._rows import Row, Rows, Work, lost_row, rows_of

if TYPE_CHECKING:
    from distributed import Client, Future

_SECONDS = 10
"""Longest time [s] to wait for an answer from the scheduler or a worker; chosen by judgement."""
_PATIENCE = 60
"""Longest time [s] without a finished task before a missing worker is an error; by judgement."""
_RETRIES = 3
"""How often dask repeats a task that raised an error; chosen by judgement."""


def on_cluster(address: str, jobs: list[Job], work: Work) -> Rows:
    """Rows in the order in which they are finished, from workers that read the files themselves.

    Workers may join and leave.

    Raises:
        InputError: Dask is not installed, the scheduler or the workers cannot be reached, or the
            workers cannot do the work.
    """
    where = f"--cluster {address}"
    with _client(address, where) as client:
        try:
            yield from _rows_from(client, where, jobs, work)
        except (CancelledError, OSError):
            raise InputError.at(
                where,
                "a scheduler that keeps running",
                "that the connection to it was lost",
                "start it and run the same call again; finished rows are kept",
            ) from None


def _rows_from(client: Client, where: str, jobs: list[Job], work: Work) -> Rows:
    """Rows of all tasks; a task whose worker dies is given to another worker.

    A task that has cost several workers, or whose result was lost with its worker, is divided.  Its
    recordings are then tried one after the other, and one that still costs workers becomes a row
    with that reason.
    """
    import cloudpickle
    from distributed import KilledWorker

    tasks = (jobs[at : at + work.task] for at in range(0, len(jobs), work.task))
    running: dict[Hashable, list[Job]] = {}
    suspects: list[Job] = []
    on_trial: set[Hashable] = set()
    done: Queue[Future] = Queue()

    def submit(task: list[Job]) -> Hashable:
        call = cloudpickle.dumps(_Call(task, work))
        future = client.submit(pickle.loads, call, pure=False, retries=_RETRIES)
        running[future.key] = task
        future.add_done_callback(done.put)
        return future.key

    def refill() -> None:
        # Twice as many as run at once: no worker waits, and few tasks are in memory.
        for task in islice(tasks, max(2 * max(_threads(client), 1) - len(running), 0)):
            submit(task)
        # One at a time: of two suspects on one worker, either may have ended it.
        if suspects and not on_trial:
            on_trial.add(submit([suspects.pop(0)]))

    refill()
    while running:
        try:
            future = done.get(timeout=_PATIENCE)
        except Empty:
            if not _threads(client):
                raise _without_worker(where) from None
            continue
        task = running.pop(future.key)
        on_trial.discard(future.key)
        try:
            rows, error = _outcome(future)
        except TimeoutError:
            suspects.extend(task)
            refill()
            continue
        if error is None:
            yield rows
        elif not isinstance(error, KilledWorker):
            raise InputError.at(
                where,
                "workers with the same fracjax, and all that the model needs",
                f"{type(error).__name__}: {' '.join(str(error).split())}",
                "install them there",
            )
        elif len(task) > 1:
            suspects.extend(task)
        else:
            yield [lost_row(task[0], work, "every worker that fitted it died.")]
        refill()


def _outcome(future: Future) -> tuple[list[Row], BaseException | None]:
    """The rows of a finished task and its error, if any; TimeoutError if its worker has left."""
    if future.status == "lost":  # waiting would take until another worker joins, perhaps for ever
        raise TimeoutError
    error: Any = future.exception(timeout=_SECONDS)  # a coroutine only with asynchronous clients
    return (future.result(timeout=_SECONDS) if error is None else []), error


class _Call:
    """A task on its way to a worker: unpickling it runs it.

    Dask unpickles what it receives on arrival, and a worker that cannot do so ends.  Therefore dask
    is given bytes, which the task itself unpickles; what a worker lacks is then an ordinary error.
    """

    def __init__(self, jobs: list[Job], work: Work):
        self.jobs, self.work = jobs, work

    def __reduce__(self) -> tuple:
        return rows_of, (self.jobs, self.work)


def _threads(client: Client) -> int:
    """How many tasks the workers run at once."""
    threads: Any = client.nthreads()  # a coroutine only with asynchronous clients
    return sum(threads.values())


def _without_worker(where: str) -> InputError:
    """The error that no worker is there."""
    remedy = (
        "start one by `dask worker ADDRESS` and run the same call again; finished rows are kept"
    )
    return InputError.at(where, "a worker", "none", remedy)


@contextmanager
def _client(address: str, where: str) -> Iterator[Client]:
    """A connection to a scheduler that has a worker."""
    try:
        from distributed import Client
        from distributed.comm.addressing import get_address_host_port
    except ImportError:
        raise InputError.at(
            "--cluster",
            "the package dask",
            "that it is not installed",
            'run pip install "fracjax[cluster]"',
        ) from None
    try:
        # Tried first: a Client without a connection reports an error again when it is deleted.
        socket.create_connection(get_address_host_port(address), _SECONDS).close()
        client = Client(address, timeout=_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError.at(
            where,
            "a dask scheduler, such as tcp://host:8786",
            (getattr(error, "strerror", None) or str(error)).lower(),
            "start it, or correct the address",
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=_SECONDS)
        except TimeoutError:
            raise _without_worker(where) from None
        yield client
