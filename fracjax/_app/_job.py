"""A computation in the background, with its stage, its limit of time, and Stop."""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Thread

from .._computing import counting
from .._recording import InputError
from .._show import Forecast
from .._solve import Progress


class Stopped(KeyboardInterrupt):
    """Ends a computation at its next stage, as Ctrl-C does; a diagnosis ends with its verdict so
    far."""


class Job:
    """One computation.

    Attributes:
        stage: what is being done, in words.
        result: what came of it, None before the end and after a failure.
        message: why there is no result, "" otherwise.
    """

    def __init__(self, compute: Callable[[Progress], object], seconds: float):
        self.stage, self.result, self.message = "starting", None, ""
        self._began, self._seconds = time.monotonic(), seconds
        self._stopped = self._limited = False
        self._forecast = Forecast()
        self._thread = Thread(target=self._run, args=(compute,), daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether it has not ended."""
        return self._thread.is_alive()

    @property
    def elapsed(self) -> float:
        """Seconds since its start."""
        return time.monotonic() - self._began

    @property
    def remaining(self) -> float:
        """Seconds until its limit."""
        return max(0.0, self._seconds - self.elapsed)

    @property
    def forecast(self) -> str:
        """How much of the present round is done and how long it will go on, or ""."""
        return self._forecast.text

    def stop(self) -> None:
        """End it at its next stage."""
        self._stopped = True

    def _count(self, done: int, total: int) -> None:
        self._raise_if_stopped()
        self._forecast.count(done, total)

    def _raise_if_stopped(self) -> None:
        # Each is raised once: a verdict that the computation still has is let through.
        if self._stopped:
            self._stopped = False
            raise Stopped("stopped")

    def _progress(self, stage: str) -> None:
        self._raise_if_stopped()
        if self.remaining == 0 and not self._limited:
            self._limited = True
            raise Stopped(f"stopped at its limit of {self._seconds:.0f} s")
        self.stage = stage

    def _run(self, compute: Callable[[Progress], object]) -> None:
        try:
            with counting(self._count):
                self.result = compute(self._progress)
        except (Stopped, InputError) as error:
            self.message = str(error)
        except Exception as error:  # the page goes on and shows it
            self.message = f"failed: {error}"
            raise
