"""Where a report comes from: program, command, seed, date, and the files by their hash."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path


def provenance(
    sources: Iterable[str], command: str | None, seed: int | None
) -> list[tuple[str, str]]:
    """Names and texts; `sources` are the names of the recordings, of which files have a hash."""
    lines = [("program", f"fracjax {version('fracjax')}, JAX {version('jax')}")]
    if command is not None:
        lines.append(("command", command))
    if seed is not None:
        lines.append(("seed", str(seed)))
    lines.append(("written", f"{_now():%Y-%m-%d %H:%M} UTC"))
    for source in dict.fromkeys(filter(None, sources)):
        if (path := Path(source)).is_file():
            with path.open("rb") as file:
                lines.append(
                    (path.name, f"SHA-256 {hashlib.file_digest(file, 'sha256').hexdigest()}")
                )
    return lines


def _now() -> datetime:
    """The time, or that of SOURCE_DATE_EPOCH, by which builds are made reproducible."""
    stated = os.environ.get("SOURCE_DATE_EPOCH")
    return datetime.now(UTC) if stated is None else datetime.fromtimestamp(int(stated), UTC)
