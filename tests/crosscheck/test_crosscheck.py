"""Cross-check: searches against closed forms, five methods against one truth, and the warning."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fracjax as fj
from benchmarks.concealed.truth import BASES, OVER
from fracjax._blocks import LFDH
from fracjax._cli import run
from fracjax._fit import Crosscheck, _crosscheck
from fracjax._fit._box import (
    objective,
    with_bounded_gains,
    with_bounded_shapes,
    with_gradient,
)
from fracjax._fit._evolution import DifferentialEvolution
from fracjax._fit._layout import layout_of, placed, position_of
from fracjax._fit._least_squares import Objective
from fracjax._fit._swarm import ParticleSwarm
from fracjax._parameters import named_parameters, set_values
from fracjax._report import write_report
from fracjax._report._text import crosscheck_figures
from tests.helpers import specified

STEP, SAMPLES, SIGMA = 2e-3, 400, 5e-3
LAW = {"alpha": 0.45, "beta": -0.1, "k_l": 0.07, "k_h": 0.02, "k_p": 0.0}
HELD = {"k_p": 0.0, "beta": -0.1}
# Of negative orders the best, with k_h below 0, is a minimum of its own: it can catch a search that
# moves gains too.
KEPT = {"alpha": (0.0, 0.9)}
NOISE = specified(SIGMA)
SEARCHES = (ParticleSwarm(40, 300), DifferentialEvolution(40, 300))
SIZE = 3


def recording() -> fj.Recording:
    """FOH under three tones, simulated by other numerics on a grid 32 times finer."""
    times = np.arange((SAMPLES - 1) * OVER + 1) * STEP / OVER
    parts = ((15, 1.3, 0.0), (10, 4.1, 1.0), (6, 11.7, 2.0))
    drive = 40 + np.sum([a * np.sin(2 * np.pi * f * times + p) for a, f, p in parts], axis=0)
    clean = BASES["foh"].response(drive, STEP / OVER, LAW)[::OVER]
    noise = SIGMA * np.random.default_rng(0).standard_normal(SAMPLES)
    return fj.Recording(drive[::OVER], clean + 1.0 + noise, STEP, source="three_tones.csv")


def check(seed: int = 0, population: int = 40, iterations: int = 400) -> Crosscheck:
    return fj.crosscheck(
        fj.parse_model("foh"),
        recording(),
        noise=NOISE,
        fixed=HELD,
        bounds=KEPT,
        starts=2,
        population=population,
        iterations=iterations,
        seed=seed,
    )


@eqx.filter_jit
def cost_at(block, problems, position):
    return objective(block, problems)(jnp.asarray(position))


@eqx.filter_jit
def response_to(block, problem):
    return problem.simulate(block)


@pytest.fixture(scope="module")
def checked() -> Crosscheck:
    return check()


# Searches on functions whose least value is known -------------------------------------------------


def bowl(x, target):
    """Convex and badly scaled, 0 at the target."""
    return jnp.sum(jnp.asarray([1.0, 30.0, 1e3]) * (x - target) ** 2)


def rastrigin(x, target):
    """0 at the target, and a local minimum near each point of a grid around it."""
    z = 8 * (x - target)
    return jnp.sum(z**2 + 10 - 10 * jnp.cos(2 * jnp.pi * z))


def broken(x, target):
    """Half of the cube infinite, as `objective` makes what is not a number."""
    return jnp.where(x[0] < 0.5, jnp.inf, bowl(x, target))


FUNCTIONS = (bowl, rastrigin, broken)


@eqx.filter_jit
def ended(search, which, target, draws):
    """A search's end; a point outside the unit cube would win at once."""

    def fenced(x):
        value = jax.lax.switch(which, FUNCTIONS, x, target)
        return jnp.where(jnp.any((x < 0) | (x > 1)), -1e6, value)

    return search(fenced, draws)


def least(search, function, target, seed):
    which = jnp.asarray(FUNCTIONS.index(function))
    draws = search.draw(SIZE, np.random.default_rng(seed))
    return ended(search, which, jnp.asarray(target), draws)


@pytest.mark.parametrize("search", SEARCHES, ids=lambda s: type(s).__name__)
@pytest.mark.parametrize("function", [bowl, rastrigin])
def test_the_least_of_a_known_function_is_found(search, function):
    target = np.array([0.31, 0.62, 0.47])
    found = least(search, function, target, 0)
    assert 0 <= found.cost < 1e-8
    np.testing.assert_allclose(found.position, target, atol=1e-5)
    assert found.evaluations == 40 * 300
    assert found.cost == pytest.approx(float(function(found.position, target)), abs=1e-15)


@pytest.mark.parametrize("search", SEARCHES, ids=lambda s: type(s).__name__)
@given(target=st.lists(st.floats(-1, 2), min_size=SIZE, max_size=SIZE), seed=st.integers(0, 999))
@settings(max_examples=25)
def test_no_search_leaves_the_cube_and_each_finds_the_least_in_it(search, target, seed):
    found = least(search, bowl, target, seed)
    assert np.all((found.position >= 0) & (found.position <= 1))
    exact = float(bowl(np.clip(target, 0, 1), np.array(target)))
    assert exact * (1 - 1e-12) <= found.cost <= exact * (1 + 1e-3) + 1e-6


@pytest.mark.parametrize("search", SEARCHES, ids=lambda s: type(s).__name__)
def test_a_search_goes_around_where_the_model_breaks_down(search):
    found = least(search, broken, [0.2, 0.6, 0.5], 1)
    np.testing.assert_allclose(found.position, [0.5, 0.6, 0.5], atol=1e-4)


def test_three_others_are_drawn_evenly_and_never_twice():
    """Each of the 5 · 4 · 3 triples of six members' others, about 1,000 times of 60,000."""
    others = DifferentialEvolution(6, 60_000).draw(1, np.random.default_rng(0)).others
    assert others.shape == (60_000, 6, 3)
    for member in range(6):
        triples, counts = np.unique(others[:, member], axis=0, return_counts=True)
        assert len(triples) == 60
        assert all(len({member, *triple}) == 4 for triple in triples.tolist())
        assert np.sum((counts - 1000) ** 2 / 1000) < 110  # chi-square of 59, p = 1e-4 at 107


# The unit cube ------------------------------------------------------------------------------------


@given(st.lists(st.floats(0, 1), min_size=3, max_size=3))
def test_the_cube_spans_the_bounds_and_no_more(shares):
    block = LFDH()
    moved = placed(block, jnp.asarray(shares))
    for name, size in layout_of(block).shapes:
        parameter = named_parameters(moved)[name]
        assert size == 1
        slack = 1e-12 * abs(parameter.upper)
        assert parameter.lower - slack <= parameter.value <= parameter.upper + slack
    np.testing.assert_allclose(position_of(moved), shares, atol=1e-9)


@pytest.mark.parametrize("end", [0.0, 1.0])
def test_the_corners_are_the_bounds(end):
    moved = named_parameters(placed(LFDH(), jnp.full(3, end)))
    for name, _ in layout_of(LFDH()).shapes:
        bound = moved[name].upper if end else moved[name].lower
        assert float(moved[name].value) == pytest.approx(float(bound), rel=1e-12)


def test_the_objective_is_least_squares_over_the_gains(checked):
    """Against NumPy's lstsq on the columns that unit gains give."""
    block, problems = checked.fit.model.block, checked.fit.preparation.problems()
    shaped = placed(block, jnp.asarray([0.63]))
    (problem,) = problems
    columns = [
        response_to(set_values(shaped, {"k_l": 0.0, "k_h": 0.0} | {name: 1.0}), problem)
        for name in ("k_l", "k_h")
    ]
    used = np.s_[:SAMPLES]
    basis = np.stack([*(np.asarray(c)[used] for c in columns), np.ones(SAMPLES)], axis=1)
    response = np.asarray(problem.response)[used]
    left = response - basis @ np.linalg.lstsq(basis, response, rcond=None)[0]
    found = cost_at(block, problems, np.array([0.63]))
    assert float(found) == pytest.approx(np.sum((left / SIGMA) ** 2), rel=1e-9)


def test_the_gradient_is_that_of_finite_differences(checked):
    block, problems = checked.fit.model.block, checked.fit.preparation.problems()

    def cost(share):
        return float(with_gradient(block, problems, jnp.asarray([share]))[0])

    slope = float(with_gradient(block, problems, jnp.asarray([0.55]))[1][0])
    assert slope == pytest.approx((cost(0.55 + 1e-5) - cost(0.55 - 1e-5)) / 2e-5, rel=1e-6)
    assert cost(0.55) == pytest.approx(float(cost_at(block, problems, np.array([0.55]))))


def test_gains_are_bounded_by_what_spans_the_response(checked):
    block, problems = checked.fit.model.block, checked.fit.preparation.problems()
    freed = with_bounded_gains(block, problems)
    assert layout_of(freed).gains == ()
    assert {n for n, _ in layout_of(freed).shapes} == {"alpha", "k_l", "k_h"}
    taken = recording()
    reach = 3 * np.ptp(taken.response) / np.ptp(taken.drive)  # k_l's column is the drive itself
    assert checked.bounds["k_l"] == pytest.approx((-reach, reach), rel=1e-6)


# One truth, all methods ---------------------------------------------------------------------------


def test_all_methods_agree_on_a_truth_of_other_numerics(checked):
    noise = SIGMA * np.sqrt(
        np.mean(np.random.default_rng(0).standard_normal(SAMPLES) ** 2) * (1 - 4 / SAMPLES)
    )
    best = min(row.rmse for row in checked.rows)
    assert best == pytest.approx(noise, rel=0.03)
    assert [row.method for row in checked.rows] == [
        "gradient fit", "bounded L-BFGS", "PSO, gains eliminated", "PSO, all parameters",
        "DE, gains eliminated", "DE, all parameters",
    ]  # fmt: skip
    for row in checked.rows:
        assert row.agrees, row.method
        assert row.rmse <= 1.0001 * best, row.method
        # The noise is white: what was minimised is the e_RMS itself.
        assert row.over_best == pytest.approx(row.rmse / best, rel=1e-6)
        assert row.e_r == pytest.approx(row.rmse / np.std(recording().response), rel=1e-6)
        assert row.seconds > 0
        assert row.parameters["alpha"] == pytest.approx(LAW["alpha"], abs=0.02)
    assert checked.warning is None
    assert checked.fit.warnings == ()
    assert checked.best.method == "gradient fit"


def test_every_value_keeps_its_bounds(checked):
    assert checked.bounds.keys() == checked.units.keys() == {"alpha", "k_l", "k_h"}
    assert checked.bounds["alpha"] == KEPT["alpha"]
    for row in checked.rows:
        for name, (low, high) in checked.bounds.items():
            assert low <= row.parameters[name] <= high, (row.method, name)


def test_evaluations_are_counted(checked):
    counts = {row.method: row.evaluations for row in checked.rows}
    assert {count for name, count in counts.items() if name[:2] in ("PS", "DE")} == {16_000}
    assert 2 <= counts["gradient fit"] < 100
    assert 2 <= counts["bounded L-BFGS"] < 200
    assert [row.derivatives for row in checked.rows] == [True, True, False, False, False, False]


def test_the_same_seed_gives_the_same_rows_and_another_seed_others(checked):
    again, other = check(), check(seed=1)
    for row, same, different in zip(checked.rows, again.rows, other.rows, strict=True):
        assert row.parameters == same.parameters
        if not row.derivatives:
            assert row.parameters != different.parameters
        if "all parameters" not in row.method:
            assert different.agrees


# A gradient fit that is not at the optimum --------------------------------------------------------


@pytest.fixture(scope="module")
def sabotaged(checked) -> Crosscheck:
    """The gradient fit stopped at its first point."""

    def stopped(block, preparation, starts, seed):
        problems = preparation.problems()
        cost = cost_at(block, problems, position_of(block))
        return _crosscheck.solved_at(
            Objective(block, problems), position_of(block), preparation,
            converged=True, costs=(float(cost),), evaluations=1,
        )  # fmt: skip

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_crosscheck, "fit_block", stopped)
        return check()


def test_a_gradient_fit_that_is_beaten_carries_a_warning(sabotaged, tmp_path):
    gradient = sabotaged.rows[0]
    assert not gradient.agrees
    assert gradient.over_best > 1.01
    assert sabotaged.best.method == "bounded L-BFGS"
    assert "gradient fit of foh is not at the optimum" in sabotaged.warning
    assert sabotaged.fit.warnings == (sabotaged.warning,)
    sabotaged.fit.save(tmp_path / "fit.json")
    saved = json.loads((tmp_path / "fit.json").read_text(encoding="utf-8"))
    assert saved["warnings"] == [sabotaged.warning]
    assert fj.load_model(tmp_path / "fit.json").name == "foh"


def test_the_report_holds_the_table_and_the_warning(checked, sabotaged, tmp_path):
    write_report(sabotaged, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for cell in ("Cross-check of three_tones.csv", "DE, all parameters", "not at the optimum"):
        assert cell in page
    assert f"<strong>{sabotaged.warning}</strong>" in page
    write_report(checked, tmp_path / "report.html")
    assert "not at the optimum" not in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_report_tells_of_an_estimated_past(checked, tmp_path):
    (take,) = checked.fit.preparation.takes
    preparation = replace(checked.fit.preparation, takes=(replace(take, history="estimated"),))
    fit = replace(checked.fit, preparation=preparation)
    write_report(replace(checked, fit=fit), tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "before the first sample another drive, whose memory the fit estimates" in page


def test_saved_as_plain_data(checked, tmp_path):
    checked.save(tmp_path / "crosscheck.json")
    told = json.loads((tmp_path / "crosscheck.json").read_text(encoding="utf-8"))
    assert told["schema"] == "fracjax.crosscheck/1"
    assert told == json.loads(json.dumps(checked.to_dict()))
    assert told["rows"][0]["parameters"] == checked.rows[0].parameters
    assert told["best"] == "gradient fit"


# The command --------------------------------------------------------------------------------------


@pytest.fixture
def loop(empty_folder) -> str:
    """A recording's file, in an empty folder."""
    taken = recording()
    signals = {"voltage_V": taken.drive, "displacement_um": taken.response}
    fj.write("loop.csv", {"time_s": taken.times} | signals)
    return "loop.csv"


def answer(monkeypatch, result: Crosscheck) -> list[dict]:
    """Let the command find this, and note what it asked."""
    calls: list[dict] = []

    def crosscheck(model, recordings, *, progress, **options):
        progress("fitting")
        calls.append({"model": model.name, "recordings": recordings, **options})
        return result

    monkeypatch.setattr(fj._fit, "crosscheck", crosscheck)
    return calls


def test_the_command_prints_one_table(loop, checked, monkeypatch, capsys):
    calls = answer(monkeypatch, checked)
    asked = ["--fix", "beta=-0.1", "--bound", "alpha=0..0.5", "--mask", "1 s..1.1 s"]
    call = ["crosscheck", loop, "--model", "foh", "--seed", "7", "--settle", "0.1 s"]
    assert run([*call, *asked]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out.startswith("foh on three_tones.csv: no method finds less than the gradient fit's")
    assert "5 of 5 others end at it" in out
    heads, rows = crosscheck_figures(checked)
    assert {len(row) for row in rows} == {len(heads)}
    for label in ("e_RMS", "e_r", "alpha", "k_h", "evaluations", "seconds", "agrees"):
        assert f"\n{label} " in out
    assert "Written" not in out
    assert calls[0] | {"recordings": None} == {
        "model": "foh", "recordings": None, "history": None, "settling": "0.1 s", "seed": 7,
        "fixed": {"beta": -0.1}, "bounds": {"alpha": (0.0, 0.5)}, "mask": ((1.0, 1.1),),
    }  # fmt: skip
    assert [path.name for path in Path.cwd().iterdir()] == ["loop.csv"]


def test_the_command_writes_and_prints_json(loop, sabotaged, monkeypatch, capsys):
    answer(monkeypatch, sabotaged)
    call = ["crosscheck", loop, loop, "--model", "foh", "--out", "results"]
    assert run([*call, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads(Path("results/crosscheck.json").read_text(encoding="utf-8"))
    assert {p.name for p in Path("results").iterdir()} == {
        "crosscheck.json", "fit.json", "report.html",
    }  # fmt: skip
    assert run(call) == 0
    assert f"Warning: {sabotaged.warning}" in capsys.readouterr().out
    assert run([*call, "--quiet"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("options", "kept"), [([], "nothing was saved"), (["--out", "results"], "was saved in results")]
)
def test_a_gradient_fit_without_convergence_ends_with_3(
    options, kept, loop, checked, monkeypatch, capsys
):
    answer(monkeypatch, replace(checked, fit=replace(checked.fit, converged=False)))
    assert run(["crosscheck", loop, "--model", "foh", *options]) == 3
    err = capsys.readouterr().err
    assert err.startswith("The fit of foh did not converge")
    assert kept in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("crosscheck", "Missing argument 'RECORDING...'"),
        ("crosscheck loop.csv", "Missing option '--model'"),
        ("crosscheck none.csv --model foh", "none.csv: expected a file"),
        ("crosscheck loop.csv --model nope", 'model "nope": expected names'),
        ("crosscheck loop.csv --model foh --settle 9s", "--settle: expected a time"),
    ],
)
def test_unusable_calls(call, said, loop, capsys):
    assert run(call.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == 1


# What cannot be checked ---------------------------------------------------------------------------


def test_a_linear_fit_is_refused():
    model = fj.parse_model("foh")
    with pytest.raises(fj.InputError, match=r"foh: expected a free parameter that is no gain"):
        fj.crosscheck(model, recording(), fixed=HELD | {"alpha": 0.1})


def test_a_masked_stretch_counts_in_no_search():
    """All methods minimise over the same samples: none ends above the others for a spoilt one."""
    clean = recording()
    response = clean.response.copy()
    spoilt = (clean.times >= 0.5) & (clean.times <= 0.6)
    response[spoilt] += 100.0
    found = fj.crosscheck(
        fj.parse_model("foh"), replace(clean, response=response), noise=NOISE, fixed=HELD,
        bounds=KEPT, mask=[(0.5, 0.6)], starts=2, population=8, iterations=40,
    )  # fmt: skip
    assert found.fit.preparation.takes[0].used.sum() == np.count_nonzero(~spoilt)
    eliminated = [row for row in found.rows if "all parameters" not in row.method]
    assert all(row.over_best < 1.1 for row in eliminated)
    assert found.rows[0].rmse < 1.1 * NOISE.sigma


def test_what_the_searches_do_not_know_is_refused():
    with pytest.raises(fj.InputError, match=r"found priors; the searches know none"):
        fj.crosscheck(
            fj.parse_model("foh"),
            recording(),
            priors={"alpha": fj.Normal(0.1, 0.1)},  # type: ignore[call-arg]
        )


@pytest.mark.parametrize("sizes", [{"population": 3}, {"iterations": 0}])
def test_a_search_of_no_size_is_refused(sizes):
    with pytest.raises(fj.InputError, match=r"expected a population of at least 4"):
        check(**sizes)


def test_without_jaxopt_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "jaxopt", None)
    with pytest.raises(fj.InputError, match=r"jaxopt: expected.*pip install jaxopt"):
        check()


def test_jaxopt_is_met_in_one_place_and_silently():
    script = (
        "import sys, fracjax; fracjax.crosscheck\n"
        "assert 'jaxopt' not in sys.modules\n"
        "from fracjax._fit._bounded import require_jaxopt\n"
        "assert require_jaxopt().__name__ == 'jaxopt'\n"
    )
    told = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning", "-c", script],
        cwd=Path(fj.__file__).parents[1],
        capture_output=True,
        text=True,
        check=False,
    )
    assert told.returncode == 0, told.stderr
    package = Path(fj.__file__).parent
    files = [p for p in package.rglob("*.py") if "import jaxopt" in p.read_text(encoding="utf-8")]
    assert [path.name for path in files] == ["_bounded.py"]


def test_a_second_gain_in_a_row_is_searched_between_bounds():
    """No bounds are physical for it, and without any there is no cube to search."""
    block = fj.parse_model("foh >> lfdh").block
    fitted = set_values(block, {"second.k_0": 2.0})
    bounded = named_parameters(with_bounded_shapes(block, fitted))
    assert all(bounded[name].bounded for name, _ in layout_of(block).shapes)
    assert float(bounded["second.k_0"].upper) == 6.0
    own = abs(float(named_parameters(block)["second.k_delta"].value))
    assert float(bounded["second.k_delta"].lower) == pytest.approx(-3 * own)
    assert float(bounded["first.alpha"].upper) == float(
        named_parameters(block)["first.alpha"].upper
    )
