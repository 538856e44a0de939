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
from ._rows import Row, Rows, Work, lost_row, row_of

if TYPE_CHECKING:
    from distributed import Client, Future

_TASK = 8
"""Recordings per task: enough that the scheduler keeps up, few enough to spread and to lose."""
_SECONDS = 10
_PATIENCE = 60
"""How long [s] work may stand still for want of a worker."""
_RETRIES = 3


def on_cluster(address: str, jobs: list[Job], work: Work) -> Rows:
    """Rows in the order in which they are done; the workers read the files themselves.

    Workers may come and go.  **Raises:** `InputError` where dask is not installed, where scheduler
    or workers cannot be reached, and where the workers cannot do the work.
    """
    where = f"--cluster {address}"
    with _client(address, where) as client:
        try:
            yield from _rows_from(client, where, jobs, work)
        except (CancelledError, OSError):
            raise InputError.at(
                where,
                "a scheduler that stays",
                "that it went away",
                "start it and run the same again; what was finished is kept",
            ) from None


def _rows_from(client: Client, where: str, jobs: list[Job], work: Work) -> Rows:
    """A task whose worker dies is given to another.  One that has cost several workers, or whose
    result went with one, is taken apart; its recordings are tried one after the other, and the one
    that still costs workers becomes a row with that reason."""
    import cloudpickle
    from distributed import KilledWorker

    tasks = (jobs[at : at + _TASK] for at in range(0, len(jobs), _TASK))
    under_way: dict[Hashable, list[Job]] = {}
    suspects: list[Job] = []
    on_trial: set[Hashable] = set()
    done: Queue[Future] = Queue()

    def submit(task: list[Job]) -> Hashable:
        call = cloudpickle.dumps(_Call(task, work))
        future = client.submit(pickle.loads, call, pure=False, retries=_RETRIES)
        under_way[future.key] = task
        future.add_done_callback(done.put)
        return future.key

    def refill() -> None:
        # Twice what runs at once: no worker waits, and what is held here stays small.
        for task in islice(tasks, max(2 * max(_threads(client), 1) - len(under_way), 0)):
            submit(task)
        # One at a time: two suspects on one worker would be taken for each other.
        if suspects and not on_trial:
            on_trial.add(submit([suspects.pop(0)]))

    refill()
    while under_way:
        try:
            future = done.get(timeout=_PATIENCE)
        except Empty:
            if not _threads(client):
                raise _without_worker(where) from None
            continue
        task = under_way.pop(future.key)
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
                "install it there",
            )
        elif len(task) > 1:
            suspects.extend(task)
        else:
            yield [lost_row(task[0], work, "every worker that took it died.")]
        refill()


def _outcome(future: Future) -> tuple[list[Row], BaseException | None]:
    """What a task came to, which a worker still holds; `TimeoutError` where that worker left."""
    if future.status == "lost":  # to wait for it is to wait for a worker that may never come
        raise TimeoutError
    error: Any = future.exception(timeout=_SECONDS)  # a coroutine only of asynchronous clients
    return (future.result(timeout=_SECONDS) if error is None else []), error


class _Call:
    """A task in transit: to unpickle it is to do it.

    Dask unpickles what it is given on arrival, and a worker that cannot goes down.  So it is given
    bytes; the task itself unpickles them, and what a worker lacks is an error like any other.
    """

    def __init__(self, jobs: list[Job], work: Work):
        self.jobs, self.work = jobs, work

    def __reduce__(self) -> tuple:
        return _rows_of, (self.jobs, self.work)


def _rows_of(jobs: list[Job], work: Work) -> list[Row]:
    return [row_of(job, work) for job in jobs]


def _threads(client: Client) -> int:
    """How many tasks the workers run at once."""
    threads: Any = client.nthreads()  # a coroutine only of asynchronous clients
    return sum(threads.values())


def _without_worker(where: str) -> InputError:
    remedy = "start one by dask worker ADDRESS and run the same again; what was finished is kept"
    return InputError.at(where, "a worker", "none", remedy)


@contextmanager
def _client(address: str, where: str) -> Iterator[Client]:
    """A connection to a scheduler that has a worker."""
    try:
        from distributed import Client
        from distributed.comm.addressing import get_address_host_port
    except ImportError:
        raise InputError.at(
            "--cluster", "dask", "that it is missing", 'run pip install "fracjax[cluster]"'
        ) from None
    try:
        # Tried first: a Client that finds nobody complains once more when it is collected.
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
