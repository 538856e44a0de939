"""What the tests of this folder share."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cloudpickle
import pytest
from distributed import LocalCluster

import fracjax as fj
import fracjax._batch._rows
from tests.batch.helpers import recording, save


@pytest.fixture(scope="session")
def fitted() -> fj.Fit:
    return fj.fit(fj.parse_model("creep"), recording(0), starts=2)


@pytest.fixture
def quick(monkeypatch, fitted) -> list[dict]:
    """Fits that take no time, and what they were called with."""
    calls: list[dict] = []

    def fit(model, recording, **options):
        calls.append({"model": model, "source": recording.source, **options})
        return fitted

    monkeypatch.setattr(fracjax._batch._rows, "fit", fit)
    return calls


@pytest.fixture
def data() -> Path:
    for k in range(7):
        save(Path(f"data/{k}.csv"), k)
    return Path("data")


@pytest.fixture(scope="session")
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


@pytest.fixture(autouse=True)
def _somewhere_empty(empty_folder):
    """Every test writes into a folder of its own."""
