"""Imports point one way, between packages and inside them; files and calls stay small; every
effect is in the catalogue; and importing changes nothing."""

import ast
import importlib
import os
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "fracjax"
FILES = sorted(PACKAGE.rglob("*.py"))
MOST_LINES, MOST_POSITIONAL = 450, 8
ROOT = ""  # fracjax/__init__.py, which may gather anything but the command line

# Lowest first; a module imports from its own layer and those below.
LAYERS = [
    {"_show"},
    {"_lazy", "_programs", "_filters"},
    {"_recording", "_parameters", "_computing"},
    {"_operators", "_path"},
    {"_blocks"},
    {"_naming", "_aliases", "_systems"},
    {"_catalogue"},
    {"_models"},
    {"_simulate"},
    {"_io"},
    {"_prepare"},
    {"_protocol"},
    {"_solve"},
    {"_fit"},
    {"_frequency", "_crosscheck", "_batch"},
    {"_posterior"},
    {"_inside"},
    {"_diagnose"},
    {"_compensate"},
    {"_streaming"},
    {"_report"},
    {"_registry", "_demo"},
    {"_app"},
    {ROOT},
    {"_cli"},
    {"__main__"},
]
RANK = {name: rank for rank, layer in enumerate(LAYERS) for name in layer}


def module_of(path: Path) -> str:
    """fracjax/_prepare/_noise.py → fracjax._prepare._noise; a package's __init__ → the package."""
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path) for path in FILES}


def top_of(module: str) -> str:
    """The layer's name: fracjax._prepare._noise → _fit; fracjax → ROOT."""
    return f"{module}.".split(".")[1]


def imported(source: str, module: str, is_package: bool) -> Iterator[str]:
    """Every fracjax module that `source`, read as `module`, names in an import at any depth."""
    package = module if is_package else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parents = package.split(".")
                parents = parents[: len(parents) - node.level + 1]
                base = ".".join([*parents, *([node.module] if node.module else [])])
            members = [f"{base}.{alias.name}" for alias in node.names]
            names = [member if member in MODULES else base for member in members]
        else:
            continue
        yield from (name for name in names if name.split(".")[0] == "fracjax")


def imports_of(path: Path) -> set[str]:
    source = path.read_text(encoding="utf-8")
    return set(imported(source, module_of(path), path.name == "__init__.py"))


@cache
def imports() -> dict[str, set[str]]:
    """Of every module."""
    return {module_of(path): imports_of(path) for path in FILES}


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("import fracjax", "fracjax"),
        ("import fracjax._prepare._noise as n", "fracjax._prepare._noise"),
        ("from fracjax import _recording", "fracjax._recording"),
        ("from fracjax import read", "fracjax"),
        ("from fracjax._fit import fit", "fracjax._fit"),
        ("from . import _noise", "fracjax._prepare._noise"),
        ("from ._noise import Noise", "fracjax._prepare._noise"),
        ("from .. import _recording", "fracjax._recording"),
        ("from .._recording import Recording", "fracjax._recording"),
        ("def f():\n    from .._recording import Recording", "fracjax._recording"),
        ("import numpy", None),
        ("from jax import numpy", None),
    ],
)
def test_import_statements_are_understood(line: str, found: str | None) -> None:
    assert list(imported(line, "fracjax._prepare._weights", False)) == ([found] if found else [])


def test_relative_imports_of_a_package_start_at_itself() -> None:
    assert list(imported("from ._fit import fit", "fracjax._fit", True)) == ["fracjax._fit._fit"]


def test_every_module_has_a_layer() -> None:
    assert {top_of(module) for module in MODULES} <= RANK.keys()


def test_imports_point_down() -> None:
    upward = {
        f"{module} may not import {name}"
        for module, names in imports().items()
        for name in names
        if RANK[top_of(name)] > RANK[top_of(module)]
    }
    assert not upward


def package_of(module: str) -> str:
    """fracjax._prepare._noise → fracjax._fit; a module at the top is its own package."""
    return ".".join(module.split(".")[:2])


def test_no_private_module_is_imported_from_another_package() -> None:
    private = {
        f"{module} may import {name} from the package only"
        for module, names in imports().items()
        for name in names
        if package_of(name) != package_of(module)
        if name.count(".") > 1 and name.rpartition(".")[2][0] == "_"
    }
    assert not private


def circle_in(graph: dict[str, set[str]]) -> list[str]:
    """The modules of one circle of imports, in order; none where there is no circle."""
    done: set[str] = set()

    def follow(module: str, way: list[str]) -> list[str]:
        if module in way:
            return [*way[way.index(module) :], module]
        if module in done:
            return []
        circles = (follow(name, [*way, module]) for name in sorted(graph.get(module, ())))
        circle = next((each for each in circles if each), [])
        done.add(module)
        return circle

    return next((circle for module in sorted(graph) if (circle := follow(module, []))), [])


@pytest.mark.parametrize(
    ("graph", "circle"),
    [
        ({}, []),
        ({"a": {"b"}, "b": {"c"}, "c": set()}, []),
        ({"a": {"b", "c"}, "b": {"c"}}, []),
        ({"a": {"a"}}, ["a", "a"]),
        ({"a": {"b"}, "b": {"c"}, "c": {"b"}}, ["b", "c", "b"]),
    ],
)
def test_circles_are_seen(graph: dict[str, set[str]], circle: list[str]) -> None:
    assert circle_in(graph) == circle


@pytest.mark.parametrize(
    "package", sorted({path.parent for path in FILES} - {PACKAGE}), ids=lambda path: path.name
)
def test_no_circle_inside_a_package(package: Path) -> None:
    """Imports for type checking count: what needs another's type needs the other."""
    files = [path for path in FILES if path.parent == package and path.name != "__init__.py"]
    graph = {module_of(path): imports()[module_of(path)] for path in files}
    circle = circle_in({module: names & graph.keys() for module, names in graph.items()})
    assert not circle, " ← ".join(circle)


def test_files_and_calls_stay_small() -> None:
    sources = {path: path.read_text(encoding="utf-8") for path in FILES}
    assert not [path for path, text in sources.items() if text.count("\n") > MOST_LINES], "split it"
    long = [
        f"{path}:{node.lineno}"
        for path, text in sources.items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and len(node.args) > MOST_POSITIONAL
    ]
    assert not long, "give the arguments names"


def test_readers_know_only_the_recording() -> None:
    readers = [names for module, names in imports().items() if top_of(module) == "_io"]
    assert {top_of(name) for names in readers for name in names} <= {"_io", "_recording"}


def test_nothing_imports_the_command_line() -> None:
    importing = {m for m, names in imports().items() if "_cli" in {top_of(name) for name in names}}
    assert {top_of(module) for module in importing} <= {"_cli", "__main__"}


def test_every_effect_is_in_the_catalogue() -> None:
    laws = [path for path in FILES if path.parent.name == "_blocks" and path.name[0] != "_"]
    modules = [importlib.import_module(module_of(path)) for path in laws]
    effects = [module.EFFECT for module in modules if hasattr(module, "EFFECT")]
    catalogue = importlib.import_module("fracjax._blocks").EFFECTS
    assert effects
    assert {effect.name: effect for effect in effects} == catalogue
    assert len(effects) == len(catalogue), "two effects share a name"


@pytest.mark.parametrize("flag", ["0", "1"])
def test_importing_leaves_the_precision_alone(flag: str) -> None:
    script = "import jax, fracjax; print(int(jax.config.jax_enable_x64))"
    run = subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"JAX_ENABLE_X64": flag},
        cwd=PACKAGE.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.stdout.strip() == flag, run.stderr
