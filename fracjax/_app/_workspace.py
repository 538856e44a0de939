"""The folder of the page: the files in it, their roles, and how they are read."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from .._io import SUFFIXES, Options, read, read_table
from .._recording import InputError, Recording

ROLES = ("unused", "train", "held out", "repeat")
LARGEST = 200_000_000
"""Most bytes of an uploaded file."""
_SUFFIXES = frozenset({*SUFFIXES, ".lvm", ".nc"})
"""Those of the formats that are read."""


@dataclass
class Workspace:
    """What was chosen on the page.

    Attributes:
        folder: where all files are read and written, and no other place.
        roles: of the files by name, for those that have one.
        options: how all files are read, as of `read`.
        mask: times [s] that are left out.
        model: the name of the model.
        noise: the sensor's specification, "" where the recordings show the noise.
    """

    folder: Path
    roles: dict[str, str] = field(default_factory=dict)
    options: Options = field(default_factory=Options)
    mask: list[tuple[float, float]] = field(default_factory=list)
    model: str = "foh"
    noise: str = ""

    def names(self) -> list[str]:
        """The files in the folder that may hold a recording."""
        listed = (path for path in self.folder.iterdir() if path.suffix.lower() in _SUFFIXES)
        return sorted(path.name for path in listed if self._is_inside(path))

    def path(self, name: str) -> Path:
        """The path of a file in the folder.  Raises InputError for one outside it."""
        path = self.folder / name
        if Path(name).name != name or not self._is_inside(path):
            raise InputError.at(
                "file", f"a file in {self.folder}", f'"{name}"', "copy it into the folder"
            )
        return path

    def has_other(self, name: str, content: bytes) -> bool:
        """Whether the folder holds another file of the name of an uploaded one."""
        path = self._target(name)
        return path.exists() and path.read_bytes() != content

    def _target(self, name: str) -> Path:
        return self.folder / Path(name.replace("\\", "/")).name

    def add(self, name: str, content: bytes, *, replace: bool = False) -> None:
        """Keep an uploaded file in the folder.

        Raises InputError where it is too large, no kind of recording, or there is another of its
        name, unless it is to `replace` that.
        """
        path = self._target(name)
        if len(content) > LARGEST:
            most = f"a file of at most {LARGEST // 1_000_000} MB"
            size = f"{len(content) / 1e6:.0f} MB"
            raise InputError.at(path.name, most, size, "copy it into the folder yourself")
        if path.suffix.lower() not in _SUFFIXES:
            raise InputError.at(
                path.name, "a table of numbers", f'the suffix "{path.suffix}"', "export it as CSV"
            )
        if not replace and self.has_other(name, content):
            raise InputError.at(
                path.name, "a new name", "another file of that name", "rename one of them"
            )
        path.write_bytes(content)

    def with_role(self, role: str) -> list[str]:
        """The names of the files with a role."""
        return [name for name in self.names() if self.roles.get(name) == role]

    def columns(self, name: str) -> list[str]:
        """The names of a file's columns, or their indices where it has no names."""
        table = read_table(self.path(name))
        return list(table.names) or [str(index) for index in range(table.width)]

    def recordings(self, role: str) -> list[Recording]:
        """The recordings with a role."""
        return [read(self.path(name), **self.options) for name in self.with_role(role)]

    def training(self) -> list[Recording]:
        """The recordings to fit.  Raises InputError where no file has that role."""
        recordings = self.recordings("train")
        if not recordings:
            raise InputError.at("files", "at least one to train", "none", "choose its role")
        return recordings

    def _is_inside(self, path: Path) -> bool:
        """Whether a path leads to a place in the folder, links followed."""
        return path.resolve().is_relative_to(self.folder.resolve())
