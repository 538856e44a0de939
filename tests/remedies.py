"""Every remedy that a refusal of a file prints is carried out, as the command line takes it.

`watch` is called by the conftest of a folder before its tests import `read`: from then on each
refusal of `read` and `read_segments` has its remedies run, and the fixture `remedies_work` fails
the test that met one that does not work. A remedy works where the file is then read, or is refused
for another reason whose own remedy works.
"""

import re
import shlex
import subprocess
from collections.abc import Callable, Iterator
from contextlib import chdir
from functools import wraps
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import click
import pytest

import fracjax._io as io
from fracjax._cli._info import info_command
from fracjax._cli._main import cli
from fracjax._cli._results import Call
from fracjax._recording import InputError

_FURTHER = 4
"""Remedies after one another at most."""
_VALUE = r"(?:\"[^\"]*\"|'[^']*'|(?!--|as |by |in |and |or |where |with |alone|to )[^\s,;]+)"
_OPTION = re.compile(rf"--[a-z]+(?:-[a-z]+)* (?:such as )?{_VALUE}")
_COMMAND = re.compile(r"grep -F .*? > \S+?\.csv")
_OTHER = re.compile(r": fracjax (.*)\.$")
"""Another command of the program, for a file that is no recording."""
_OPTIONS = {name for each in info_command.params for name in each.opts}
_NAMES = {
    "input_unit": "drive",
    "output_unit": "response",
    "input_scale": "drive",
    "output_scale": "response",
}

failed: list[str] = []
carried_out: set[str] = set()
nested: list[str] = []
"""The refusal whose remedies are being carried out, if any."""


def alternatives(refusal: str) -> list[list[str]]:
    """The options of each remedy that a refusal prints with its values, as arguments."""
    remedy = refusal.rpartition("; ")[2].rstrip(".") if "; " in refusal else ""
    # A value in quotes may hold a semicolon.
    while remedy.count('"') % 2 and remedy != refusal:
        remedy = refusal[: -len(remedy) - 1].rpartition("; ")[2] + "; " + remedy
    ways = []
    for way in re.split(r",? or (?:give )?(?=--)|, or ", remedy):
        found = [each.replace(" such as ", " ") for each in _OPTION.findall(way)]
        if found and not any(each.endswith(" FILE") for each in found):
            ways.append([word for each in found for word in shlex.split(each)])
    return ways


def arguments_of(options: dict[str, Any]) -> list[str] | None:
    """The arguments of the command line that say the same; None where none do."""
    words = []
    for name, value in options.items():
        if value is None:
            continue
        if name == "mask" and not isinstance(value, str):
            if not all(isinstance(each, str) for each in value):
                return None
            words += [word for each in value for word in ("--mask", each)]
        elif name in _NAMES:
            words += [f"--{name.rpartition('_')[2]}", f"{_NAMES[name]}={value}"]
        else:
            option = "clock" if name == "time_unit" else name.replace("_", "-")
            words += [f"--{option}", f"{value}"]
    return words


def again(paths: list[str], words: list[str]) -> None:
    """Read as `fracjax info` does; of an option that stands twice the last counts."""
    unknown = {word for word in words if word.startswith("--")} - _OPTIONS
    assert not unknown, f"there is no option {unknown}"
    call = ["info", *paths, *words, "--quiet"]
    cli.main(call, prog_name="fracjax", standalone_mode=False, obj=Call("", []))


def _carry_out(refusal: str, paths: list[str], words: list[str], place: Path, further: int) -> None:
    """Note the remedies of a refusal that do not work."""
    for command in _COMMAND.findall(refusal):
        subprocess.run(command, shell=True, check=True, cwd=place)
    if other := _OTHER.search(refusal):
        _run_other(refusal, shlex.split(other[1]), place)
        return
    for way in alternatives(refusal):
        try:
            with chdir(place):
                again([] if "--drive" in way else paths, [*words, *way])
        except InputError as error:
            if not further or _place(f"{error}") == _place(refusal):
                failed.append(f"{refusal}\n   with {shlex.join(way)}: {error}")
            else:
                _carry_out(f"{error}", paths, [*words, *way], place, further - 1)
        except (AssertionError, click.ClickException) as error:
            failed.append(f"{refusal}\n   with {shlex.join(way)}: {error!r}")


def _run_other(refusal: str, words: list[str], place: Path) -> None:
    """Note a proposed command that does not work."""
    with chdir(place), TemporaryDirectory() as out:
        call = [*words, "--quiet", "--out", out]
        try:
            cli.main(call, prog_name="fracjax", standalone_mode=False, obj=Call("", []))
        except (InputError, click.ClickException) as error:
            failed.append(f"{refusal}\n   with {shlex.join(words)}: {error!r}")


def _place(refusal: str) -> str:
    """What a refusal says but for the numbers that it found."""
    return re.sub(r"[\d.]+", "#", refusal.partition(", found")[0])


def watched(read: Callable) -> Callable:
    """The reader, every remedy of whose refusals is carried out."""

    @wraps(read)
    def called(path: Any, *, response: Any = None, **options: Any) -> Any:
        try:
            return read(path, response=response, **options)
        except InputError as error:
            words = arguments_of(options)
            kind = re.sub(r"[\d.]+", "#", f"{error}")
            if words is not None and kind not in carried_out and not nested:
                carried_out.add(kind)
                paths = [f"{path}"]
                if response is not None:
                    paths, words = [], [*words, "--drive", f"{path}", "--response", f"{response}"]
                nested.append(kind)
                try:
                    _carry_out(f"{error}", paths, words, Path(path).parent, _FURTHER)
                finally:
                    nested.clear()
            raise

    return called


_read = io.read_segments


def watch() -> None:
    """Carry out the remedies of all that is read from now on."""
    if io.read_segments is _read:
        io.read, io.read_segments = watched(io.read), watched(_read)


@pytest.fixture(autouse=True)
def remedies_work() -> Iterator[None]:
    """Fail the test that met a remedy that does not work."""
    failed.clear()
    yield
    assert not failed, "\n".join(failed)
