"""Real recordings by name, from a local copy or their origin, verified by their SHA-256."""

from __future__ import annotations

import os
from pathlib import Path

import pooch

from .._recording import InputError

_ORIGIN = pooch.create(path=pooch.os_cache("fracjax"), base_url="")
_ORIGIN.load_registry(Path(__file__).with_name("recordings.txt"))

RECORDINGS: tuple[str, ...] = tuple(_ORIGIN.registry_files)
"""The names that `fetch_recording` accepts, such as "piezo_dbo/Model_Vi_Do.dat"."""


def fetch_recording(name: str) -> Path:
    """A local copy of a real recording, with the same bytes as at its origin (by SHA-256).

    If the environment variable FRACJAX_DATA names a folder, the recording is taken from there.
    Otherwise it is downloaded from its origin once and kept in the user's cache.  The files are as
    their authors wrote them: pass the columns and units to `read`.

    Args:
        name: One of `RECORDINGS`, such as "piezo_dbo/Model_Vi_Do.dat".

    Returns:
        The path of the file.

    Raises:
        InputError: When the name is unknown, the file is missing from the local copy or has another
            SHA-256, or the origin cannot be reached.
    """
    if name not in RECORDINGS:
        raise InputError.at(
            "recording", "a name of the registry", f'"{name}"', f"give one of {_listed()}"
        )
    folder = os.environ.get("FRACJAX_DATA")
    return _local(name, Path(folder)) if folder else _cached(name)


def _local(name: str, folder: Path) -> Path:
    """The recording in the folder that FRACJAX_DATA names."""
    path = folder / name
    if not path.is_file():
        raise InputError.at(
            str(path),
            "a recording in the folder that FRACJAX_DATA names",
            "no such file",
            f"copy it from {_ORIGIN.get_url(name)}, or unset FRACJAX_DATA to download it",
        )
    expected, actual = _ORIGIN.registry[name], pooch.file_hash(str(path))
    if actual != expected:
        raise InputError.at(
            str(path),
            f"a file of SHA-256 {expected}",
            actual,
            f"copy it again from {_ORIGIN.get_url(name)}",
        )
    return path


def _cached(name: str) -> Path:
    """The recording in the user's cache, downloaded from its origin on first use."""
    try:
        return Path(_ORIGIN.fetch(name))
    except OSError as error:
        reason = f"neither a copy in {_ORIGIN.path} nor a download ({type(error).__name__})"
        raise InputError.at(
            name,
            f"the recording from {_ORIGIN.get_url(name)}",
            reason,
            "go online, or name a local copy of the recordings' folders in FRACJAX_DATA",
        ) from None
    except ValueError:  # pooch's error for another SHA-256
        raise InputError.at(
            name,
            f"a download of SHA-256 {_ORIGIN.registry[name]}",
            "another file",
            "try again, or name a local copy of the recordings' folders in FRACJAX_DATA",
        ) from None


def _listed() -> str:
    """All names, grouped by folder: piezo_dbo/Model_Vi_Do.dat, Test_Vi_Do_Di.dat; …"""
    files: dict[str, list[str]] = {}
    for name in RECORDINGS:
        folder, _, file = name.partition("/")
        files.setdefault(folder, []).append(file)
    return "; ".join(f"{folder}/{', '.join(names)}" for folder, names in files.items())
