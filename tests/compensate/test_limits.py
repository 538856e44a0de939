"""Limits that bind, and what is said of them."""

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

import fracjax as fj
import fracjax._compensate
from fracjax import blocks
from fracjax._compensate._bounded import Bounds
from fracjax._compensate._plant import Plant
from fracjax._compensate._unbounded import respond
from tests.compensate.helpers import COUNT, HYSTERESIS, SINE, STEP, TIMES, model, wanted


def test_limits_that_do_not_bind_change_nothing():
    free = fj.compensate(model(HYSTERESIS), wanted())
    wide = fj.compensate(model(HYSTERESIS), wanted(), limits=(-50.0, 300.0), slew=5000.0)
    np.testing.assert_array_equal(free.drive, wide.drive)
    assert wide.binding == ()
    assert wide.verdict == "followed"


def test_out_of_reach_it_is_the_best_drive_within_the_limits():
    block = blocks.FOHLinear(0.05, 0.05, 0.1)
    found = fj.compensate(model(block), wanted(), limits=(0.0, 70.0))
    assert found.verdict == "limited"
    assert found.converged
    assert found.drive.min() >= 0
    assert found.drive.max() <= 70
    assert "upper limit" in {stretch.kind for stretch in found.binding}
    worst = max(found.missed, key=lambda stretch: stretch.largest)
    assert worst.largest == pytest.approx(found.max_error)
    assert worst.start < 0.5 < worst.stop
    # An oracle for the linear law: its matrix, column by column, and SciPy's bounded least squares.
    with jax.enable_x64(True):
        plant = Plant(block, np.asarray(STEP), np.asarray(0.0), "constant", 8, True)
        unit = np.eye(COUNT)
        matrix = np.stack([np.asarray(respond(plant, column)) for column in unit], axis=1)
    low, high = np.zeros(COUNT), np.full(COUNT, 70.0)
    low[0], high[0] = found.drive[0] - 1e-9, found.drive[0] + 1e-9
    oracle = lsq_linear(matrix, SINE, (low, high), tol=1e-12)
    rms = np.sqrt(2 * oracle.cost / COUNT)
    assert found.rms_error == pytest.approx(rms, rel=1e-3)


def test_a_slew_limit_is_kept_and_anticipated():
    step = np.where(TIMES % 1 > 0.5, 10.0, 0.0)
    found = fj.compensate(model(blocks.FOHLinear(0.05, 0.05, 0.1)), wanted(step), slew=400.0)
    change = np.abs(np.diff(found.drive))
    assert change.max() <= 400.0 * STEP * (1 + 1e-9)
    assert any(stretch.kind == "slew limit" for stretch in found.binding)
    assert found.verdict == "limited"
    free = fj.compensate(model(blocks.FOHLinear(0.05, 0.05, 0.1)), wanted(step))
    greedy = Bounds(-np.inf, np.inf, 400.0 * STEP).apply(free.drive, "constant")
    late = fj.simulate(model(blocks.FOHLinear(0.05, 0.05, 0.1)), greedy, STEP).response
    assert found.rms_error < 0.7 * np.sqrt(np.mean((late - step) ** 2))


def test_limits_of_a_nonlinear_law():
    found = fj.compensate(
        model(blocks.BoucWen(0.1, -0.1)), wanted(), limits=(5.0, 80.0), slew=350.0
    )
    assert found.verdict == "limited"
    assert found.drive.min() >= 5.0
    assert found.drive.max() <= 80.0
    assert np.abs(np.diff(found.drive)).max() <= 350.0 * STEP * (1 + 1e-9)


def test_a_law_that_saturates_cannot_be_followed():
    saturated = blocks.Saturation(70.0, low=0, high=100) >> blocks.Creep(0.1, 0.01)
    found = fj.compensate(model(saturated), wanted(SINE[:60]))
    assert found.verdict == "approximate"
    assert found.missed
    assert found.max_error > 0.1 * found.stroke


@settings(max_examples=30)
@given(
    st.lists(st.floats(-100, 100), min_size=3, max_size=30),
    st.floats(0.1, 50),
    st.sampled_from(["rest", "constant", "periodic"]),
)
def test_whatever_is_applied_keeps_within_the_bounds(levels, change, history):
    bounds = Bounds(-60.0, 40.0, change)
    drive = bounds.apply(np.array(levels), history)
    assert bounds.admits(drive, history) or np.ptp(drive) == 0
    np.testing.assert_allclose(bounds.apply(drive, history), drive, atol=1e-12)


def test_regularisation_smooths_the_drive():
    rough = SINE + 0.05 * np.random.default_rng(0).normal(size=COUNT)
    plain = fj.compensate(model(blocks.LFDH()), wanted(rough))
    smooth = fj.compensate(model(blocks.LFDH()), wanted(rough), regularisation=0.02)
    bend = [np.abs(np.diff(c.drive, 2)).mean() for c in (plain, smooth)]
    assert bend[1] < 0.1 * bend[0]
    assert smooth.rms_error < 0.02 * smooth.stroke
