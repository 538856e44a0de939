"""The least-squares step of a fit, and what its residual is like."""

import jax
import numpy as np
import pytest

import fracjax as fj
from fracjax._prepare import prepare
from fracjax._solve import solve_from
from fracjax._solve._least_squares import Objective
from tests.settings import DRIVE, TIMES


def test_a_least_squares_step_is_that_of_all_rows(setting):
    """Gauss and Newton's, its promise and the gradient, of one turned row per shape and one."""
    with jax.enable_x64(True):
        model = fj.parse_model("foh >> creep", setting)
        response = np.tanh(DRIVE / 50) + 0.01 * np.cos(40 * TIMES)
        recording = fj.Recording(DRIVE, response, float(TIMES[1]), "V", "um")
        preparation = prepare([recording], history="constant")
        objective = Objective(model.block, preparation.problems())
        position = objective.parameters.position_of(model.block)
        rows, residual = objective.derivative(position), objective.residual(position)
        turned, length = (
            objective.reduced_derivative(position),
            objective.reduced_residual(position),
        )
        assert turned.shape == (position.size + 1, position.size)
        np.testing.assert_allclose(length @ length, residual @ residual, rtol=1e-12)
        np.testing.assert_allclose(turned.T @ turned, rows.T @ rows, rtol=1e-10)
        np.testing.assert_allclose(turned.T @ length, rows.T @ residual, rtol=1e-8)
        step = [np.linalg.lstsq(*pair)[0] for pair in ((rows, residual), (turned, length))]
        np.testing.assert_allclose(*step, rtol=1e-6)


def test_the_kurtosis_of_a_fit_is_that_of_the_samples_that_count(setting):
    noise = np.random.default_rng(0).standard_normal(TIMES.size)
    recording = fj.Recording(DRIVE, 0.1 * DRIVE + 0.01 * noise, TIMES[1], "V", "um")
    half = prepare([recording], history="constant", mask=[(0.0, 1.0)])
    with jax.enable_x64(True):
        solved = solve_from([fj.parse_model("foh", setting).block], half)
    # Zeros for what does not count would make twice of it.
    assert solved.kurtosis == pytest.approx(3, abs=0.8)
