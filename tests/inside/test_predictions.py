"""The error of a fitted machine on a recording that no fit has used."""

from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import CubicStiffness, Oscillator
from fracjax._inside import error_on
from fracjax._operators import Grid
from fracjax._parameters import set_values
from fracjax._prepare import prepare

COUNT, STEP, OFFSET = 96, 0.02, 0.7
MACHINE = Oscillator(0.5, 3.0, 0.08) @ CubicStiffness(0.7)
DRIVE = 2.5 * np.sin(0.2 * np.arange(COUNT)) * np.minimum(np.arange(COUNT) / 20, 1)
FITTED: Any = SimpleNamespace(
    block=set_values(MACHINE, {"start": np.array([0.4, -0.3])}),  # where its own recording began
    own=(np.array([OFFSET, 9.0]), np.array([8.0])),
    preparation=prepare([fj.Recording(DRIVE, DRIVE, STEP, "V", "um")], history="rest", settling=0),
)


def recorded(start: tuple[float, float], wrong: np.ndarray, drive: np.ndarray = DRIVE):
    """A recording of the machine that begins in motion, and by how much it is wrong."""
    moved = set_values(MACHINE, {"start": np.array(start)})
    response = np.asarray(moved(jnp.asarray(drive), Grid(STEP, "rest"))) + OFFSET
    return fj.Recording(drive, response + wrong, STEP, "V", "um"), response


WRONG = np.where(np.arange(COUNT) < 50, 0.3, np.where(np.arange(COUNT) % 2, 0.1, -0.2))


@pytest.mark.parametrize("settling", [0, 49, 50, 51])
def test_the_error_is_the_rms_after_settling(settling):
    """From the history's start, whatever that of the fit's own recording was."""
    recording, response = recorded((0.0, 0.0), WRONG)
    error, simulation = error_on(FITTED, recording, "rest", settling)
    np.testing.assert_allclose(simulation, response, atol=1e-9)
    assert error == pytest.approx(np.sqrt(np.mean(WRONG[settling:] ** 2)))


@pytest.mark.parametrize("start", [(0.4, -0.3), (-0.8, 0.5), (1.2, 0.9)])
def test_the_state_at_the_first_sample_is_read_from_the_first_samples(start):
    """From the fit's own start or from far off it, in a few steps."""
    recording, response = recorded(start, np.zeros(COUNT))
    error, simulation = error_on(FITTED, recording, "rest", 30, read=30)
    np.testing.assert_allclose(simulation, response, atol=1e-6)
    assert error < 1e-6
    # Samples that are not read have no part in it.
    wrong = np.where(np.arange(COUNT) < 30, 0.0, 0.2)
    recording, _ = recorded(start, wrong)
    error, simulation = error_on(FITTED, recording, "rest", 30, read=30)
    np.testing.assert_allclose(simulation, response, atol=1e-6)
    assert error == pytest.approx(0.2, rel=1e-4)
    # Without reading it begins at rest.
    error, _ = error_on(FITTED, recorded(start, np.zeros(COUNT))[0], "rest", 0)
    assert error > 0.02


def test_a_recording_is_simulated_to_its_own_length():
    """Its problem is padded."""
    recording, response = recorded((0.0, 0.0), np.zeros(61), DRIVE[:61])
    error, simulation = error_on(FITTED, recording, "rest", 0)
    assert simulation.shape == (61,)
    assert error == pytest.approx(0.0, abs=1e-9)
    error, simulation = error_on(FITTED, recording, "rest", 0, read=20)
    np.testing.assert_allclose(simulation, response, atol=1e-6)


def test_a_constant_history_is_one_of_equilibrium():
    drive = 1.0 + DRIVE
    machine = Oscillator(0.5, 3.0, 0.08) @ CubicStiffness(0.0)
    fitted = SimpleNamespace(**{**vars(FITTED), "block": machine})
    response = np.asarray(machine(jnp.asarray(drive), Grid(STEP, "constant"))) + OFFSET
    recording = fj.Recording(drive, response, STEP, "V", "um")
    constant, _ = error_on(fitted, recording, "constant", 0)  # type: ignore[arg-type]
    rest, _ = error_on(fitted, recording, "rest", 0)  # type: ignore[arg-type]
    assert constant < 1e-9
    assert rest > 0.05
