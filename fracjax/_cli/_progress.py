"""Progress on stderr, if it is a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .._batch import Count
    from .._solve import Progress


def _hidden(quiet: bool) -> bool:
    """Whether no progress is shown."""
    return quiet or not sys.stderr.isatty()


@contextmanager
def stages(quiet: bool) -> Iterator[Progress]:
    """A function that begins a stage, shown with a spinner and the time that it takes."""
    if _hidden(quiet):
        yield lambda sentence: None
        return
    from rich.console import Console
    from rich.progress import Progress as Bars
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(finished_text=" "), TextColumn("{task.description}", markup=False)
    with Bars(*columns, TimeElapsedColumn(), console=Console(stderr=True)) as bars:

        def finish() -> None:
            for task in bars.task_ids:
                bars.update(task, completed=1)

        def begin(sentence: str) -> None:
            finish()
            bars.add_task(sentence, total=1)

        yield begin
        finish()


@contextmanager
def bar(quiet: bool) -> Iterator[Count]:
    """A function that counts recordings, shown as a bar with the remaining time."""
    if _hidden(quiet):
        yield lambda done, total: None
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
def chain_bar(quiet: bool, steps: int) -> Iterator[Callable[[int, int, str], None]]:
    """A function that counts steps, shown as a bar with the present estimate."""
    if _hidden(quiet):
        yield lambda done, most, estimate: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    text = TextColumn("{task.description}", markup=False)
    columns = BarColumn(20), MofNCompleteColumn(), TimeElapsedColumn(), text
    with Bars(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task("fitting", total=steps)

        def count(done: int, most: int, estimate: str) -> None:
            bars.update(task, completed=done, total=most, description=estimate)

        yield count
