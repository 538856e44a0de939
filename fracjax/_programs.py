"""Compiled programs, kept between processes.

A program follows from the function, the structure of its arguments, the shapes of its arrays, and
the code and versions of what makes it.  All these are in the name of the file in which it is kept,
in the user's cache folder or in FRACJAX_CACHE; the process that needs it next neither traces nor
compiles it.  A file that cannot be read or written is no fault: the program is compiled.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import platform
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import FunctionType
from typing import Any

import jax
import numpy as np
import platformdirs
from jax.experimental import serialize_executable
from jaxlib.lapack import prepare_lapack_call

FOLDER = "FRACJAX_CACHE"
"""The environment variable that names the folder; empty, nothing is kept."""
LIMIT = 200 * 2**20
"""Bytes of all programs together, above which those that were used least recently are dropped."""
_KNOWN = ("fracjax", "equinox", "builtins")
"""Packages whose code and version are part of a program's name."""
_PLAIN = (str, bytes, int, float, complex, bool, type(None))


class _NotNamedError(Exception):
    """A value that has no name which another process would give it too."""


def folder() -> Path | None:
    """Where programs are kept, None where they are not: also if JAX itself has been told to, for
    what XLA has read it cannot write again."""
    if jax.config.jax_compilation_cache_dir:  # type: ignore[attr-defined]
        return None
    stated = os.environ.get(FOLDER)
    if stated is None:
        return platformdirs.user_cache_path("fracjax") / "programs"
    return Path(stated) if stated else None


def obtain(
    work: Callable[..., Any], jitted: Callable[[], Any], arrays: list[Any], others: Any, tree: Any
) -> Callable[[list[Any]], Any]:
    """The compiled program of a function for arrays, other arguments and their structure.

    It is read where it was kept, else compiled and kept.  `jitted` gives what takes the three as
    they are, the last two statically.
    """
    place, name = folder(), None
    if place is not None and jax.default_backend() == "cpu":
        with suppress(_NotNamedError):
            name = _name(work, arrays, others, tree)
    if place is None or name is None:
        return jitted().lower(arrays, others, tree).compile()
    path = place / name
    structure = jax.tree_util.tree_structure(((arrays,), {}))
    program = _read(path, structure)
    if program is None:
        program = jitted().lower(arrays, others, tree).compile()
        _write(path, program)
    return program


def _name(work: Callable[..., Any], arrays: list[Any], others: Any, tree: Any) -> str:
    """The name of a program, the same in every process in which it is the same."""
    shapes = [(np.shape(a), np.dtype(a.dtype).str, getattr(a, "weak_type", False)) for a in arrays]
    what = _stated((work, tuple(map(tuple, shapes)), others)), _structure(tree)
    return hashlib.blake2b(repr((what, _origin())).encode(), digest_size=20).hexdigest()


def _stated(value: Any) -> Any:
    """A static value as nested tuples of plain ones, each with its type: 1 is not 1.0."""
    if isinstance(value, _PLAIN):
        return type(value).__name__, repr(value)
    if isinstance(value, tuple | list):
        return type(value).__name__, tuple(map(_stated, value))
    if isinstance(value, type | FunctionType):
        home, name = value.__module__, value.__qualname__
    elif not (getattr(value, "__dict__", None) or hasattr(value, "__slots__")):
        home, name = type(value).__module__, type(value).__qualname__  # a marker, without state
    else:
        raise _NotNamedError
    # What is defined elsewhere may change while this package does not; a closure has more to it.
    if home.partition(".")[0] in _KNOWN and "<" not in name:
        return home, name
    raise _NotNamedError


def _structure(tree: Any) -> Any:
    """A tree's structure as nested tuples."""
    data = tree.node_data()
    return None if data is None else _stated(data), tuple(map(_structure, tree.children()))


@cache
def _origin() -> str:
    """What else a program follows from: the package's code, versions, and the processor."""
    package, digest = Path(__file__).parent, hashlib.blake2b(digest_size=20)
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    for name in ("jax", "jaxlib", "equinox", "numpy"):
        digest.update(version(name).encode())
    digest.update(f"{platform.python_version()} {platform.machine()} {_processor()}".encode())
    digest.update(os.environ.get("XLA_FLAGS", "").encode())
    return digest.hexdigest()


def _processor() -> str:
    """What the processor can do, as far as the system says it."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith(("flags", "Features")):
                return line
    return platform.processor()


def _read(path: Path, structure: Any) -> Callable[..., Any] | None:
    """The program in a file, None where there is none or it is damaged."""
    try:
        data = path.read_bytes()
        os.utime(path)
    except OSError:
        return None
    digest, content = data[:20], data[20:]
    if hashlib.blake2b(content, digest_size=20).digest() != digest:
        return None
    executable, results = pickle.loads(content)
    if b"lapack" in executable:
        # Lowering is what loads LAPACK, and a program that is read was lowered elsewhere: its first
        # call of it would end the process.
        prepare_lapack_call("getrf", np.float64)
    with _quietly():
        return serialize_executable.deserialize_and_load(executable, structure, _tree(results))


def _write(path: Path, program: Any) -> None:
    """Keep a program in a file, whole or not at all."""
    try:
        executable, _, results = serialize_executable.serialize(program)
        content = pickle.dumps((executable, _nested(results)))
    except (NotImplementedError, ValueError, _NotNamedError):
        return
    data = hashlib.blake2b(content, digest_size=20).digest() + content
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        number, name = tempfile.mkstemp(dir=path.parent)
        try:
            with os.fdopen(number, "wb") as file:
                file.write(data)
            os.replace(name, path)
        except OSError:
            Path(name).unlink(missing_ok=True)
        _drop_oldest(path.parent)


def _drop_oldest(place: Path) -> None:
    """Keep the folder within its limit."""
    kept = []
    for entry in os.scandir(place):
        with suppress(FileNotFoundError):  # another process drops files too
            state = entry.stat()
            kept.append((state.st_mtime_ns, state.st_size, entry.path))
    excess = sum(size for _, size, _ in kept) - LIMIT
    for _, size, path in sorted(kept):
        if excess <= 0:
            break
        Path(path).unlink(missing_ok=True)
        excess -= size


def _nested(tree: Any) -> Any:
    """A structure of tuples and lists as such, with None at its leaves, which pickle takes."""
    if tree.num_nodes == 1 and tree.num_leaves == 1:
        return None
    kind = tree.node_data()[0]
    if kind not in (tuple, list):
        raise _NotNamedError
    return kind(map(_nested, tree.children()))


def _tree(nested: Any) -> Any:
    """The structure of `_nested`."""
    return jax.tree_util.tree_structure(nested, is_leaf=lambda value: value is None)


_LOADING_IS_LOUD = "CRITICAL"
"""At any lower level XLA reports the tuning flags of a program that it loads as an error."""


@contextmanager
def _quietly() -> Iterator[None]:
    """A context in which JAX logs nothing."""
    before = jax.config.jax_logging_level  # type: ignore[attr-defined]
    jax.config.update("jax_logging_level", _LOADING_IS_LOUD)
    try:
        yield
    finally:
        jax.config.update("jax_logging_level", before)
