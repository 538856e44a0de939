"""Files that are there whole or not at all, and folders of which no other results are lost."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

_KINDS = {
    "diagnosis.json": "diagnosis",
    "posterior.json": "posterior",
    "compensation.json": "compensation",
    "crosscheck.json": "cross-check",
    "chain.h5": "posterior",
    "fit.json": "fit",
}
"""The file by which a folder shows what it holds; the first that is there decides."""


class Content(NamedTuple):
    """What a folder of results holds, or what a call is about to write into it.

    Attributes:
        kind: Such as "fit".
        recordings: The names of the recordings, or of the trajectory.
        models: The names of the models.
    """

    kind: str
    recordings: Collection[str]
    models: Collection[str]


@contextmanager
def folder(path: Path, content: Content | None = None) -> Iterator[None]:
    """A folder for results, taken away again if the work fails before anything is in it.

    Raises InputError where it holds results other than `content`, which would be overwritten.
    """
    if content is not None:
        _require_no_others(path, content)
    created = [place for place in (path, *path.parents) if not place.exists()]
    path.mkdir(parents=True, exist_ok=True)
    try:
        probe = path / ".part"
        probe.touch()
        probe.unlink()
        yield
    except BaseException:
        with suppress(OSError):
            for place in created:
                place.rmdir()
        raise


def _require_no_others(path: Path, content: Content) -> None:
    """Raise InputError where a folder holds another kind of result, or of other recordings or
    models than are about to be written."""
    held = _held_in(path)
    if held is None:
        return
    same = held.kind == content.kind and [*held.recordings] == [*content.recordings]
    if same and {*held.models} <= {*content.models}:
        return
    from .._recording import InputError

    raise InputError.at(
        f"--out {path}",
        "an empty folder, or earlier results of the same command, recordings and models",
        f"a {held.kind} of {', '.join(held.recordings)} with {', '.join(held.models)}",
        "name another folder, or remove this one",
    )


def _held_in(path: Path) -> Content | None:
    """What results a folder holds; None where it holds none that can be read."""
    kind = next((kind for file, kind in _KINDS.items() if (path / file).exists()), None)
    for file in _KINDS:
        with suppress(OSError, ValueError, KeyError, TypeError):
            if kind is None or file == "chain.h5":
                continue
            written = json.loads((path / file).read_text(encoding="utf-8"))
            recordings = written.get("recordings") or [written["trajectory"]]
            return Content(kind, recordings, [written["model"]])
    return None


def write_whole(write: Callable[[Path], None], path: Path) -> None:
    """Write a file whole or not at all."""
    part = path.with_name(f".{path.name}.part")
    try:
        write(part)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
