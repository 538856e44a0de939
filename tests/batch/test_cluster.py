"""Fits by the workers of a Dask cluster, and workers that die."""

import os
import signal
import sys
import time
import types
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cloudpickle
import pandas as pd
import pytest
from distributed import Client, LocalCluster, WorkerPlugin

import fracjax as fj
import fracjax._batch._rows
from fracjax._batch import FITS
from fracjax._batch._cluster import on_cluster
from fracjax._batch._jobs import File
from fracjax._batch._rows import Work
from tests.batch.helpers import OUT, batch, cheap_model, recording, save


def wait_until(true) -> None:
    while not true():
        time.sleep(0.02)


class QuickFits(WorkerPlugin):
    """Fits that take little time, on every worker that is there or will be."""

    def __init__(self, fitted: fj.Fit):
        self.fitted = fitted

    def setup(self, worker):
        import fracjax._batch._rows as rows

        def fit(*_, **__):
            time.sleep(0.02)
            return self.fitted

        rows.fit = fit


@pytest.fixture(scope="module")
def two_workers(tmp_path_factory) -> Iterator[LocalCluster]:
    """Two workers, a process each."""
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    options: dict[str, Any] = {"n_workers": 2, "threads_per_worker": 1, "silence_logs": 50}
    # Without an address, every cluster asks for one and the same port: two test runs at once do.
    options |= {"local_directory": str(tmp_path_factory.mktemp("dask")), "dashboard_address": ":0"}
    two: Any
    with LocalCluster(**options) as two:
        yield two
    cloudpickle.unregister_pickle_by_value(sys.modules[__name__])


@pytest.fixture
def cluster(two_workers) -> LocalCluster:
    """The cluster as it was at first, whatever a test before this one did to its workers."""
    # One that a test has closed may still count as it goes, and another has to be asked for then.
    for left in reversed(range(8)):
        two_workers.scale(2)
        try:
            two_workers.wait_for_workers(2, timeout=15)
            break
        except TimeoutError:
            if not left:
                raise
    return two_workers


@pytest.fixture
def quick_cluster(cluster, fitted) -> LocalCluster:
    with Client(cluster, set_as_default=False) as client:
        client.register_plugin(QuickFits(fitted))
    return cluster


@dataclass(frozen=True)
class Deadly(File):
    """A recording whose reading kills the process."""

    def recording(self, columns):
        os.kill(os.getpid(), signal.SIGKILL)
        raise AssertionError


def test_a_worker_fits_as_fit_does(cluster):
    rows = fj.fit_batch(
        cheap_model(), [recording(0)], out=OUT, starts=1, cluster=cluster.scheduler_address
    )
    found = fj.fit(cheap_model(), recording(0), starts=1)
    assert rows["rmse"].tolist() == [found.scores.rmse]
    assert rows["k_c.standard_error"].tolist() == [found.estimates[0].standard_error]


def test_workers_that_lack_something_are_said_to(cluster, monkeypatch):
    class Unknown(fj.blocks.Creep):
        """A block whose module only this process has."""

    Unknown.__module__, Unknown.__qualname__ = "only_here", "Unknown"
    module = types.ModuleType("only_here")
    vars(module)["Unknown"] = Unknown
    monkeypatch.setitem(sys.modules, "only_here", module)
    said = "expected workers with the same fracjax, and all that the model needs, found"
    model = fj.Model(Unknown())  # type: ignore[call-arg]
    with pytest.raises(fj.InputError, match=f"{said} ModuleNotFoundError: .*only_here"):
        fj.fit_batch(model, [recording(0)], out=OUT, cluster=cluster.scheduler_address)
    assert not OUT.exists()


@pytest.mark.slow
def test_a_killed_worker_loses_nothing(quick_cluster):
    for k in range(60):
        save(Path(f"data/{k}.csv"), k)
    address = quick_cluster.scheduler_address
    first, *_ = quick_cluster.workers.values()
    killed: list[int] = []

    def kill(done, total):
        if done and not killed:
            killed.append(first.pid)
            os.kill(first.pid, signal.SIGKILL)

    rows = batch("data", cluster=address, chunk=8, progress=kill)
    assert killed
    assert set(rows["status"]) == {"fitted"}
    assert len(pd.read_parquet(OUT / FITS)) == len(rows) == 60
    pd.testing.assert_frame_equal(batch("data", cluster=address), rows)


@pytest.mark.slow
def test_a_recording_that_kills_workers_is_a_row(quick_cluster, monkeypatch):
    monkeypatch.setattr(quick_cluster.scheduler, "allowed_failures", 0)
    jobs = [File(save(Path("a.csv").resolve(), 1)), Deadly(Path("b.csv"))]
    work = Work("creep", None, None, 2, 0)
    rows = [r for some in on_cluster(quick_cluster.scheduler_address, jobs, work) for r in some]
    told = {Path(row["source"]).name: (row["status"], row["reason"]) for row in rows}
    assert told == {
        "a.csv": ("fitted", ""),
        "b.csv": ("failed", "every worker that fitted it died."),
    }


@pytest.mark.slow
def test_work_does_not_wait_for_ever_for_a_worker(quick_cluster, monkeypatch):
    monkeypatch.setattr("fracjax._batch._cluster._PATIENCE", 5)
    for k in range(60):
        save(Path(f"data/{k}.csv"), k)

    def dismiss(done, total):
        if done:
            quick_cluster.scale(0)

    address = quick_cluster.scheduler_address
    with pytest.raises(fj.InputError, match=r"expected a worker, found none; .* are kept"):
        batch("data", cluster=address, progress=dismiss)
    assert 0 < len(pd.read_parquet(OUT / FITS)) < 60
    monkeypatch.setattr("fracjax._batch._cluster._SECONDS", 1)
    with pytest.raises(fj.InputError, match="expected a worker, found none"):
        batch("data", cluster=address)


@pytest.mark.slow
def test_results_that_went_with_the_last_worker_are_not_waited_for(quick_cluster, monkeypatch):
    monkeypatch.setattr("fracjax._batch._cluster._PATIENCE", 1)
    for k in range(60):
        save(Path(f"data/{k}.csv"), k)
    scheduler, lost = quick_cluster.scheduler, []

    def dismiss(done, total):
        if done and not lost:
            wait_until(lambda: all(task.state == "memory" for task in scheduler.tasks.values()))
            lost.extend(scheduler.tasks)
            quick_cluster.scale(0)
            wait_until(lambda: not scheduler.workers)

    with pytest.raises(fj.InputError, match=r"expected a worker, found none; .* are kept"):
        batch("data", cluster=scheduler.address, progress=dismiss)
    assert lost
    assert 0 < len(pd.read_parquet(OUT / FITS)) < 60
