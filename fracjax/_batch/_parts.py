"""The table of a batch on disk: a Parquet dataset that grows by whole files."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.parquet as pq

from .._recording import InputError
from ._jobs import Job
from ._rows import SETTINGS, Row

if TYPE_CHECKING:
    import pandas as pd

_FINISHED = ("fitted", "not converged")


@dataclass(frozen=True)
class Parts:
    """Rows in a folder, one Parquet file for each chunk, all with one schema and the same settings.

    A part is written under a hidden name, which readers of datasets ignore, forced to disk and
    renamed: either all of it is there or nothing.  Its name is a digest of its rows' keys, so the
    same rows written again replace the file.
    """

    folder: Path
    schema: pa.Schema

    def check(self) -> None:
        """Remove incomplete files of a killed run, and check that the settings are the same.

        Raises:
            InputError: The folder holds rows of other settings, or files of another kind.
        """
        for incomplete in self.folder.glob(".*.part"):
            incomplete.unlink()
        required = json.loads(self.schema.metadata[SETTINGS])
        for part in self._all():
            settings = _settings_of(part)
            for name in sorted({*required, *settings}):
                old, new = (values.get(name, "not given") for values in (settings, required))
                if old != new:
                    raise InputError.at(
                        str(self.folder),
                        f"the settings that its rows were made with ({name}: {old})",
                        f"others ({name}: {new})",
                        "give another --out",
                    )

    def write(self, rows: list[Row]) -> None:
        """Add the rows as one more part."""
        keys = "\n".join(row["key"] for row in rows)
        name = f"{hashlib.sha256(keys.encode()).hexdigest()[:16]}.parquet"
        self._save(pa.Table.from_pylist(rows, self.schema), self.folder / name)

    def missing(self, jobs: dict[str, Job]) -> list[Job]:
        """The recordings without a fit of their present content; their other rows are removed.

        Those that could not be read or fitted are tried again, because the cause may have been
        temporary.
        """
        fitted, outdated = set(), set()
        for part in self._all():
            for row in pq.read_table(part, columns=["key", "digest", "status"]).to_pylist():
                if job := jobs.get(row["key"]):
                    is_valid = row["status"] in _FINISHED and row["digest"] == job.digest()
                    is_first = row["key"] not in fitted
                    (fitted if is_valid and is_first else outdated).add(row["key"])
        if outdated:
            for part in self._all():
                self._remove(part, outdated)
        return [job for key, job in jobs.items() if key not in fitted - outdated]

    def table(self, keys: Iterable[str]) -> pd.DataFrame:
        """The rows of the recordings with these keys, in this order."""
        import pandas as pd  # the processes that fit do without, and it takes long to import

        keys = list(keys)
        rows = pd.read_parquet(self.folder, filters=[("key", "in", keys)])
        return rows.set_index("key", drop=False).loc[keys].reset_index(drop=True)

    def _all(self) -> list[Path]:
        """The files of all parts, sorted by name."""
        return sorted(self.folder.glob("*.parquet"))

    def _remove(self, part: Path, keys: set[str]) -> None:
        """Remove the rows with these keys from a part."""
        rows = pq.read_table(part)
        remaining = rows.filter(pa.array([key not in keys for key in rows["key"].to_pylist()]))
        if not remaining.num_rows:
            part.unlink()
        elif remaining.num_rows < rows.num_rows:
            self._save(remaining, part)

    def _save(self, rows: pa.Table, part: Path) -> None:
        """Write rows as a part, all at once."""
        self.folder.mkdir(parents=True, exist_ok=True)
        incomplete = part.with_name(f".{part.name}.part")
        try:
            with incomplete.open("wb") as file:
                pq.write_table(rows, file)
                file.flush()
                os.fsync(file.fileno())
            incomplete.replace(part)
        finally:
            incomplete.unlink(missing_ok=True)


def _settings_of(part: Path) -> dict[str, str]:
    """The settings by which the rows of a part were made."""
    try:
        return json.loads((pq.read_schema(part).metadata or {})[SETTINGS])
    except (OSError, KeyError, ValueError):  # pyarrow's errors are subclasses of these
        raise InputError.at(
            str(part), "rows written by fracjax", "something else", "give another --out"
        ) from None
