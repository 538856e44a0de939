"""Progress on stderr: bars on a terminal, else plain lines."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Task, TextColumn

    from .._computing import Count
    from .._show import Forecast
    from .._solve import Progress


_AT_ONCE = ("info", "models", "effects")
"""Commands that have nothing to compute."""
_BRIEF = 0.5
"""A stage that is shorter [s] gets no line."""
_SOON = 0.2
"""A command that has shown nothing for so long [s] says that it runs."""
_PAUSE = 10.0
"""Time between two lines of a count [s]; chosen by judgement, for logs that are read later."""


def _silent(*_: object) -> None:
    """No progress."""


@contextmanager
def announced(arguments: Sequence[str]) -> Iterator[None]:
    """A context in which a command says on a terminal that it runs, before it has anything else to
    show: what it needs takes longer to load than a user waits for a sign."""
    quiet = {"--quiet", "--help", "-h", "--version"} & {*arguments} or not arguments
    if quiet or arguments[0] in _AT_ONCE or not sys.stderr.isatty():
        yield
        return
    text = f"fracjax {arguments[0]}: loading and reading\n"
    sign = threading.Timer(_SOON, lambda: sys.stderr.write(text))
    sign.daemon = True
    sign.start()
    try:
        yield
    finally:
        sign.cancel()


class _Lines:
    """Plain lines, for a pipe or a log: one a stage, and one every ten seconds while it lasts."""

    def __init__(self, forecast: Forecast | None = None) -> None:
        self.start = self.last = time.monotonic()
        self.due = threading.Timer(0, _silent)
        self.forecast = forecast
        self.first: tuple[float, int] | None = None

    def write(self, sentence: str) -> None:
        """Write a line with the time since the start."""
        seconds = time.monotonic() - self.start
        print(f"{seconds:6.1f} s  {sentence}", file=sys.stderr, flush=True)

    def begin(self, sentence: str) -> None:
        """Begin a stage; its line is written once it lasts, and again as long as it does."""
        self._await(_BRIEF, sentence)

    def _await(self, seconds: float, sentence: str) -> None:
        """Write a line of the stage in some time, unless another begins before."""

        def write() -> None:
            if self.due is due:
                text = self.forecast.text if self.forecast else ""
                self.write("; ".join(filter(None, (sentence, text))))
                self._await(_PAUSE, f"still {sentence.removeprefix('still ')}")

        self.due.cancel()
        self.due = due = threading.Timer(seconds, write)
        due.daemon = True
        due.start()

    def count(self, done: int, total: int, estimate: str = "") -> None:
        """Count what is done, in a line with the time for the rest if the last is old enough."""
        self.due.cancel()
        now = time.monotonic()
        self.first = self.first or (now, done)
        if now - self.last >= _PAUSE:
            self.last = now
            began, already = self.first
            rest = (now - began) * (total - done) / max(1, done - already)
            texts = f"{done} of {total}", f"about {rest:.0f} s more" if rest else "", estimate
            self.write("; ".join(filter(None, texts)))


def until(limit: float) -> TextColumn:
    """A column with the time until a limit [s] from now, beside the present stage."""
    from rich.progress import TextColumn
    from rich.text import Text

    end = time.monotonic() + limit

    class Until(TextColumn):
        def render(self, task: Task) -> Text:
            return Text("" if task.finished else f"limit in {max(0, end - time.monotonic()):.0f} s")

    return Until("")


@contextmanager
def stages(quiet: bool, limit: float | None = None) -> Iterator[Progress]:
    """A function that begins a stage, shown with a spinner and the time that it takes, and with
    that until the command's limit [s], if it has one."""
    if quiet:
        yield _silent
        return
    from .._computing import counting
    from .._show import Forecast

    if not sys.stderr.isatty():
        forecast = Forecast()
        lines = _Lines(forecast)
        try:
            with counting(forecast.count):
                yield lines.begin
        finally:
            lines.due.cancel()
        return
    from rich.console import Console
    from rich.progress import Progress as Bars
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    text = TextColumn("{task.description}", markup=False)
    columns = [SpinnerColumn(finished_text=" "), text, TimeElapsedColumn()]
    columns += [] if limit is None else [until(limit)]
    forecast, stage = Forecast(), [""]
    with Bars(*columns, console=Console(stderr=True)) as bars:

        def finish() -> None:
            for task in bars.task_ids:
                bars.update(task, completed=1)

        def begin(sentence: str) -> None:
            finish()
            stage.append(sentence)
            bars.add_task(sentence, total=1)

        def count(done: int, total: int) -> None:
            forecast.count(done, total)
            if bars.task_ids:
                shown = "; ".join(filter(None, (stage[-1], forecast.text)))
                bars.update(bars.task_ids[-1], description=shown)

        with counting(count):
            yield begin
        finish()


@contextmanager
def bar(quiet: bool) -> Iterator[Count]:
    """A function that counts recordings, shown as a bar with the remaining time."""
    if quiet or not sys.stderr.isatty():
        yield _silent if quiet else _Lines().count
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    columns = BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    with Bars(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task("fitting", total=None)

        def count(done: int, total: int) -> None:
            bars.update(task, completed=done, total=total)

        yield count


@contextmanager
def chain_bar(
    quiet: bool, steps: int
) -> Iterator[tuple[Progress, Callable[[int, int, str], None]]]:
    """A function that begins a stage, and one that counts steps, shown as a bar with the present
    estimate and the time that the rest takes, once as many steps as the chain is expected to need
    are known."""
    if quiet:
        yield _silent, _silent
        return
    if not sys.stderr.isatty():
        lines = _Lines()
        try:
            yield lines.begin, lines.count
        finally:
            lines.due.cancel()
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as Bars

    text = TextColumn("{task.description}", markup=False)
    most = TextColumn("about"), TimeRemainingColumn()
    columns = BarColumn(20), MofNCompleteColumn(), TimeElapsedColumn(), *most, text
    with Bars(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task("", total=steps)

        def begin(sentence: str) -> None:
            bars.update(task, description=sentence)

        def count(done: int, total: int, estimate: str) -> None:
            bars.update(task, completed=done, total=total, description=estimate)

        yield begin, count
