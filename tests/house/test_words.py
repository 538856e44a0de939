"""The package speaks the words of its field: the glossary of CONTRIBUTING, held to."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "fracjax"
SOURCES = sorted(PACKAGE.rglob("*.py"))
TEXTS = sorted(path for path in PACKAGE.rglob("*") if path.suffix in (".py", ".jinja"))

# They say nothing of what a value is.
NO_NAMES = {"found", "told", "left", "known"}
DIALECT = re.compile(
    r"""\b(foretell\w*|foretold|known\ only\ together|takes?\ up\ whole|beyond\ doubt|lawless
    |(less|without)\ its\ (mean|median)|numbers?\ (that\ are\ |was\ |were\ )?fitted)\b""",
    re.VERBOSE | re.IGNORECASE,
)


def names_in(source: str) -> Iterator[tuple[str, int]]:
    """Every name that a source gives to a value, argument, function or field, and its line."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name, node.lineno


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("found = 1", {"found"}),
        ("found, (told, x) = 1, (2, 3)", {"found", "told", "x"}),
        ("for left in y: pass", {"left"}),
        ("class A:\n    known: int", {"A", "known"}),
        ("def told(left, *, known=1): return found", {"told", "left", "known"}),
        ("[found for found in y]", {"found"}),
    ],
)
def test_names_are_seen(source: str, names: set[str]) -> None:
    assert {name for name, _ in names_in(source)} == names


def test_names_say_what_a_value_is() -> None:
    assert not [
        f"{path}:{line} {name}"
        for path in SOURCES
        for name, line in names_in(path.read_text(encoding="utf-8"))
        if name.strip("_") in NO_NAMES
    ]


def test_texts_are_in_the_words_of_the_field() -> None:
    texts = {path: path.read_text(encoding="utf-8") for path in TEXTS}
    assert not [
        f"{path}:{text[: match.start()].count(chr(10)) + 1} {match[0]}"
        for path, text in texts.items()
        for match in DIALECT.finditer(text)
    ]
