"""What the README says is so: its figures, its commands, its files, its Python."""

import ast
import re
import shlex

import pytest

from docs.tables import README, ROOT, TABLES, updated
from fracjax._cli._main import cli

TEXT = README.read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
CALLS = [
    line.partition("#")[0]
    for language, block in BLOCKS
    for line in block.splitlines()
    if not language and line.startswith("fracjax ")
]


def test_figures_are_those_of_the_benchmarks():
    assert all(f"<!-- {name} -->" in TEXT for name in TABLES)
    assert updated(TEXT) == TEXT


@pytest.mark.parametrize("path", sorted(set(re.findall(r"\]\((?!http)([^)#]+)\)", TEXT))))
def test_links_lead_somewhere(path):
    assert (ROOT / path).exists()


@pytest.mark.parametrize(
    "path", sorted(set(re.findall(r"`((?:benchmarks|notebooks|docs)/[\w./]+)`", TEXT)))
)
def test_files_that_are_named_exist(path):
    assert (ROOT / path).exists()


@pytest.mark.parametrize("call", CALLS)
def test_calls_have_a_command_and_options_that_exist(call):
    words = shlex.split(call)
    command = cli.commands[words[1]]
    known = {flag for option in command.params for flag in option.opts} | {"--help"}
    assert {word for word in words[2:] if word.startswith("--")} <= known


def test_every_command_is_in_the_table():
    told = set(re.findall(r"`fracjax (\w+)", TEXT))
    assert set(cli.commands) <= told


@pytest.mark.parametrize("block", [text for language, text in BLOCKS if language == "python"])
def test_python_is_python_and_its_names_exist(block):
    import fracjax

    for node in ast.walk(ast.parse(block)):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            assert node.value.id != "fj" or node.attr in fracjax.__all__, node.attr
