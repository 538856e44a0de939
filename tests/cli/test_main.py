"""Calls that cannot be used, help, completion, and the program itself."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rich.progress import Progress

import fracjax._diagnose
from fracjax._cli import run
from fracjax._cli._main import cli
from fracjax._cli._progress import _BRIEF, _SOON, announced, chain_bar, stages, until
from fracjax._cli._tables import print_text
from fracjax._computing import map_in_threads
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


def test_a_bare_call_says_where_to_begin(capsys):
    assert run([]) == 0
    text = capsys.readouterr().out
    assert text.startswith("Usage: fracjax")
    for command in ("fracjax info FILE", "fracjax diagnose FILE --model foh", "fracjax demo"):
        assert command in text


def test_results_of_another_call_are_not_overwritten(loop, quick, capsys):
    other = str(Path(loop).with_name("other.csv"))
    Path(other).write_bytes(Path(loop).read_bytes())
    fit, diagnose = (["fit", "--model", "foh", loop], ["diagnose", "--model", "foh", loop])
    assert run([*fit, "--out", "results", "--quiet"]) == 0
    page = Path("results/report.html").read_text()
    for call in (
        [*diagnose, "--out", "results"],
        ["fit", "--model", "foh", other, "--out", "results"],
        ["fit", "--model", "lfdh", loop, "--out", "results"],
    ):
        calls = len(quick)
        assert run(call) == 2
        assert "--out results: expected an empty folder, or earlier results of" in failure(capsys)
        assert len(quick) == calls  # said at once, and not after the work
        assert Path("results/report.html").read_text() == page
    # The same call again replaces its own results, and one with more models keeps all of them.
    assert run([*fit, "--out", "results", "--quiet"]) == 0
    assert run([*fit, "--model", "lfdh", "--out", "results", "--quiet"]) == 0
    assert run([*diagnose, "--out", "other", "--quiet"]) == 0


def test_files_of_others_in_the_folder_do_not_hinder(loop, quick):
    Path("results").mkdir()
    Path("results/fit.json").write_text("my own notes")
    Path("results/notes.txt").write_text("more")
    assert run(["fit", "--model", "foh", loop, "--out", "results", "--quiet"]) == 0
    assert Path("results/notes.txt").read_text() == "more"


def test_a_stage_that_lasts_is_a_line_where_there_is_no_terminal(capsys):
    with stages(quiet=False) as progress:
        progress("a brief one")
        progress("a long one")
        time.sleep(1.5 * _BRIEF)
    assert re.fullmatch(r" *\d+\.\d s  a long one\n", capsys.readouterr().err)
    with stages(quiet=True) as progress:
        progress("a long one")
        time.sleep(1.5 * _BRIEF)
    assert capsys.readouterr().err == ""


def test_a_stage_that_lasts_longer_says_so_again_with_what_is_done_of_its_round(
    capsys, monkeypatch
):
    monkeypatch.setattr("fracjax._cli._progress._PAUSE", 0.3)
    with stages(quiet=False) as progress:
        progress("fitting foh")
        map_in_threads(lambda k: time.sleep(0.2), range(20))
    first, *others = capsys.readouterr().err.splitlines()
    assert re.fullmatch(
        r" *\d+\.\d s  fitting foh; \d+ of 20, about \d+ s more of this round", first
    )
    assert others
    for line in others:
        assert re.match(r" *\d+\.\d s  still fitting foh", line)


def test_a_limit_counts_down_beside_the_present_stage(monkeypatch):
    clock = iter((0.0, 30.0, 130.0))
    monkeypatch.setattr("fracjax._cli._progress.time.monotonic", lambda: next(clock))
    column, bars = until(120.0), Progress()
    bars.add_task("a stage", total=1)
    (task,) = bars.tasks
    assert [column.render(task).plain for _ in range(2)] == ["limit in 90 s", "limit in 0 s"]
    bars.update(task.id, completed=1)
    assert column.render(task).plain == ""


def test_a_count_is_a_line_now_and_then_with_the_time_for_the_rest(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("fracjax._cli._progress.time.monotonic", lambda: now[0])
    with chain_bar(quiet=False, steps=100) as (_, count):
        for done in range(1, 7):
            now[0] += 4.0
            count(done, 100, "k = 1")
    # 4 s each from the first on; lines at 12 and at 24 s.
    assert capsys.readouterr().err.splitlines() == [
        "  12.0 s  3 of 100; about 388 s more; k = 1",
        "  24.0 s  6 of 100; about 376 s more; k = 1",
    ]


def test_on_a_terminal_lines_end_at_words(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    sentence = "A sentence that is rather longer than thirty columns of a terminal."
    print_text(sentence)
    assert capsys.readouterr().out == sentence + "\n"  # in a pipe it stays one line
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    print_text(sentence)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 1
    assert " ".join(line.strip() for line in lines) == sentence


@pytest.mark.parametrize(
    ("call", "most"), [(["-m", "fracjax", "--help"], 0.4), (["-c", "import fracjax"], 0.5)]
)
def test_a_cold_start_is_quick(call, most):
    """In seconds of the processor, which others on the machine do not change."""
    script = "import resource, subprocess, sys; subprocess.run([sys.executable, *sys.argv[1:]], "
    script += "stdout=subprocess.DEVNULL, check=True); "
    script += "print(sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2]))"
    runs = [
        float(subprocess.check_output([sys.executable, "-c", script, *call], text=True))
        for _ in range(3)
    ]
    assert min(runs) <= most


@pytest.mark.parametrize(
    ("call", "shown"),
    [
        (["fit", "a.csv"], "fracjax fit: loading and reading\n"),
        (["fit", "a.csv", "--quiet"], ""),
        (["info", "a.csv"], ""),
        ([], ""),
    ],
)
def test_a_command_on_a_terminal_says_soon_that_it_runs(call, shown, monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with announced(call):
        time.sleep(_SOON + 0.1)
    assert capsys.readouterr().err == shown


def test_a_command_that_is_done_says_nothing_more(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with announced(["fit", "a.csv"]):
        pass
    time.sleep(_SOON + 0.1)
    assert capsys.readouterr().err == ""


def test_info_and_help_do_without_jax(loop):
    script = (
        "import sys; from fracjax._cli import run; status = run(sys.argv[1:]); "
        "heavy = {'jax', 'equinox', 'pandas', 'matplotlib', 'bokeh', 'scipy.stats', 'scipy.signal'}"
        "; assert status == 0; assert not heavy & sys.modules.keys(), heavy & sys.modules.keys()"
    )
    for call in (["info", loop], ["--help"], ["fit", "--help"]):
        subprocess.run([sys.executable, "-c", script, *call], check=True)


def test_fits_and_diagnoses_import_no_library_that_they_do_not_use(loop, tmp_path):
    """Nor do the pages of diagnoses and protocols, which draw themselves."""
    script = (
        "import sys; from fracjax._cli import run; status = run(sys.argv[1:]); "
        "import fracjax._diagnose, fracjax._report._diagnosis_page; "
        "import fracjax._report._protocol_page; "
        "heavy = {'pandas', 'matplotlib', 'bokeh', 'scipy.stats', 'scipy.signal', 'arviz', "
        "'optimistix', 'jaxopt'}"
        "; assert status == 0; assert not heavy & sys.modules.keys(), heavy & sys.modules.keys()"
    )
    call = ["fit", loop, "--model", "foh", "--out", str(tmp_path / "out"), "--quiet"]
    subprocess.run([sys.executable, "-c", script, *call], check=True)
