"""Recordings that wait to be fitted, handed out to whoever asks."""

from __future__ import annotations

from collections.abc import Iterable
from threading import Lock

from ._jobs import Job

FEWEST = 16
"""Recordings that are fitted together at least, where as many wait: with fewer, a stack takes
longer for each than it saves by an even end.  Chosen by judgement."""


class Waiting:
    """Recordings in order, for up to `takers` threads that take some at a time until none are left.

    Towards the end each takes less, so that all end at about the same time (guided
    self-scheduling).
    """

    def __init__(self, jobs: Iterable[Job], takers: int):
        self._takers = takers
        self._jobs = list(jobs)[::-1]
        self._lock = Lock()

    def __len__(self) -> int:
        return len(self._jobs)

    def take(self, most: int) -> list[Job]:
        """The next ones; none if none are left."""
        with self._lock:
            share = max(-(-len(self._jobs) // self._takers), FEWEST)
            return [self._jobs.pop() for _ in range(min(most, share, len(self._jobs)))]

    def clear(self) -> None:
        """Leave none."""
        with self._lock:
            self._jobs.clear()
