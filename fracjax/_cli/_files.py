"""Files that are there whole or not at all."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def folder(path: Path) -> Iterator[None]:
    """A folder for results, taken away again if the work fails before anything is in it."""
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


def write_whole(write: Callable[[Path], None], path: Path) -> None:
    """Write a file whole or not at all."""
    part = path.with_name(f".{path.name}.part")
    try:
        write(part)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
