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


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_names_say_what_a_value_is(path: Path) -> None:
    named = names_in(path.read_text(encoding="utf-8"))
    assert not [pair for pair in named if pair[0].strip("_") in NO_NAMES]


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_texts_are_in_the_words_of_the_field(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not [
        (match[0], text[: match.start()].count("\n") + 1) for match in DIALECT.finditer(text)
    ]
