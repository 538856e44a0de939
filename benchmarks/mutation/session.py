"""A session of pytest in a process that has imported already what takes long.

A server imports the libraries once and forks a process for each session; fracjax and the
tests are imported in the session, from the folder that it is given.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

LIBRARIES = (
    "arviz", "equinox", "hypothesis", "jax", "jsonschema", "lineax", "matplotlib.pyplot", "mpmath",
    "optimistix", "pandas", "pint", "pyarrow.parquet", "pytest", "scipy.optimize", "scipy.signal",
    "scipy.stats",
)  # fmt: skip
_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload(list(LIBRARIES))


class _Failures:
    """A plugin that writes the names of the tests that fail, one per line."""

    def __init__(self, path: Path):
        self.path = path

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._add(report.nodeid)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self._add(report.nodeid)

    def _add(self, name: str) -> None:
        with self.path.open("a", encoding="utf-8") as file:
            file.write(f"{name}\n")


def _session(arguments: Sequence[str], folder: Path, failures: Path, busy: int) -> None:
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (busy, busy + 5))
    silence = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(silence, stream)
    assert "fracjax" not in sys.modules
    os.chdir(folder)
    # For this process and for those that tests start.
    sys.path.insert(0, str(folder))
    os.environ["PYTHONPATH"] = str(folder)
    # Libraries that bring plugins of pytest are there before it.
    quiet = "-Wignore:Module already imported:pytest.PytestAssertRewriteWarning"
    status = pytest.main([quiet, *arguments], plugins=[_Failures(failures)])
    # Threads that a fault has left waiting are not waited for.
    os._exit(status)


def session(
    arguments: Sequence[str], folder: Path, failures: Path, busy: int, waiting: int
) -> int | None:
    """The exit status of pytest in a folder, below 0 by a signal; None if it had to be ended.

    The names of failing tests are in `failures`.  A session may take `busy` seconds of the
    processor's time, after which SIGXCPU ends it, and `waiting` of the clock's.
    """
    failures.write_text("", encoding="utf-8")
    child = _FORKS.Process(target=_session, args=(arguments, folder, failures, busy))
    child.start()
    child.join(waiting)
    if child.exitcode is None:
        os.killpg(child.pid, signal.SIGKILL)
        child.join()
        return None
    return child.exitcode
