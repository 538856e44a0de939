"""What README and the site's pages say is so: their figures, commands, files and Python."""

import ast
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from docs.tables import PAGES, README, ROOT, TABLES, updated
from fracjax._cli._main import cli, run

COMMANDS = ROOT / "docs" / "commands.md"
MADE = ROOT / "docs" / "effects.md"
WRITTEN = sorted(set((ROOT / "docs").rglob("*.md")) - {MADE})
TEXTS = {path: path.read_text(encoding="utf-8") for path in (README, *WRITTEN)}
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
BLOCKS = {path: BLOCK.findall(text) for path, text in TEXTS.items()}
LINKS = re.compile(r"\]\((?!http)([^)]+)\)")
NAMED = re.compile(r"`((?:benchmarks|notebooks|docs)/[\w./]+)`")
STEP, SAMPLES = 0.005, 600


def calls_in(path: Path) -> list[str]:
    """The commands of fracjax in a page's blocks without a language."""
    blocks = (block for language, block in BLOCKS[path] if not language)
    lines = (line.partition("#")[0] for block in blocks for line in block.splitlines())
    return [line for line in lines if line.startswith("fracjax ")]


def python_in(path: Path) -> list[str]:
    """The blocks of Python in a page."""
    return [block for language, block in BLOCKS[path] if language == "python"]


CALLS = [call for path in TEXTS for call in calls_in(path)]
CALLS += re.findall(r"`(fracjax [a-z][^`\n]*)`", TEXTS[README])

_TABLE = re.search(r"\| here \|\n(?:\|.*\n)+", TEXTS[README])
MODELS = re.findall(r"`([^`]+)`", _TABLE[0]) if _TABLE else []


def test_figures_are_those_of_the_benchmarks():
    text = "".join(TEXTS[path] for path in PAGES)
    assert all(f"<!-- {name} -->" in text for name in TABLES)
    assert all(updated(TEXTS[path]) == TEXTS[path] for path in PAGES)


def test_readme_is_short():
    assert len(TEXTS[README].splitlines()) <= 170


# Those of the site end its build where they lead nowhere.
@pytest.mark.parametrize("link", LINKS.findall(TEXTS[README]))
def test_links_lead_somewhere(link):
    file, _, anchor = link.partition("#")
    target = ROOT / file
    assert target.exists()
    if anchor:
        headings = re.findall(r"^#+ (.+)$", target.read_text(encoding="utf-8"), re.MULTILINE)
        assert anchor in {re.sub(r"[^\w -]", "", h).lower().replace(" ", "-") for h in headings}


@pytest.mark.parametrize("named", sorted(set(NAMED.findall("".join(TEXTS.values())))))
def test_files_that_are_named_exist(named):
    assert (ROOT / named).exists()


@pytest.mark.parametrize("call", CALLS)
def test_calls_have_a_command_and_options_that_exist(call):
    words = shlex.split(call)
    command = cli.commands[words[1]]
    known = {flag for option in command.params for flag in option.opts} | {"--help"}
    assert {word for word in words[2:] if word.startswith("--")} <= known


def test_every_command_is_in_the_table():
    described = set(re.findall(r"`fracjax (\w+)", TEXTS[COMMANDS]))
    assert set(cli.commands) <= described


@pytest.mark.parametrize("model", MODELS)
def test_models_of_the_table_exist(model):
    import fracjax

    fracjax.parse_model(model.strip('"'))


@pytest.mark.parametrize("block", [block for path in TEXTS for block in python_in(path)])
def test_python_is_python_and_its_names_exist(block):
    import fracjax

    for node in ast.walk(ast.parse(block)):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            assert node.value.id != "fj" or node.attr in fracjax.__all__, node.attr


@pytest.fixture
def loops(tmp_path, monkeypatch) -> Path:
    """A folder with the README's two recordings: FOH at rest and in motion, with noise."""
    import fracjax as fj

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    times = STEP * np.arange(SAMPLES)
    moving = np.maximum(times - 0.5, 0)
    generator = np.random.default_rng(0)
    model = fj.Model(fj.blocks.FOH(0.05, 0.05))
    for name, frequency in (("loop.csv", 1.0), ("other.csv", 1.7)):
        drive = 10 + 40 * (1 - np.cos(2 * np.pi * frequency * moving)) * np.minimum(1, times / 2)
        response = np.asarray(fj.simulate(model, drive, STEP).response)
        noisy = response + generator.normal(0, 0.01, SAMPLES)
        fj.write(name, {"time_s": times, "voltage_V": drive, "displacement_um": noisy})
    return tmp_path


@pytest.mark.slow
def test_commands_for_a_file_of_yours_run_as_printed(loops):
    calls = [call for call in calls_in(README) if "loop.csv" in call]
    assert [shlex.split(call)[1] for call in calls] == ["info", "fit", "diagnose"]
    assert [run(shlex.split(call)[1:]) for call in calls] == [0, 0, 0]
    assert (loops / "fitted" / "fit.json").exists()
    assert (loops / "result" / "report.html").exists()
    diagnosis = json.loads((loops / "result" / "diagnosis.json").read_text(encoding="utf-8"))
    assert diagnosis["verdict"] == "none"


@pytest.mark.slow
def test_python_runs_as_printed(loops):
    (block,) = python_in(README)
    names: dict = {}
    exec(compile(block, "README.md", "exec"), names)
    assert names["diagnosis"].verdict == "none"
    # The error on the recording that no fit has seen is the noise that was put in.
    assert np.std(names["error"]) == pytest.approx(0.01, rel=0.2)
    assert {path.name for path in loops.glob("*.png")} == {"fit.png", "diagnosis.png"}
