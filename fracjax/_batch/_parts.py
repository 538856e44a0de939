"""The table of a batch on disk: a Parquet dataset that grows by whole files, never by halves."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from .._recording import InputError
from ._jobs import Job
from ._rows import SETTINGS, Row

_FINISHED = ("fitted", "not converged")


@dataclass(frozen=True)
class Parts:
    """Rows in a folder, one Parquet file for each chunk, all of one schema and the same settings.

    A part is written under a hidden name, which readers of datasets pass over, forced to disk, and
    renamed: it is there whole or not at all.  Its name is a digest of its rows' keys, so that the
    same rows written again replace themselves.
    """

    folder: Path
    schema: pa.Schema

    def check(self) -> None:
        """Clear away what a killed run left half written, and see that the settings are the same.

        **Raises:** `InputError` for other settings, or for files that are not of this kind.
        """
        for torn in self.folder.glob(".*.part"):
            torn.unlink()
        wanted = json.loads(self.schema.metadata[SETTINGS])
        for part in self._all():
            settings = _settings_of(part)
            for name in sorted({*wanted, *settings}):
                old, new = (told.get(name, "not given") for told in (settings, wanted))
                if old != new:
                    raise InputError.at(
                        str(self.folder),
                        f"the settings that its rows were made with ({name}: {old})",
                        f"others ({name}: {new})",
                        "give another --out",
                    )

    def write(self, rows: list[Row]) -> None:
        """One more part."""
        keys = "\n".join(row["key"] for row in rows)
        name = f"{hashlib.sha256(keys.encode()).hexdigest()[:16]}.parquet"
        self._save(pa.Table.from_pylist(rows, self.schema), self.folder / name)

    def missing(self, jobs: dict[str, Job]) -> list[Job]:
        """The recordings without one fit of their present content; other rows are taken out.

        Those that could not be read or fitted are tried again: the cause may have been outside.
        """
        fitted, void = set(), set()
        for part in self._all():
            for row in pq.read_table(part, columns=["key", "digest", "status"]).to_pylist():
                if job := jobs.get(row["key"]):
                    good = row["status"] in _FINISHED and row["digest"] == job.digest()
                    first = row["key"] not in fitted
                    (fitted if good and first else void).add(row["key"])
        if void:
            for part in self._all():
                self._take_out(part, void)
        return [job for key, job in jobs.items() if key not in fitted - void]

    def table(self, keys: Iterable[str]) -> pd.DataFrame:
        """The rows of these recordings, in their order."""
        keys = list(keys)
        rows = pd.read_parquet(self.folder, filters=[("key", "in", keys)])
        return rows.set_index("key", drop=False).loc[keys].reset_index(drop=True)

    def _all(self) -> list[Path]:
        return sorted(self.folder.glob("*.parquet"))

    def _take_out(self, part: Path, keys: set[str]) -> None:
        rows = pq.read_table(part)
        kept = rows.filter(pa.array([key not in keys for key in rows["key"].to_pylist()]))
        if not kept.num_rows:
            part.unlink()
        elif kept.num_rows < rows.num_rows:
            self._save(kept, part)

    def _save(self, rows: pa.Table, part: Path) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        torn = part.with_name(f".{part.name}.part")
        try:
            with torn.open("wb") as file:
                pq.write_table(rows, file)
                file.flush()
                os.fsync(file.fileno())
            torn.replace(part)
        finally:
            torn.unlink(missing_ok=True)


def _settings_of(part: Path) -> dict[str, str]:
    try:
        return json.loads((pq.read_schema(part).metadata or {})[SETTINGS])
    except (OSError, KeyError, ValueError):  # pyarrow's errors are kinds of these
        raise InputError.at(
            str(part), "rows written by fracjax", "something else", "give another --out"
        ) from None
