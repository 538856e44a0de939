"""The results of a command: the files that it saved, and how it prints them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ._files import write_whole
from ._tables import Figures, print_json, print_table, print_text

if TYPE_CHECKING:
    from .._report import Reported


class Summary(NamedTuple):
    """The result in one sentence, the key figures, notes, and the parameters."""

    sentence: str
    figures: Figures = ([], [])
    notes: Sequence[str] = ()
    parameters: Figures = ([], [])

    def show(self, saved: Sequence[Path]) -> None:
        """Print the summary and the paths of the saved files."""
        print_text(self.sentence, "bold")
        for headers, rows in (self.figures, self.parameters):
            if rows:
                print_table(headers, rows)
        for note in self.notes:
            print_text(note)
        if saved:
            print_text("Written: " + ", ".join(map(str, saved)))


class Call(NamedTuple):
    """The command line of a call, and the files that it saved so far."""

    line: str
    saved: list[Path]


class Results(NamedTuple):
    """The call, and whether it prints nothing, a summary or JSON."""

    call: Call
    quiet: bool
    as_json: bool

    @property
    def saved(self) -> list[Path]:
        """The files that the command saved so far."""
        return self.call.saved

    def save(self, write: Callable[[Path], None], path: Path) -> None:
        """Write a file completely or not at all, and note its path."""
        write_whole(write, path)
        self.saved.append(path)

    def save_report(self, result: Reported, path: Path, seed: int | None = None) -> None:
        """Write the report of a result, which states this call and its seed."""
        from .._report import write_report

        self.save(lambda file: write_report(result, file, command=self.call.line, seed=seed), path)

    def show(self, data: Callable[[], object], summary: Callable[[], Summary]) -> None:
        """Print the result as JSON, as a summary or not; only what is printed is computed."""
        if self.as_json:
            print_json(data())
        elif not self.quiet:
            summary().show(self.saved)
