"""Simulation: against closed forms, refined by itself, and plain about what it cannot use."""

import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import DriveLag

STEP = 1e-3
TIMES = STEP * np.arange(400)
LAG = fj.Model(DriveLag(0.02))


@pytest.mark.parametrize("history", ["rest", "constant", "periodic"])
def test_a_lag_follows_a_sine_as_its_equation_says(history, float32_default):
    omega, tau = 2 * np.pi * 10, 0.02
    drive = 3 + np.sin(omega * TIMES)
    response, error = fj.simulate(LAG, drive, STEP, history)
    steady = 3 + np.imag(np.exp(1j * omega * TIMES) / (1 + 1j * omega * tau))
    start = {"rest": 0.0, "constant": 3.0, "periodic": steady[0]}[history]
    wanted = steady + (start - steady[0]) * np.exp(-TIMES / tau)
    assert response.dtype == np.float64
    if history == "rest":  # a jump at the first sample is followed to one step of the grid
        assert 1e-4 < error < 1e-3
        assert np.abs(response - wanted)[20:].max() < 0.02
    else:
        assert error < 1e-4
        np.testing.assert_allclose(response, wanted, rtol=0, atol=3e-4)


def test_what_does_not_settle_says_so():
    class Chaos(fj.AbstractBlock):
        @property
        def linear(self) -> bool:
            return False

        def __call__(self, drive, grid):
            return jnp.sin(1 / grid.step) * drive

    assert fj.simulate(fj.Model(Chaos()), np.sin(TIMES), STEP).error > 1e-2


@pytest.mark.parametrize(
    ("drive", "step", "history", "found"),
    [
        (np.ones((2, 50)), STEP, "rest", r"shape \(2, 50\)"),
        (np.ones(3), STEP, "rest", r"shape \(3,\)"),
        (np.array(["a"] * 9), STEP, "rest", "<U1"),
        (np.r_[np.ones(9), np.nan], STEP, "rest", "nan"),
        (np.ones(50), 0.0, "rest", "0.0"),
        (np.ones(50), STEP, "Caputo", '"Caputo"'),
    ],
)
def test_bad_input_is_one_sentence(drive, step, history, found):
    with pytest.raises(fj.InputError, match=f"^simulate.*: expected .*found .*{found}.*; .*"):
        fj.simulate(LAG, drive, step, history)
