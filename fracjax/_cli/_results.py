"""The results of a command: the files that it saved, and how it prints them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from ._files import write_whole
from ._tables import Figures, print_json, print_table, print_text


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


class Results(NamedTuple):
    """The files that a command saved so far, and whether it prints nothing, a summary or JSON."""

    saved: list[Path]
    quiet: bool
    as_json: bool

    def save(self, write: Callable[[Path], None], path: Path) -> None:
        """Write a file completely or not at all, and note its path."""
        write_whole(write, path)
        self.saved.append(path)

    def show(self, data: Callable[[], object], summary: Callable[[], Summary]) -> None:
        """Print the result as JSON, as a summary or not; only what is printed is computed."""
        if self.as_json:
            print_json(data())
        elif not self.quiet:
            summary().show(self.saved)
