"""Tables that grow by rows and go on where they were interrupted."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.versions import versions

HERE = Path(__file__).parent


class Table:
    """A CSV file with the versions it was begun with on its first line.

    `key` names the columns that tell one case from another; a case that the file holds is done.
    """

    def __init__(
        self, path: Path, columns: Sequence[str], key: Sequence[str], packages: Sequence[str]
    ):
        self.path, self.columns, self.key = path, list(columns), tuple(key)
        if not path.exists():
            with path.open("w", encoding="utf-8", newline="") as file:
                file.write(versions(packages))
                csv.DictWriter(file, self.columns, lineterminator="\n").writeheader()

    def rows(self) -> list[dict[str, str]]:
        """All rows, as text; one that a kill cut short does not count."""
        with self.path.open(encoding="utf-8", newline="") as file:
            file.readline()
            return [row for row in csv.DictReader(file) if None not in row.values()]

    def done(self) -> set[tuple[str, ...]]:
        """The keys of the rows."""
        return {tuple(row[name] for name in self.key) for row in self.rows()}

    def add(self, rows: Sequence[dict[str, Any]]) -> None:
        """Rows at the end, on disk at once."""
        with self.path.open("a", encoding="utf-8", newline="") as file:
            csv.DictWriter(file, self.columns, lineterminator="\n").writerows(rows)
        for row in rows:
            print(*(f"{row[name]}" for name in self.columns), sep="  ", flush=True)
