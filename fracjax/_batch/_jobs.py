"""Which recordings a call means: files, folders, patterns, or recordings in memory."""

from __future__ import annotations

import glob
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from .._io import SUFFIXES, read
from .._recording import InputError, Recording, found_in

Given = Recording | str | PathLike[str]


@dataclass(frozen=True)
class File:
    """A recording in a file, at its absolute path.

    Its key is the path.  Whether it has changed is told by a digest of what it holds: size and time
    of change do not outlive a copy to another machine, and within the clock's grain they miss an
    instrument that writes the file anew; reading it costs next to nothing beside a fit.
    """

    path: Path

    @property
    def source(self) -> str:
        return str(self.path)

    @property
    def key(self) -> str:
        return str(self.path)

    def digest(self) -> str:
        """SHA-256 of the content, empty where it cannot be read."""
        try:
            with self.path.open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        except OSError:
            return ""

    def recording(self, columns: Mapping[str, Any]) -> Recording:
        return read(self.path, **columns)


@dataclass(frozen=True, eq=False)
class Held:
    """A recording in memory, whose name and content together are its key."""

    held: Recording

    @property
    def source(self) -> str:
        return self.held.source

    @property
    def key(self) -> str:
        return f"{self.held.source} {self.digest()}"

    def digest(self) -> str:
        """SHA-256 of samples, step and units."""
        recording = self.held
        facts = repr((recording.dt, recording.drive_unit, recording.response_unit)).encode()
        content = recording.drive.tobytes() + recording.response.tobytes() + facts
        return hashlib.sha256(content).hexdigest()

    def recording(self, columns: Mapping[str, Any]) -> Recording:
        return self.held


Job = File | Held


def jobs_of(given: Given | Iterable[Given], own: Path) -> dict[str, Job]:
    """Every recording once, by key, in the order given; the batch's `own` folder is no recording.

    **Raises:** `InputError` where a folder or pattern, or all of it, leads to no file.
    """
    listed = list(given) if isinstance(given, Iterable) and not isinstance(given, str) else [given]
    found: list[Job] = []
    for one in listed:
        if isinstance(one, Recording):
            found.append(Held(one))
        elif isinstance(one, str | PathLike):
            found += map(File, _files(fspath(one), own.resolve()))
        else:
            raise InputError.at(
                "recordings", "Recordings, files, folders or patterns", found_in(one), "give these"
            )
    if not found:
        raise InputError("recordings: expected at least one, found none; give a file or a folder.")
    return {job.key: job for job in found}


def _files(text: str, own: Path) -> list[Path]:
    """The files that a path or a pattern means, absolute."""
    pattern = glob.has_magic(text) and not Path(text).exists()
    places = sorted(glob.glob(text, recursive=True)) if pattern else [text]
    found = [path.resolve() for place in places for path in _within(Path(place))]
    kept = [path for path in found if own not in path.parents]
    if not kept:
        expected = "a pattern that meets files" if pattern else f"files in {', '.join(SUFFIXES)}"
        raise InputError.at(text, expected, "none", "correct the path")
    return kept


def _within(place: Path) -> Iterator[Path]:
    """A file itself; of a folder all files whose suffix is that of a recording."""
    if not place.is_dir():
        yield place
        return
    for path in sorted(place.rglob("*")):
        if path.suffix.lower() in SUFFIXES and path.is_file():
            yield path
