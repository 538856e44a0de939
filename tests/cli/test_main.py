"""Calls that cannot be used, help, completion, and the program itself."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import fracjax._diagnose
from fracjax._cli import run
from fracjax._cli._main import cli
from tests.helpers import failure

PACKAGE = Path(fracjax.__file__).parent


# Calls that cannot be used ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("bogus", "No such command 'bogus'"),
        ("fit", "Missing argument 'RECORDING...'"),
        ("fit LOOP --model foh", "Missing option '--out'"),
        ("fit LOOP --bogus", "No such option '--bogus'"),
        ("fit LOOP --model foh --out results --history never", "Invalid value for '--history'"),
        ("fit none.csv --model foh --out results", "none.csv: expected a file that can be read"),
        ("fit LOOP --model nope --out results", 'model "nope": expected names'),
        ("fit LOOP --model foh --out LOOP", "expected a place that can be written"),
        ("fit LOOP --model foh --out results --settle 9s", "a time from 0 to 3.68 s"),
        ("fit LOOP --model foh --out results --settle 9um", "expected a value in s"),
        ("fit LOOP --model foh --out results --prior alpha=1", 'a text such as "alpha=0.1±0.02"'),
        ("fit LOOP --model creep --out results --fix nu=1", '"nu": expected one of k_c, mu'),
        ("fit LOOP --model creep --out results --mask 8s..9s", "expected times within 0 to 3.99"),
        ("fit LOOP --model foh --out results --input 7", 'expected a column "7"'),
        (
            "diagnose LOOP --model foh --out results --noise -1um",
            "noise: expected a number above",
        ),
        ("diagnose LOOP --model foh --out results --noise 1V", "expected a value in um"),
        ("diagnose LOOP --model foh --out results --holdout x.csv", "x.csv: expected a file"),
        ("simulate LOOP --out s.csv", "Give either --model or --fit"),
        ("simulate LOOP --fit fit.json --out s.csv", "expected a fit.json"),
        ("simulate LOOP --model foh --out no/s.csv", "expected a file that can be written"),
        ("info none.csv", "none.csv: expected a file that can be read"),
        ("effects nope", 'effect "nope": expected one of creep'),
    ],
)
def test_unusable_calls(call, said, loop, capsys):
    assert run([loop if word == "LOOP" else word for word in call.split()]) == 2
    assert said in failure(capsys)
    assert list(Path.cwd().iterdir()) == []


def test_a_refusal_during_the_work_leaves_no_folder(loop, quick, monkeypatch, capsys):
    def refuse(*_, **__):
        raise fracjax.InputError("loop.csv: expected better, found worse; mend it.")

    monkeypatch.setattr(fracjax._diagnose, "diagnose", refuse)
    assert run(["diagnose", loop, "--model", "foh", "--out", "a/b"]) == 2
    assert "expected better" in failure(capsys)
    assert list(Path.cwd().iterdir()) == []


def test_faults_of_the_program_are_not_hidden(loop, quick, monkeypatch):
    def break_down(*_, **__):
        raise ValueError("a fault")

    monkeypatch.setattr(fracjax._diagnose, "diagnose", break_down)
    with pytest.raises(ValueError, match="a fault"):
        run(["diagnose", loop, "--model", "foh", "--out", "results"])


# Help ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("call", ["--help", "-h", "--version", "fit --help", "demo --help"])
def test_help(call, capsys):
    assert run(call.split()) == 0
    out, err = capsys.readouterr()
    assert out
    assert err == ""


def test_every_command_can_be_quiet_or_speak_json():
    """Another program that calls one need not know which."""
    for name, command in cli.commands.items():
        flags = {flag for option in command.params for flag in option.opts}
        assert {"--json", "--quiet"} <= flags, name
        assert command.get_short_help_str(), name


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_words_are_completed(shell):
    environment = os.environ | {"_FRACJAX_COMPLETE": f"{shell}_source"}
    called = [sys.executable, "-c", "from fracjax._cli import main; main()"]
    told = subprocess.run(
        called, env=environment, cwd=PACKAGE.parent, capture_output=True, text=True, check=True
    )
    assert "_fracjax_completion" in told.stdout
    environment = os.environ | {
        "_FRACJAX_COMPLETE": "zsh_complete",
        "COMP_WORDS": "fracjax cro",
        "COMP_CWORD": "1",
    }
    told = subprocess.run(
        called, env=environment, cwd=PACKAGE.parent, capture_output=True, text=True, check=True
    )
    assert "crosscheck" in told.stdout.splitlines()


def test_help_waits_for_nothing():
    """The command line alone, without the package's own imports, loads nothing heavy."""
    script = (
        "import sys, types\n"
        "package = types.ModuleType('fracjax')\n"
        f"package.__path__, package.__version__ = [{str(PACKAGE)!r}], '0'\n"
        "sys.modules['fracjax'] = package\n"
        "from fracjax._cli import run\n"
        "run(['fit', '--help'])\n"
        "print({'numpy', 'jax', 'rich', 'pint', 'matplotlib'} & set(sys.modules))\n"
    )
    told = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert told.stdout.splitlines()[-1] == "set()"


def test_the_package_runs_as_a_program():
    script = [sys.executable, "-m", "fracjax", "--version"]
    told = subprocess.run(script, cwd=PACKAGE.parent, capture_output=True, text=True, check=True)
    assert told.stdout == f"fracjax, version {fracjax.__version__}\n"
