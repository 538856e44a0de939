"""Packages whose names are imported when they are first used (PEP 562).

What a command does not need is then not loaded: `fracjax info` does without JAX.  The names stand
once, as imports that only type checkers run.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec


def names_of(package: str) -> dict[str, str]:
    """The public name of each import for type checkers in a package's own file, and its source:
    a module, and after a colon the name there."""
    spec = find_spec(package)
    assert spec is not None
    assert spec.loader is not None
    text = spec.loader.get_source(package)  # type: ignore[attr-defined]
    sources = {}
    for block in ast.parse(text).body:
        if isinstance(block, ast.If):
            for line in block.body:
                assert isinstance(line, ast.ImportFrom)
                for each in line.names:
                    home = f".{line.module}:{each.name}" if line.module else f".{each.name}"
                    sources[each.asname or each.name] = home
    return sources


def attach(package: str) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """The `__getattr__` and the `__dir__` of a package."""
    sources: dict[str, str] = {}

    def names() -> list[str]:
        if not sources:
            sources.update(names_of(package))
        return sorted(sources)

    def load(name: str) -> object:
        if name not in names():
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home, _, inside = sources[name].partition(":")
        module = import_module(home, package)
        value = getattr(module, inside) if inside else module
        setattr(sys.modules[package], name, value)
        return value

    return load, names
