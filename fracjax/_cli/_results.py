"""What a command found: the files it saved, and how it tells of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from ._files import write_whole
from ._tables import Figures, print_json, print_table


class Summary(NamedTuple):
    """The plain sentence, the key figures, what to mind, and the parameters."""

    sentence: str
    figures: Figures = ([], [])
    notes: Sequence[str] = ()
    parameters: Figures = ([], [])

    def show(self, saved: Sequence[Path]) -> None:
        """Print it, and where everything is."""
        from rich.console import Console

        console = Console(markup=False, highlight=False)
        console.print(self.sentence, style="bold", soft_wrap=True)
        for heads, rows in (self.figures, self.parameters):
            if rows:
                print_table(heads, rows)
        for note in self.notes:
            print(note)
        if saved:
            print("Written: " + ", ".join(map(str, saved)))


class Results(NamedTuple):
    """The files that a command saved so far, and how it is to tell of them."""

    saved: list[Path]
    quiet: bool
    as_json: bool

    def save(self, write: Callable[[Path], None], path: Path) -> None:
        """Write a file whole or not at all, and note it."""
        write_whole(write, path)
        self.saved.append(path)

    def tell(self, data: Callable[[], object], summary: Callable[[], Summary]) -> None:
        """Print the result as JSON or in words, if at all; only what is printed is worked out."""
        if self.as_json:
            print_json(data())
        elif not self.quiet:
            summary().show(self.saved)
