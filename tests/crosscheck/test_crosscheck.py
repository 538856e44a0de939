"""Five methods against one truth, their bounds and counts, and the warning."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._crosscheck._box import cost_and_gradient, with_bounded_gains, with_bounded_shapes
from fracjax._parameters import named_parameters, set_values
from fracjax._prepare._layout import layout_of, with_shapes_at
from fracjax._report import write_report
from tests.crosscheck.helpers import (
    FEW,
    HELD,
    KEPT,
    LAW,
    NOISE,
    SAMPLES,
    SIGMA,
    check,
    cost_at,
    recording,
)


@eqx.filter_jit
def response_to(block, problem):
    return problem.simulate(block)


def test_the_objective_is_least_squares_over_the_gains(checked):
    """Against NumPy's lstsq on the columns that unit gains give."""
    block, problems = checked.fit.model.block, checked.fit.preparation.problems()
    shaped = with_shapes_at(block, jnp.asarray([0.63]))
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
        return float(cost_and_gradient(block, problems, jnp.asarray([share]))[0])

    slope = float(cost_and_gradient(block, problems, jnp.asarray([0.55]))[1][0])
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
    assert {count for name, count in counts.items() if name[:2] in ("PS", "DE")} == {7_200}
    assert 2 <= counts["gradient fit"] < 100
    assert 2 <= counts["bounded L-BFGS"] < 200
    assert [row.derivatives for row in checked.rows] == [True, True, False, False, False, False]


def test_the_same_seed_gives_the_same_rows_and_another_seed_others():
    once, again, other = check(**FEW), check(**FEW), check(seed=1, **FEW)
    for row, same, different in zip(once.rows, again.rows, other.rows, strict=True):
        assert row.parameters == same.parameters
        if not row.derivatives:
            assert row.parameters != different.parameters
        if "all parameters" not in row.method:
            assert different.agrees


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
    assert (
        "before the first sample the actuator was in a different state, which the fit estimates"
        in page
    )


def test_saved_as_plain_data(checked, tmp_path):
    checked.save(tmp_path / "crosscheck.json")
    told = json.loads((tmp_path / "crosscheck.json").read_text(encoding="utf-8"))
    assert told["schema"] == "fracjax.crosscheck/1"
    assert told == json.loads(json.dumps(checked.to_dict()))
    assert told["rows"][0]["parameters"] == checked.rows[0].parameters
    assert told["best"] == "gradient fit"


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
        bounds=KEPT, mask=[(0.5, 0.6)], starts=2,
        population=FEW["population"], iterations=FEW["iterations"],
    )  # fmt: skip
    assert found.fit.preparation.takes[0].used.sum() == np.count_nonzero(~spoilt)
    eliminated = [row for row in found.rows if "all parameters" not in row.method]
    assert all(row.over_best < 1.1 for row in eliminated)
    assert found.rows[0].rmse < 1.1 * NOISE.sigma


def test_what_the_searches_do_not_know_is_refused():
    with pytest.raises(fj.InputError, match=r"found priors; the searches cannot use these"):
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
        "from fracjax._crosscheck._bounded import require_jaxopt\n"
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
