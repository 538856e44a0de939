"""The recordings that a call means: files, folders, patterns, or recordings in memory."""

from __future__ import annotations

import glob
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from .._io import SUFFIXES, read
from .._recording import InputError, Recording, found_in

RecordingInput = Recording | str | PathLike[str]


@dataclass(frozen=True)
class File:
    """A recording in a file, whose key is its absolute path.

    A digest of its content shows whether it has changed.  Size and time of change are not enough:
    they differ on another machine, and they can stay the same if an instrument writes the file
    again within the clock's resolution.  Reading the file takes little time compared with a fit.
    """

    path: Path

    @property
    def source(self) -> str:
        """The path, for messages and tables."""
        return str(self.path)

    @property
    def key(self) -> str:
        """The path, by which a row is recognised."""
        return str(self.path)

    def digest(self) -> str:
        """SHA-256 of the content, empty where it cannot be read."""
        try:
            with self.path.open("rb", buffering=0) as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        except OSError:
            return ""

    def recording(self, columns: Mapping[str, Any]) -> Recording:
        """The recording, read with these options of `read`."""
        return read(self.path, **columns)


@dataclass(frozen=True, eq=False)
class Held:
    """A recording in memory, whose key is its name and content."""

    content: Recording

    @property
    def source(self) -> str:
        """The recording's name."""
        return self.content.source

    @property
    def key(self) -> str:
        """The recording's name and digest, by which a row is recognised."""
        return f"{self.content.source} {self.digest()}"

    def digest(self) -> str:
        """SHA-256 of samples, step and units."""
        return self._digest

    @cached_property
    def _digest(self) -> str:
        """The digest, which the key needs too."""
        recording = self.content
        facts = repr((recording.dt, recording.drive_unit, recording.response_unit)).encode()
        content = recording.drive.tobytes() + recording.response.tobytes() + facts
        return hashlib.sha256(content).hexdigest()

    def recording(self, columns: Mapping[str, Any]) -> Recording:
        """The recording; options for reading do not apply."""
        return self.content


Job = File | Held


def jobs_of(recordings: RecordingInput | Iterable[RecordingInput], own: Path) -> dict[str, Job]:
    """Every recording once, by key, in the order given, without files in the batch's `own` folder.

    Raises:
        InputError: A folder or pattern leads to no file, or nothing is left.
    """
    listed = (
        list(recordings)
        if isinstance(recordings, Iterable) and not isinstance(recordings, str)
        else [recordings]
    )
    jobs: list[Job] = []
    for item in listed:
        if isinstance(item, Recording):
            jobs.append(Held(item))
        elif isinstance(item, str | PathLike):
            jobs += map(File, _files(fspath(item), own.resolve()))
        else:
            raise InputError.at(
                "recordings",
                "Recordings, files, folders or patterns",
                found_in(item),
                "give one of these",
            )
    if not jobs:
        raise InputError("recordings: expected at least one, found none; give a file or a folder.")
    return {job.key: job for job in jobs}


def _files(text: str, own: Path) -> list[Path]:
    """Absolute paths of the files that a path or pattern means, except those in `own`."""
    pattern = glob.has_magic(text) and not Path(text).exists()
    places = sorted(glob.glob(text, recursive=True)) if pattern else [text]
    paths = [path.resolve() for place in places for path in _within(Path(place))]
    outside = [path for path in paths if own not in path.parents]
    if not outside:
        expected = "a pattern that matches files" if pattern else f"files in {', '.join(SUFFIXES)}"
        raise InputError.at(text, expected, "none", "correct the path")
    return outside


def _within(place: Path) -> Iterator[Path]:
    """The file itself; for a folder, all files in it with the suffix of a recording."""
    if not place.is_dir():
        yield place
        return
    for path in sorted(place.rglob("*")):
        if path.suffix.lower() in SUFFIXES and path.is_file():
            yield path
