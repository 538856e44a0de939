"""Compensation without limits: model and drive in closed loop."""

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fracjax as fj
import fracjax._compensate
from fracjax import blocks
from fracjax._compensate._inverse import inverse_of
from fracjax._compensate._plant import upsample
from fracjax._operators import Grid
from fracjax._report import compensation_warnings
from tests.compensate.helpers import HYSTERESIS, SINE, STEP, TIMES, model, wanted

TRIANGLE = 10 * (1 - np.abs(1 - 2 * (TIMES % 1)))

WEIGHTS = 0.001 * np.array([1, -1, 2, 1, 0.5, 1, -1, 1, 0, 0.5, 1, -0.5])
MEMORY = blocks.MinorLoopMemory(WEIGHTS, span=100.0)

# Closed loop --------------------------------------------------------------------------------------

LINEAR = {
    "lfdh": blocks.LFDH(),
    "creep": blocks.Creep(0.1, 0.01),
    "pea_dynamics": blocks.PEADynamics(0.1, 0.01, -0.1, 500.0, 0.05),
    "lfdh >> log creep": blocks.LFDH() >> blocks.LogarithmicCreep(0.02, 0.05),
}
NONLINEAR = {
    "foh": HYSTERESIS,
    "foh, strong rate term": blocks.FOH(0.05, 0.05, 1e-5, 0.1, -0.1),
    "foh, negative order": blocks.FOH(0.05, 0.05, 1e-6, -0.2, -0.1),
    "coupled": HYSTERESIS >> blocks.Creep(1.0, 0.01, fixed_gain=True),
    "coupled_model_3": HYSTERESIS >> blocks.PEADynamics(1.0, 0.05, -0.1, 500.0, fixed_gain=True),
    "bouc_wen": blocks.BoucWen(0.1, -0.1),
    "foh + minor_loop_memory": HYSTERESIS + MEMORY,
    "electrostriction >> foh": blocks.Electrostriction(0.1, centre=50, span=100) >> HYSTERESIS,
}


@pytest.mark.parametrize("name", [*LINEAR, *NONLINEAR])
def test_model_and_drive_in_closed_loop(name, float32_default):
    block = {**LINEAR, **NONLINEAR}[name]
    found = fj.compensate(model(block), wanted())
    assert found.verdict == "followed"
    assert found.converged
    assert found.max_error <= 1e-6 * found.stroke
    assert found.drive.dtype == np.float64


@pytest.mark.parametrize("name", ["lfdh", "pea_dynamics", "foh", "bouc_wen"])
def test_a_simulation_on_a_grid_of_its_own_agrees(name):
    block = {**LINEAR, **NONLINEAR}[name]
    found = fj.compensate(model(block), wanted())
    # Its curves between samples are others.
    simulated = fj.simulate(model(block), found.drive, STEP)
    assert np.abs(simulated.response - SINE).max() < 3e-4 * found.stroke


@pytest.mark.parametrize("name", ["lfdh", "creep"])
def test_a_closed_form_needs_no_more_than_the_grid_does(name):
    found = fj.compensate(model(LINEAR[name]), wanted())
    assert found.method in ("closed form", "successive correction")
    assert found.iterations <= 4


@pytest.mark.parametrize("history", ["rest", "periodic"])
def test_other_histories(history):
    desired = SINE[:100]
    found = fj.compensate(model(HYSTERESIS), wanted(desired), history=history)
    assert found.verdict == "followed"
    simulated = fj.simulate(model(HYSTERESIS), found.drive, STEP, history)
    np.testing.assert_allclose(simulated.response, desired, atol=1e-3)


def test_kinks_are_followed_at_the_samples():
    found = fj.compensate(model(HYSTERESIS), wanted(TRIANGLE))
    assert found.verdict == "followed"
    simulated = fj.simulate(model(HYSTERESIS), found.drive, STEP)
    assert np.abs(simulated.response - TRIANGLE).max() < 2e-3 * found.stroke


def test_an_offset_is_where_the_sensor_reads_zero():
    found = fj.compensate(model(HYSTERESIS), wanted(SINE - 130.0), offset=-130.0)
    plain = fj.compensate(model(HYSTERESIS), wanted())
    np.testing.assert_allclose(found.drive, plain.drive, atol=1e-4)
    assert found.max_error <= 1e-6 * found.stroke


def test_a_block_without_a_known_inverse():
    class Softening(fj.AbstractBlock):
        @property
        def linear(self) -> bool:
            return False

        def __call__(self, drive, grid):
            return -0.1 * drive + 1e-4 * drive**2

    found = fj.compensate(model(Softening()), wanted())
    assert found.verdict == "followed"
    np.testing.assert_allclose(-0.1 * found.drive + 1e-4 * found.drive**2, SINE, atol=1e-5)


def test_disturbances_of_the_recorded_run_are_left_out():
    drift = fj.parse_model("foh + thermal_drift + mains_interference").block
    found = fj.compensate(model(drift), wanted())
    assert found.left_out == ("ThermalDrift", "MainsInterference")
    plain = fj.compensate(model(blocks.FOH()), wanted())
    np.testing.assert_array_equal(found.drive, plain.drive)


# Sums of plays ------------------------------------------------------------------------------------


@pytest.mark.parametrize("history", ["rest", "constant", "periodic"])
@pytest.mark.parametrize(
    "block",
    [
        blocks.QuasiStaticForce(0.1) + blocks.MinorLoopMemory(WEIGHTS, span=100),
        blocks.QuasiStaticForce(-0.1) + blocks.MinorLoopMemory(-WEIGHTS, span=100),
        blocks.DriveMemory(10 * WEIGHTS, span=100),
    ],
    ids=["rising", "falling", "ahead"],
)
def test_a_sum_of_plays_has_its_own_inverse(history, block):
    inverse = inverse_of(block, 1.0)
    assert inverse is not None
    assert inverse.exact
    generator = np.random.default_rng(3)
    drive = np.cumsum(generator.normal(0, 10, 200))
    drive = drive - (drive[-1] - drive[0]) * np.arange(200) / 199
    grid = Grid(STEP, history)
    recovered = np.asarray(inverse.block(block(jax.numpy.asarray(drive), grid), grid))
    np.testing.assert_allclose(recovered, drive, atol=1e-10 * np.ptp(drive))


def test_plays_whose_slope_changes_sign_have_none():
    inverse = inverse_of(
        blocks.QuasiStaticForce(0.1) + blocks.MinorLoopMemory(-WEIGHTS * 80, span=100), 1.0
    )
    assert inverse is None or not inverse.exact


@pytest.mark.parametrize(
    ("exercised", "history"), [(0.0, "rest"), (0.0, "constant"), (1.0, "constant")]
)
def test_domain_walls_are_undone_by_plays(exercised, history):
    block = blocks.AmplitudeDependence(0.2, exercised, span=100.0)
    inverse = inverse_of(block, 1.0)
    assert inverse is not None
    assert inverse.exact
    drive = 50 - 45 * np.cos(2 * np.pi * TIMES) * (1 - TIMES / 4)
    grid = Grid(STEP, history)
    recovered = np.asarray(inverse.block(block(jax.numpy.asarray(drive), grid), grid))
    np.testing.assert_allclose(recovered, drive, atol=1e-9 * np.ptp(drive))


@pytest.mark.parametrize("motion", [SINE, TRIANGLE])
def test_plays_beside_a_law_and_behind_a_curve_are_inverted_by_contraction(motion):
    curved = blocks.SensorNonlinearity(0.02, 0.002, centre=5.0, span=10.0)
    block = (blocks.FOH(-0.5, 0.55, 1e-7, -1e-3, 0.5) + MEMORY) >> curved
    found = fj.compensate(model(block), wanted(motion + 0.5), history="rest")
    assert found.verdict == "followed"
    assert found.method == "successive correction"


# Plays of a curve ---------------------------------------------------------------------------------

POSITIVE = st.lists(st.floats(1e-3, 1.0), min_size=13, max_size=13)


@settings(max_examples=25)
@given(
    POSITIVE,
    st.sampled_from([1.0, -1.0]),
    st.floats(-0.9, 0.9),
    st.sampled_from(["rest", "constant", "periodic"]),
)
def test_prandtl_ishlinskii_has_its_own_inverse(weights, sign, q, history):
    block = blocks.PrandtlIshlinskii(sign * np.array(weights), q, low=10.0, high=90.0)
    inverse = inverse_of(block, 1.0)
    assert inverse is not None
    assert inverse.exact
    walk = np.cumsum(np.random.default_rng(len(history)).normal(0, 8, 200))
    walk -= np.linspace(0, walk[-1] - walk[0], 200)
    # Beyond both ends: a steady cycle that does not move the widest play does not say where it is.
    drive = -10 + 120 * (walk - walk.min()) / np.ptp(walk)
    grid = Grid(STEP, history)
    recovered = np.asarray(inverse.block(block(jax.numpy.asarray(drive), grid), grid))
    np.testing.assert_allclose(recovered, drive, atol=1e-8 * np.ptp(drive))


PLAYS = np.append(0.06, np.full(12, 0.004))


@pytest.mark.parametrize("motion", [SINE, TRIANGLE])
def test_prandtl_ishlinskii_is_compensated_in_closed_form(motion):
    block = blocks.PrandtlIshlinskii(PLAYS, 0.3, low=0.0, high=100.0)
    found = fj.compensate(model(block), wanted(motion))
    assert found.method == "closed form"
    assert found.verdict == "followed"
    assert found.max_error < 1e-12 * found.stroke
    assert found.warnings == ()
    again = fj.compensate(fj.parse_model("prandtl_ishlinskii >> creep + resonance"), wanted(motion))
    assert again.verdict == "followed"
    assert again.method in ("closed form", "successive correction")


def test_slopes_of_both_signs_are_iterated_and_said(tmp_path):
    turning = np.append(-0.02, PLAYS[1:] + 0.01)
    block = blocks.PrandtlIshlinskii(turning, 0.3, low=0.0, high=100.0) >> blocks.Creep(1.0, 0.01)
    found = fj.compensate(model(block), wanted())
    assert found.method != "closed form"
    (sentence,) = found.warnings
    assert "slopes" in sentence
    assert "from -0.02 to 0.148" in sentence
    assert sentence in compensation_warnings(found)
    found.save(tmp_path / "compensation.json")
    assert fj.load_compensation(tmp_path / "compensation.json").warnings == (sentence,)


# The grid -----------------------------------------------------------------------------------------


@settings(max_examples=8)
@given(st.sampled_from([2, 5]), st.booleans(), st.sampled_from(["constant", "periodic"]))
def test_between_samples_the_drive_is_linear_in_them(finer, smooth, history):
    drive = np.random.default_rng(0).normal(size=(2, 12))
    one, two = (np.asarray(upsample(jax.numpy.asarray(d), finer, smooth, history)) for d in drive)
    both = np.asarray(upsample(jax.numpy.asarray(drive[0] - 3 * drive[1]), finer, smooth, history))
    np.testing.assert_allclose(both, one - 3 * two, atol=1e-12)
    np.testing.assert_allclose(one[::finer][:12], drive[0], atol=1e-14)


def test_between_samples_a_cubic_is_exact_inside():
    t = np.arange(12.0)
    fine = np.asarray(upsample(jax.numpy.asarray(t**3 - 4 * t**2), 4, True, "constant"))
    s = np.arange(45) / 4
    np.testing.assert_allclose(fine[4:-4], (s**3 - 4 * s**2)[4:-4], atol=1e-10)
