"""The command line: what it writes and prints, and the one sentence it fails with."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest

import fracjax._diagnose
import fracjax._fit
from fracjax._blocks import EFFECTS, FOH
from fracjax._cli import heed_interrupt, run
from fracjax._cli._main import cli
from fracjax._diagnose import Axis, Candidate, Diagnosis, HeldOut
from fracjax._fit import Fit, load_model
from fracjax._io import read, write_text
from fracjax._models import MODELS
from fracjax._operators import Grid
from fracjax._report._text import noise_of

PACKAGE = Path(fracjax.__file__).parent
STEP = 0.01
FOLDER = Path("results")


@pytest.fixture(scope="module")
def loop(tmp_path_factory) -> str:
    """FOH's response over four periods, with noise, in a file."""
    drive = 50 - 45 * np.cos(2 * np.pi * STEP * np.arange(400))
    with jax.enable_x64(True):
        response = np.asarray(FOH(0.05, 0.05)(jax.numpy.asarray(drive), Grid(STEP)))
    path = tmp_path_factory.mktemp("cli") / "loop.csv"
    columns = {"time_s": STEP * np.arange(400), "voltage_V": drive}
    noise = np.random.default_rng(1).normal(0, 0.01, drive.size)
    write_text(path, {**columns, "displacement_um": response + noise})
    return str(path)


@pytest.fixture(scope="module")
def fitted(loop) -> Fit:
    """A real fit, quick: the fractional integral alone."""
    return fracjax._fit.fit(fracjax.parse_model("creep"), read(loop), starts=1)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Every test in an empty folder, with no cache of compiled programs."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "")


@pytest.fixture
def quick(monkeypatch, fitted):
    """Fits and diagnoses that take no time, and what they were called with."""
    calls: list[dict] = []

    def fit(model, recordings, *, progress, **options):
        progress("fitting")
        calls.append({"model": model, "recordings": recordings, **options})
        scores = replace(fitted.scores, bic=float(len(calls)))
        return replace(fitted, model=replace(fitted.model, name=model.name), scores=scores)

    def diagnose(model, recordings, *, progress, **options):
        progress("diagnosing")
        calls.append({"model": model, "recordings": recordings, **options})
        return diagnosis_of(fitted)

    monkeypatch.setattr(fracjax._fit, "fit", fit)
    monkeypatch.setattr(fracjax._diagnose, "diagnose", diagnose)
    return calls


def diagnosis_of(fitted: Fit) -> Diagnosis:
    """A diagnosis that found nothing."""
    return Diagnosis(
        verdict="none",
        sentence="Model and recording agree.",
        base=fitted,
        extended=None,
        effects=(),
        candidates=(Candidate("delay", "drive", 1.0, -1.0, 0.1, 0.5, "no need"),),
        axes=(Axis("time", "s", np.arange(5.0), np.ones(4), 3.0, (), 0.5),),
        where="Nowhere does the residual stand out from the noise.",
        noise=noise_of(fitted),
        numerics=0.01,
        p_value=0.4,
        held_out=HeldOut("stretches set aside in turn", 0.1, None, (0.1,), (), ""),
        next_experiment=None,
        warnings=(),
    )


def failure(capsys, status: int = 2) -> str:
    """The one sentence on stderr, nothing being on stdout."""
    out, err = capsys.readouterr()
    assert out == "" or status != 2
    assert err.count("\n") == 1
    assert err.endswith(".\n")
    assert "Traceback" not in err
    return err.strip()


def written() -> set[str]:
    return {path.name for path in FOLDER.iterdir()}


# Calls that cannot be used ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("", "fracjax: Missing command; see fracjax --help."),
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


# fit ----------------------------------------------------------------------------------------------


def test_fit_for_real(loop, capsys):
    assert run(["fit", loop, "--model", "creep", "--out", "results"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("creep describes loop.csv, with an error of ")
    assert err == ""
    assert written() == {"fit.json", "report.html"}
    assert set(load_model(FOLDER / "fit.json").parameters) == {"k_c", "mu"}


def test_options_reach_the_fit(loop, quick):
    call = ["fit", loop, loop, "--model", "foh", "--out", "results", "--history", "rest"]
    assert run([*call, "--settle", "250ms", "--seed", "3", "--input-unit", "mV"]) == 0
    (told,) = quick
    assert (told["history"], told["settling"], told["seed"]) == ("rest", "250ms", 3)
    assert [recording.drive_unit for recording in told["recordings"]] == ["mV", "mV"]


def test_several_models_are_compared(loop, quick, capsys):
    models = ["--model", "foh >> creep", "--model", "lfdh", "--model", "lfdh"]
    assert run(["fit", loop, *models, "--out", "results"]) == 0
    files = {"fit.json", "fit_foh-then-creep.json", "fit_lfdh.json", "comparison.json"}
    assert written() == files | {"report.html"}
    out, _ = capsys.readouterr()
    assert out.startswith("foh >> creep describes loop.csv best of 2 models by BIC")
    assert (FOLDER / "fit.json").read_text() == (FOLDER / "fit_foh-then-creep.json").read_text()


def test_what_is_asked_of_parameters_and_samples_reaches_the_fit(loop, quick):
    call = ["fit", loop, "--model", "foh", "--out", "results", "--loss", "huber"]
    asked = ["--fix", "k_p=0", "--bound", "beta=-0.2..0", "--prior", "alpha=0.1+-0.02"]
    more = ["--tie", "k_l=2*k_h", "--own", "k_h", "--mask", "0.1 s..0.2 s", "--mask", "1..2"]
    assert run([*call, *asked, *more]) == 0
    (told,) = quick
    assert (told["fixed"], told["bounds"]) == ({"k_p": 0.0}, {"beta": (-0.2, 0.0)})
    assert float(told["priors"]["alpha"].sd) == 0.02
    assert (told["tied"], told["own"]) == ({"k_l": ("k_h", 2.0)}, ("k_h",))
    assert told["mask"] == ((0.1, 0.2), (1.0, 2.0))
    assert told["loss"] == "huber"


def test_of_several_models_each_takes_what_speaks_of_its_parameters(loop, quick):
    call = ["fit", loop, "--model", "foh", "--model", "lfdh", "--out", "results"]
    assert run([*call, "--fix", "k_p=0", "--fix", "mu=0.2", "--fix", "wumpus=1"]) == 0
    assert [told["fixed"] for told in quick] == [
        {"k_p": 0.0, "wumpus": 1.0},
        {"mu": 0.2, "wumpus": 1.0},
    ]


def test_a_fit_with_options_for_real(loop, capsys):
    call = ["fit", loop, "--model", "creep", "--out", "results", "--loss", "student_t"]
    asked = ["--fix", "mu=0.02", "--mask", "0 s..0.5 s", "--profile", "k_c", "--holdout", loop]
    assert run([*call, *asked]) == 0
    out, _ = capsys.readouterr()
    assert "RMSE, held-out data" in out
    assert "Profile of k_c: 95 % from" in out
    assert "The residual is " in out
    told = json.loads((FOLDER / "fit.json").read_text())
    assert told["samples_left_out"] == [51]
    assert told["loss"]["name"] == "student_t"
    assert [profile["name"] for profile in told["profiles"]] == ["k_c"]
    page = (FOLDER / "report.html").read_text()
    for said in ("What is left over", "Profiles: how", "51 samples more were left out", "Held out"):
        assert said in page
    assert written() == {"fit.json", "comparison.json", "report.html"}


def test_json_is_all_that_is_printed(loop, quick, capsys):
    assert run(["fit", loop, "--model", "lfdh", "--out", "results", "--json"]) == 0
    one = json.loads(capsys.readouterr().out)
    assert one == json.loads((FOLDER / "fit.json").read_text())
    models = ["--model", "foh", "--model", "lfdh"]
    assert run(["fit", loop, *models, "--out", "results", "--json"]) == 0
    several = json.loads(capsys.readouterr().out)
    assert (several["best"], [row["bic"] for row in several["fits"]]) == ("foh", [2.0, 3.0])


@pytest.mark.parametrize("command", ["fit", "diagnose"])
def test_quiet(loop, quick, capsys, command):
    assert run([command, loop, "--model", "foh", "--out", "results", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("call", ["info LOOP", "models", "effects", "effects creep"])
def test_quiet_lists_say_nothing(call, loop, capsys):
    assert run([*call.replace("LOOP", loop).split(), "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_without_convergence_the_best_point_is_kept(loop, quick, fitted, monkeypatch, capsys):
    failed = replace(fitted, converged=False)
    monkeypatch.setattr(fracjax._fit, "fit", lambda *_, **__: failed)
    assert run(["fit", loop, "--model", "creep", "--out", "results", "--quiet"]) == 3
    assert failure(capsys, 3) == (
        "The fit of creep did not converge; its best point was saved in results."
    )
    assert written() == {"fit.json", "report.html"}


def test_an_interrupt_keeps_what_is_finished(loop, quick, monkeypatch, capsys):
    whole = fracjax._fit.fit

    def interrupted(model, *rest, **options):
        if model.name == "lfdh":
            raise KeyboardInterrupt
        return whole(model, *rest, **options)

    monkeypatch.setattr(fracjax._fit, "fit", interrupted)
    call = ["fit", loop, "--model", "foh", "--model", "lfdh", "--out", "results"]
    assert run(call) == 130
    assert "Interrupted; kept results/fit_foh.json." in capsys.readouterr().err
    assert written() == {"fit_foh.json"}
    assert run(["fit", loop, "--model", "lfdh", "--out", "other"]) == 130
    assert "nothing had been written yet" in capsys.readouterr().err
    assert not Path("other").exists()


def test_an_interrupt_is_not_lost_in_the_garbage_collector(monkeypatch):
    class Swallows:
        def __del__(self):
            raise KeyboardInterrupt

    def work():
        Swallows()
        for _ in range(100):
            time.sleep(0.02)

    monkeypatch.setattr(sys, "unraisablehook", heed_interrupt)
    # A shell lets what it starts in the background ignore the signal.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            work()
    finally:
        signal.signal(signal.SIGINT, before)


# diagnose, demo -----------------------------------------------------------------------------------


def test_diagnose(loop, quick, capsys):
    options = ["--holdout", loop, "--repeat", loop, "--noise", "70 nm", "--settle", "0"]
    options += ["--mask", "10 ms..20 ms", "--mask", "1 s..2 s"]
    assert run(["diagnose", loop, "--model", "foh", "--out", "results", *options]) == 0
    (told,) = quick
    assert told["mask"] == ((0.01, 0.02), (1.0, 2.0))
    assert told["noise"] == "70 nm"
    assert told["settling"] == "0"
    assert told["history"] is None
    assert told["holdout"].source == loop
    assert [each.source for each in told["repeat"]] == [loop]
    out, err = capsys.readouterr()
    assert out.startswith("Model and recording agree.\n")
    assert "RMSE, held-out data" in out
    assert "Nowhere does the residual" in out
    assert err == ""
    assert written() == {"diagnosis.json", "fit.json", "report.html"}


def test_diagnose_as_json(loop, quick, capsys):
    assert run(["diagnose", loop, "--model", "foh", "--out", "results", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((FOLDER / "diagnosis.json").read_text())


def test_demo(quick, capsys):
    assert run(["demo"]) == 0
    (told,) = quick
    assert told["model"].name == "foh"
    assert len(told["recordings"][0]) == 3900
    assert told["holdout"].source.endswith("heldout.csv")
    out, _ = capsys.readouterr()
    assert "s  diagnosing" in out
    assert out.rstrip().endswith("fracjax-demo/report.html")


# simulate -----------------------------------------------------------------------------------------


def test_simulate_what_was_fitted(loop, fitted):
    fitted.save("fit.json")
    assert run(["simulate", loop, "--fit", "fit.json", "--out", "s.csv", "--quiet"]) == 0
    simulated = read("s.csv")
    recording = read(loop)
    np.testing.assert_array_equal(simulated.drive, recording.drive)
    assert (simulated.drive_unit, simulated.response_unit) == ("V", "um")
    if fitted.preparation.takes[0].history == "constant":
        expected = fitted.simulations[0]
        span = np.ptp(expected)
        np.testing.assert_allclose(simulated.response, expected, atol=1e-3 * span)


def test_simulate_needs_the_drive_alone_and_minds_its_unit(fitted, capsys):
    fitted.save("fit.json")
    times = STEP * np.arange(200)
    volts = 50 * np.sin(times) ** 2
    write_text("volts.csv", {"time_s": times, "voltage_V": volts})
    write_text("millivolts.csv", {"voltage_mV": 1000 * volts})
    assert run(["simulate", "volts.csv", "--fit", "fit.json", "--out", "a.csv"]) == 0
    call = ["simulate", "millivolts.csv", "--rate", "100Hz", "--fit", "fit.json", "--out", "b.csv"]
    assert run([*call, "--history", "rest"]) == 0
    a, b = read("a.csv"), read("b.csv")
    np.testing.assert_allclose(a.drive, b.drive, rtol=1e-12)
    np.testing.assert_allclose(a.response, b.response, rtol=1e-6, atol=1e-9)
    write_text("metres.csv", {"time_s": times, "drive_m": volts})
    capsys.readouterr()
    assert run(["simulate", "metres.csv", "--fit", "fit.json", "--out", "c.csv"]) == 2
    assert "expected a value in V" in failure(capsys)


@pytest.mark.parametrize("model", ["foh", "bouc_wen"])
@pytest.mark.parametrize("history", ["constant", "periodic"])
def test_simulate_at_nominal_values(loop, model, history, capsys):
    call = ["simulate", loop, "--model", model, "--out", "s.csv", "--output-unit", "nm", "--json"]
    assert run([*call, "--history", history]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["error"] < 1e-3
    response = read("s.csv").response
    assert told["range"] == [response.min(), response.max()]
    if history == "periodic":
        np.testing.assert_allclose(response[:100], response[-100:], rtol=1e-3, atol=1e-2)


# info, models, effects ----------------------------------------------------------------------------


def test_info(loop, capsys):
    assert run(["info", loop]) == 0
    text = capsys.readouterr().out
    for said in ("400 at 100 Hz", "sine, 5 to 95 V", "1 s, 4 repeats", "% of the stroke"):
        assert said in text
    assert run(["info", loop, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["noise"]["method"] == "repeats"
    assert told["noise"]["sigma"] == pytest.approx(0.01, rel=0.2)


def test_models_lists_all(capsys):
    assert run(["models", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [law["name"] for law in listed] == list(MODELS)
    assert all(law["sentence"] and law["equation"] and law["parameters"] for law in listed)
    assert run(["models"]) == 0
    assert all(name in capsys.readouterr().out for name in ("foh",))


def test_effects_lists_all(capsys):
    assert run(["effects"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in EFFECTS)


@pytest.mark.parametrize("name", EFFECTS)
def test_effects_tells_all_about_one(name, capsys):
    assert run(["effects", name]) == 0
    text = " ".join(capsys.readouterr().out.split())
    effect = EFFECTS[name]
    assert effect.equation.split()[0] in text
    assert all(other in text for other in effect.separated_by)
    assert run(["effects", name, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["sentence"] == effect.sentence
    assert told["parameters"]
