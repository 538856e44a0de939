"""Which physics is inside a machine: recordings of another integrator, evidence, columns."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fracjax as fj
from fracjax._blocks import CubicStiffness, Oscillator, Within
from fracjax._computing import computing
from fracjax._inside import _inquire, columns_of, error_on, inquire_inside
from fracjax._inside._evidence import independent_samples, log_bayes_factor
from fracjax._prepare import prepare
from fracjax._solve import solve_from

W, ZETA, STEP, SAMPLES = 2 * np.pi * 4.0, 0.05, 0.02, 1200
FORCES = {
    "": lambda x, v: 0.0,
    "cubic_stiffness": lambda x, v: -0.8 * x**3,
    "quadratic_damping": lambda x, v: -0.004 * v * abs(v),
    "dry_friction": lambda x, v: -0.35 * np.tanh(v / 0.02),
}


def recorded(law: str, level: float, seed: int) -> fj.Recording:
    """A multisine of many lines on an oscillator with a force inside, with noise of .1 %."""
    rng = np.random.default_rng(seed)
    lines, phases = np.arange(2, 150), rng.uniform(0, 2 * np.pi, 148)
    rates = 2 * np.pi * lines / (SAMPLES * STEP)

    def drive(t):
        return level * np.sqrt(2 / lines.size) * np.sum(np.cos(np.outer(t, rates) + phases), axis=1)

    fine = drive(np.arange(8 * SAMPLES + 1) * STEP / 8)

    def rate(t, state):
        x, v = state
        u = np.interp(t, np.arange(fine.size) * STEP / 8, fine)
        return [v, W**2 * (u - x + FORCES[law](x, v)) - 2 * ZETA * W * v]

    times = np.arange(SAMPLES) * STEP
    x = solve_ivp(rate, (0, times[-1]), [0, 0], "LSODA", times, rtol=1e-7, atol=1e-9).y[0]
    noise = 1e-3 * np.ptp(x) * rng.standard_normal(x.size)
    return fj.Recording(drive(times), x + noise, STEP, "V", "um", source=law or "linear")


@pytest.fixture
def once(monkeypatch):
    """One round: what is named is named in it, and the search for more takes most of the time."""
    monkeypatch.setattr(_inquire, "_MOST_ROUNDS", 1)


def asked(law: str):
    training, test = recorded(law, 1.0, 1), recorded(law, 1.3, 2)
    preparation = replace(prepare([training], history="rest", settling=0), oversampling=4)
    return inquire_inside(
        Oscillator(1.0, 3.5, 0.1), preparation, lambda fit: error_on(fit, test, "rest", 0)[0]
    ), test


def test_a_cubic_spring_is_named_and_predicts(once):
    is_named_and_predicts("cubic_stiffness")


@pytest.mark.slow
@pytest.mark.parametrize("law", ["cubic_stiffness", "dry_friction", "quadratic_damping"])
def test_one_effect_is_named_and_no_other(law):
    is_named_and_predicts(law)


def is_named_and_predicts(law):
    inside, test = asked(law)
    assert inside.names == (law,)
    assert inside.sets[0][0] == law
    assert inside.base_error is not None
    assert inside.extended_error is not None
    assert inside.base_error > 4 * inside.extended_error or law == "quadratic_damping"
    assert inside.extended_error < 8e-3 * np.ptp(test.response)
    parameters = fj.Model(inside.block).parameters
    assert float(parameters["oscillator.frequency"].value) == pytest.approx(4.0, rel=0.02)
    if law == "cubic_stiffness":
        assert float(parameters["cubic_stiffness.stiffness"].value) == pytest.approx(0.8, rel=0.05)
    elif law == "dry_friction":
        assert float(parameters["dry_friction.coulomb"].value) == pytest.approx(0.35, rel=0.1)


def test_a_linear_machine_is_left_as_it_is(once):
    inside, _ = asked("")
    assert inside.names == ()
    assert inside.outside == ""
    assert inside.extended is inside.base
    assert inside.base_error == inside.extended_error


def test_a_column_is_the_derivative_by_the_effect():
    preparation = replace(
        prepare([recorded("cubic_stiffness", 0.5, 3)], history="rest", settling=0), oversampling=2
    )
    with computing():
        solved = solve_from([Within(Oscillator(1.0, 3.5, 0.1))], preparation)
        columns = columns_of(solved)
        (column,) = columns.effects["cubic_stiffness"]
        ((_, effect),) = column.inside
        size, (problem,) = float(effect.stiffness.value), preparation.problems()
        machine: Any = solved.block
        ends = [
            problem.linearised(machine @ CubicStiffness(factor * size), ())[0]
            for factor in (1e-4, -1e-4)
        ]
        wanted = problem.whiten((ends[0] - ends[1]) / 2e-4)
        np.testing.assert_allclose(column.white[:, 0], wanted, atol=1e-4 * np.abs(wanted).max())
        assert set(columns.others) == {"linear_dynamics", "drive_curve", "response_curve"}
        for shapes in (columns.effects | columns.others).values():
            assert all(shape.white.shape[0] == columns.residual.size for shape in shapes)


def test_independent_samples_of_a_coloured_residual():
    """White noise counts whole; of an autoregression (1 - a²)/(1 + a²)."""
    rng, n = np.random.default_rng(5), 40_000
    white = rng.standard_normal(n)
    assert independent_samples(white, np.ones(n, bool)) > 0.5 * n
    coloured = np.zeros(n)
    for k in range(1, n):
        coloured[k] = 0.9 * coloured[k - 1] + white[k]
    expected = n * (1 - 0.81) / (1 + 0.81)
    assert independent_samples(coloured, np.ones(n, bool)) == pytest.approx(expected, rel=0.25)


def test_the_evidence_of_chance_is_against_and_of_most_is_for():
    rng = np.random.default_rng(6)
    residual = rng.standard_normal(500)
    shares = [np.corrcoef(residual, rng.standard_normal(500))[0, 1] ** 2 for _ in range(200)]
    factors = [log_bayes_factor(share, 500, 1) for share in shares]
    assert np.mean(np.array(factors) < 0) > 0.97
    assert log_bayes_factor(0.5, 500, 1) > 100
    assert log_bayes_factor(0.5, 500, 2) < log_bayes_factor(0.5, 500, 1)
