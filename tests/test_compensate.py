"""Compensation: model and drive in closed loop, limits that bind, and what is said of both."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

import fracjax as fj
import fracjax._compensate
from benchmarks.compensation import run as run_bench
from benchmarks.compensation import signals, stage
from fracjax import blocks
from fracjax._cli import run
from fracjax._compensate import SCHEMA, load_compensation
from fracjax._compensate._bounded import Bounds
from fracjax._compensate._inverse import inverse_of
from fracjax._compensate._plant import Plant, between
from fracjax._compensate._streaming import _sections
from fracjax._compensate._unbounded import respond
from fracjax._operators import Grid
from fracjax._parameters import set_values

STEP, COUNT = 1e-2, 120
TIMES = STEP * np.arange(COUNT)
SINE = 5 - 5 * np.cos(2 * np.pi * TIMES)
TRIANGLE = 10 * (1 - np.abs(1 - 2 * (TIMES % 1)))
HYSTERESIS = blocks.FOH(0.05, 0.05, 1e-6, 0.1, -0.1)
WEIGHTS = 0.001 * np.array([1, -1, 2, 1, 0.5, 1, -1, 1, 0, 0.5, 1, -0.5])
MEMORY = blocks.MinorLoopMemory(WEIGHTS, span=100.0)


def model(block) -> fj.Model:
    return fj.Model(block, "model")


def wanted(response=SINE, **options) -> fj.Trajectory:
    return fj.Trajectory(response, STEP, **options)


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
    assert found.method in ("closed form", "fixed point")
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
    assert found.method == "fixed point"


# The grid -----------------------------------------------------------------------------------------


@settings(max_examples=8)
@given(st.sampled_from([2, 5]), st.booleans(), st.sampled_from(["constant", "periodic"]))
def test_between_samples_the_drive_is_linear_in_them(finer, smooth, history):
    drive = np.random.default_rng(0).normal(size=(2, 12))
    one, two = (np.asarray(between(jax.numpy.asarray(d), finer, smooth, history)) for d in drive)
    both = np.asarray(between(jax.numpy.asarray(drive[0] - 3 * drive[1]), finer, smooth, history))
    np.testing.assert_allclose(both, one - 3 * two, atol=1e-12)
    np.testing.assert_allclose(one[::finer][:12], drive[0], atol=1e-14)


def test_between_samples_a_cubic_is_exact_inside():
    t = np.arange(12.0)
    fine = np.asarray(between(jax.numpy.asarray(t**3 - 4 * t**2), 4, True, "constant"))
    s = np.arange(45) / 4
    np.testing.assert_allclose(fine[4:-4], (s**3 - 4 * s**2)[4:-4], atol=1e-10)


# Limits -------------------------------------------------------------------------------------------


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
    greedy = Bounds(-np.inf, np.inf, 400.0 * STEP).applied(free.drive, "constant")
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
    drive = bounds.applied(np.array(levels), history)
    assert bounds.admits(drive, history) or np.ptp(drive) == 0
    np.testing.assert_allclose(bounds.applied(drive, history), drive, atol=1e-12)


def test_regularisation_smooths_the_drive():
    rough = SINE + 0.05 * np.random.default_rng(0).normal(size=COUNT)
    plain = fj.compensate(model(blocks.LFDH()), wanted(rough))
    smooth = fj.compensate(model(blocks.LFDH()), wanted(rough), regularisation=0.02)
    bend = [np.abs(np.diff(c.drive, 2)).mean() for c in (plain, smooth)]
    assert bend[1] < 0.1 * bend[0]
    assert smooth.rms_error < 0.02 * smooth.stroke


# Draws, results, refusals -------------------------------------------------------------------------


def test_the_band_of_draws():
    generator = np.random.default_rng(1)
    gains = generator.normal(0.1, 1e-3, (4, 60))
    law = model(blocks.Creep(0.1, 0.01))
    found = fj.compensate(law, wanted(), draws={"k_c": gains, "mu": np.full((4, 60), 0.01)})
    assert found.band is not None
    # Linear in the gain: the band is that of the gain itself.
    low, high = np.percentile(gains.ravel()[np.linspace(0, 239, 200).astype(int)], [2.5, 97.5])
    np.testing.assert_allclose(found.band[0], SINE * low / 0.1, atol=1e-4)
    np.testing.assert_allclose(found.band[1], SINE * high / 0.1, atol=1e-4)
    worst = max(1 - low / 0.1, high / 0.1 - 1) * SINE.max()
    assert found.max_error_of_band == pytest.approx(worst, abs=1e-4)
    assert fj.compensate(law, wanted()).max_error_of_band is None
    with pytest.raises(fj.InputError, match="none of mu"):
        fj.compensate(law, wanted(), draws={"k_c": gains})


@pytest.mark.parametrize("limits", [None, (0.0, 70.0)])
def test_saved_and_loaded_without_loss(tmp_path, limits):
    found = fj.compensate(
        model(blocks.Creep(0.1, 0.01)),
        wanted(source="sine.csv"),
        limits=limits,
        draws={"k_c": np.array([0.1, 0.11]), "mu": np.array([0.01, 0.02])},
    )
    found.save(tmp_path / "compensation.json")
    again = load_compensation(tmp_path / "compensation.json")
    assert again.to_dict() == found.to_dict()
    assert again.to_dict()["schema"] == SCHEMA
    np.testing.assert_array_equal(again.drive, found.drive)
    found.write_drive(tmp_path / "drive.csv")
    recording = fj.read(tmp_path / "drive.csv")
    np.testing.assert_array_equal(recording.drive, found.drive)
    np.testing.assert_array_equal(recording.response, SINE)


@pytest.mark.parametrize("content", ["", "{}", '{"schema": "fracjax.fit/1"}', "[]"])
def test_what_is_no_compensation_is_refused(tmp_path, content):
    path = tmp_path / "compensation.json"
    path.write_text(content)
    with pytest.raises(fj.InputError, match="expected a compensation saved by fracjax"):
        load_compensation(path)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"limits": (70.0, 0.0)}, "the lower limit, then the upper"),
        ({"limits": (np.nan, 0.0)}, "the lower limit, then the upper"),
        ({"slew": 0.0}, "a rate above 0"),
        ({"regularisation": -1.0}, "a time of 0 s or more"),
        ({"offset": np.inf}, "a finite number"),
        ({"history": "never"}, "one of rest, constant, periodic"),
        ({"drive_unit": "volt-ish"}, "expected a unit"),
    ],
)
def test_unusable_calls_are_refused(options, said):
    with pytest.raises(fj.InputError, match=said):
        fj.compensate(model(HYSTERESIS), wanted(), **options)


@pytest.mark.parametrize(
    ("response", "said"),
    [
        (np.zeros(100), "a signal that varies"),
        (np.arange(5.0), "at least 32 samples"),
        (np.full(100, np.nan), "a finite number"),
        (np.ones((50, 2)), "one axis"),
    ],
)
def test_unusable_trajectories_are_refused(response, said):
    with pytest.raises(fj.InputError, match=said):
        fj.Trajectory(response, STEP)


def test_a_model_without_a_drive_is_refused():
    drift = blocks.ThermalDrift(1.0, longest=10.0)
    with pytest.raises(fj.InputError, match="a model with a drive"):
        fj.compensate(model(drift), wanted())
    with pytest.raises(fj.InputError, match="whose response follows its drive"):
        fj.compensate(model(blocks.Creep(0.0, 0.01)), wanted())


# Streaming ----------------------------------------------------------------------------------------

RATE_STEP = 1e-3
STREAMED = {
    "lfdh": blocks.LFDH(),
    "creep": blocks.Creep(0.1, 0.01),
    "lfdh >> log creep": blocks.LFDH() >> blocks.LogarithmicCreep(0.02, 0.05),
    "pea_dynamics": blocks.PEADynamics(0.1, 0.01, -0.1, 300.0, 0.05),
    "lfdh >> lag": blocks.LFDH() >> blocks.DriveLag(1e-3),
}
COMPILER = shutil.which("gcc") or shutil.which("cc")


def streamed(block, **options) -> fj.StreamingInverse:
    return fj.streaming_inverse(model(block), RATE_STEP, (0.05, 10.0), **options)


def program(inverse, folder: Path, samples: np.ndarray) -> np.ndarray:
    """What the header computes, compiled with every warning an error."""
    inverse.save_header(folder / "inverse.h")
    source = (
        '#include <stdio.h>\n#include "inverse.h"\nint main(void)\n{\n'
        "    fracjax_inverse state;\n    double desired;\n    int first = 1;\n"
        '    while (scanf("%lf", &desired) == 1) {\n'
        "        if (first) fracjax_inverse_start(&state, desired);\n        first = 0;\n"
        '        printf("%.17g\\n", fracjax_inverse_step(&state, desired));\n    }\n'
        "    return 0;\n}\n"
    )
    (folder / "main.c").write_text(source, encoding="utf-8")
    flags = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    command = [str(COMPILER), *flags, "main.c", "-o", "program"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    told = subprocess.run(
        [folder / "program"],
        input="\n".join(map(repr, samples.tolist())),
        capture_output=True,
        text=True,
        check=True,
    )
    return np.array(told.stdout.split(), dtype=float)


@pytest.mark.parametrize("name", STREAMED)
def test_the_streaming_inverse_holds_its_stated_error(name):
    block, inverse = STREAMED[name], streamed(STREAMED[name])
    assert inverse.complete
    assert inverse.error < 0.02
    # Between the frequencies at which the error was stated.
    frequencies = np.geomspace(0.051, 9.7, 333)
    exact = 1 / fj.frequency_response(block, frequencies)
    error = np.abs(inverse.frequency_response(frequencies) / exact - 1)
    assert error.max() < 1.2 * inverse.error


@pytest.mark.parametrize("name", ["lfdh", "pea_dynamics"])
def test_sample_by_sample_it_is_the_inverse_of_the_convolution(name):
    times = RATE_STEP * np.arange(3000)
    desired = 3 + np.sin(2 * np.pi * times) ** 2 + 0.2 * np.sin(2 * np.pi * 4 * times)
    inverse = streamed(STREAMED[name])
    with jax.enable_x64(True):
        grid = Grid(RATE_STEP, "constant")
        exact = np.asarray(STREAMED[name].inverse()(jax.numpy.asarray(desired), grid))
    drive = inverse.run(desired)
    assert drive[0] == pytest.approx(exact[0], rel=1e-9)
    # At the start the motion bends suddenly, at frequencies above the band.
    assert np.abs(drive - exact)[100:].max() < 2 * inverse.error * np.ptp(exact)


@given(st.floats(-300, -1e-6), st.floats(0, 300))
@settings(max_examples=50)
def test_sections_follow_a_straight_motion_exactly(real, imaginary):
    pole = complex(real, imaginary)
    decay, before, now = _sections(np.array([pole]), np.array([1.0]), 0.01)
    # The state's response to v = t from rest, by its closed form.
    t = 0.01 * np.arange(1, 5)
    x = pole * t
    exact = np.where(np.abs(x) < 1e-4, t**2 / 2 * (1 + x / 3), (np.expm1(x) - x) / pole**2)
    state, found = 0j, []
    for n in range(4):
        state = decay[0] * state + before[0] * 0.01 * n + now[0] * 0.01 * (n + 1)
        found.append(state)
    np.testing.assert_allclose(found, exact, rtol=1e-6)


@pytest.mark.skipif(COMPILER is None, reason="there is no C compiler here")
@pytest.mark.parametrize("name", ["lfdh", "pair", "gain"])
def test_the_header_computes_what_python_does(name, tmp_path):
    mode = blocks.QuasiStaticForce(0.5) + blocks.Resonance(20.0, 0.1)
    block = {**STREAMED, "pair": mode, "gain": blocks.QuasiStaticForce(0.2)}[name]
    inverse = streamed(block, offset=-2.5)
    assert inverse.paired.any() == (name == "pair")
    desired = 3 + np.cumsum(np.random.default_rng(0).normal(0, 0.1, 500))
    drive = program(inverse, tmp_path, desired)
    np.testing.assert_allclose(drive, inverse.run(desired), rtol=1e-10)


def test_the_equations_as_data_compute_the_same(tmp_path):
    block = blocks.QuasiStaticForce(0.5) + blocks.Resonance(20.0, 0.1)
    inverse = streamed(block)
    inverse.save(tmp_path / "inverse.json")
    told = json.loads((tmp_path / "inverse.json").read_text(encoding="utf-8"))
    assert told["schema"] == "fracjax.inverse/1"
    desired = SINE + 4
    sections = [(1, row) for row in told["first_order"]] + [(2, r) for r in told["second_order"]]
    states = [0j] * len(sections)
    drive, previous = [], 0.0
    for sample in desired:
        v = sample - desired[0]
        total = told["direct"] * v + told["static"] * (desired[0] - told["offset"])
        for k, (weight, row) in enumerate(sections):
            decay, before, now = (np.ravel(row[key]) @ [1, 1j][: np.size(row[key])]
                                  for key in ("decay", "before", "now"))  # fmt: skip
            states[k] = decay * states[k] + before * previous + now * v
            total += weight * states[k].real
        drive.append(total)
        previous = v
    np.testing.assert_allclose(drive, inverse.run(desired), rtol=1e-10)


def test_of_a_nonlinear_model_the_linear_part_is_inverted():
    law = blocks.FOH(0.05, 0.05, 1e-5, 0.1, -0.1)
    inverse = streamed(law)
    assert not inverse.complete
    exact = 1 / fj.frequency_response(law.linear_part, [0.1, 1.0])
    np.testing.assert_allclose(inverse.frequency_response(np.array([0.1, 1.0])), exact, rtol=1e-3)


@pytest.mark.parametrize(
    ("block", "band", "said"),
    [
        (blocks.LFDH(), (1.0, 0.1), "a band 0 < low < high"),
        (blocks.LFDH(), (1.0, 600.0), "below 500 Hz"),
        (blocks.FOHRateTerm(1.0), (0.1, 10.0), "a model with a linear part"),
        (blocks.PEADynamics(-0.1, 0.2, 0.3), (0.1, 10.0), "whose inverse is stable"),
    ],
)
def test_what_cannot_be_streamed_is_refused(block, band, said):
    with pytest.raises(fj.InputError, match=said):
        fj.streaming_inverse(model(block), RATE_STEP, band)


# The command line --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> Path:
    """A fit.json of a creeping law, in volts and micrometres, its zero at -30 µm."""
    drive = 50 - 45 * np.cos(2 * np.pi * TIMES)
    response = fj.simulate(model(blocks.Creep(0.1, 0.01)), drive, STEP).response - 30
    noise = np.random.default_rng(1).normal(0, 1e-3, COUNT)
    recording = fj.Recording(drive, response + noise, STEP)
    path = tmp_path_factory.mktemp("fit") / "fit.json"
    columns = {"time_s": TIMES, "drive_V": drive, "displacement_um": recording.response}
    fj.write(path.with_name("recording.csv"), columns)
    fj.fit(fj.parse_model("creep"), recording, starts=1).save(path)
    return path


@pytest.fixture
def call(tmp_path, monkeypatch, fitted):
    """The command in an empty folder with a trajectory, want.csv, in nanometres."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "")
    fj.write("want.csv", {"time_s": TIMES, "displacement_nm": 1000 * (SINE - 29)})

    def command(*words: str) -> int:
        return run(["compensate", "want.csv", "--fit", str(fitted), "--out", "out", *words])

    return command


def test_the_command_writes_drive_result_and_report(call, capsys):
    assert call() == 0
    out, err = capsys.readouterr()
    assert out.startswith("creep follows want.csv with a predicted error of ")
    assert err == ""
    assert {path.name for path in Path("out").iterdir()} == {
        "drive.csv",
        "compensation.json",
        "report.html",
    }
    told = load_compensation("out/compensation.json")
    assert told.units == ("V", "um")
    assert told.offset == pytest.approx(-30, abs=0.01)
    drive = fj.read("out/drive.csv")
    np.testing.assert_array_equal(drive.drive, told.drive)
    np.testing.assert_allclose(drive.response, SINE - 29, atol=1e-9)
    page = Path("out/report.html").read_text(encoding="utf-8")
    assert "follows want.csv" in page
    assert page.count("<svg") == 3
    assert 'href="http' not in page
    assert 'src="http' not in page


def test_limits_reach_the_inversion_and_the_verdict_is_no_failure(call, capsys):
    words = ["--limits", "-1..60000 mV", "--slew", "0.3 V/ms", "--offset", "-30 um"]
    assert call(*words, "--history", "rest", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads(Path("out/compensation.json").read_text(encoding="utf-8"))
    assert told["limits"] == [-0.001, 60.0]
    assert told["slew_per_s"] == pytest.approx(300)
    assert (told["offset"], told["history"], told["verdict"]) == (-30.0, "rest", "limited")
    assert told["missed"]
    assert call("--limits", "0..60V") == 0
    assert "creep cannot follow want.csv within 0 to 60 V" in capsys.readouterr().out
    assert "out of reach within the limits" in Path("out/report.html").read_text(encoding="utf-8")


def test_the_band_of_a_real_posterior(call, fitted, capsys):
    """From `fracjax posterior` to the band, against the Laplace approximation's own."""
    recorded = fitted.parent / "recording.csv"
    words = ["--model", "creep", "--out", "post", "--history", "constant", "--steps", "400"]
    assert run(["posterior", str(recorded), *words, "--quiet"]) in (0, 3)
    assert call("--fit", "post/fit.json", "--posterior", "post") == 0
    told = load_compensation("out/compensation.json")
    draws = fj.load_posterior("post").samples
    assert told.band is not None
    inside = (told.band[0] <= told.predicted) & (told.predicted <= told.band[1])
    assert inside.all()
    # Straight lines through the draws' means, as a small spread allows; where the recording has
    # its mean, the sensor's zero goes with the gain.
    law = fj.load_model("post/fit.json")
    values = np.stack([draws[name].ravel() for name in ("k_c", "mu")])
    middle, spread = values.mean(axis=1), values.std(axis=1)
    recorded_drive = fj.read(recorded).drive

    def response(shift, drive):
        k_c, mu = middle + shift
        moved = {"k_c": k_c, "mu": mu}
        return fj.simulate(model(set_values(law.block, moved)), drive, STEP).response

    changes = []
    for shift in np.diag(spread):
        mean = (response(shift, recorded_drive) - response(0, recorded_drive)).mean()
        changes.append(response(shift, told.drive) - response(0, told.drive) - mean)
    wide = np.sqrt(np.einsum("in,ij,jn->n", changes, np.corrcoef(values), changes))
    width, counted = told.band[1] - told.band[0], wide > 0.3 * wide.max()
    np.testing.assert_allclose(width[counted], 3.92 * wide[counted], rtol=0.25)
    assert "largest error within the band" in capsys.readouterr().out


def test_quiet_prints_nothing(call, capsys):
    assert call("--quiet", "--regularisation", "5 ms") == 0
    assert capsys.readouterr() == ("", "")


def test_streaming_writes_the_inverse_as_data_and_as_c(call, capsys):
    assert call("--streaming") == 0
    out, _ = capsys.readouterr()
    assert "Streaming: " in out
    told = json.loads(Path("out/inverse.json").read_text(encoding="utf-8"))
    assert told["relative_error"] < 0.01
    assert told["step_s"] == STEP
    assert (
        Path("out/inverse.h").read_text(encoding="utf-8").startswith("/* Linear inverse of creep")
    )


def test_what_did_not_converge_is_saved_and_said(call, capsys, monkeypatch):
    found = fj.compensate(model(blocks.Creep(0.1, 0.01)), wanted())
    stopped = replace(found, converged=False)
    monkeypatch.setattr(fracjax._compensate, "compensate", lambda *_, **__: stopped)
    assert call("--quiet") == 3
    assert "did not converge; the best drive it reached was saved in out" in capsys.readouterr().err
    assert Path("out/compensation.json").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--limits", "60 V"], 'a range such as "0..100 V"'),
        (["--limits", "60..0 V"], "the lower limit, then the upper"),
        (["--limits", "0..60 um"], "expected a value in V"),
        (["--slew", "50 V"], "expected a value in V/s"),
        (["--slew", "-50 V/s"], "a rate above 0"),
        (["--regularisation", "2 V"], "expected a value in s"),
        (["--offset", "2 V"], "expected a value in um"),
        (["--output-unit", "V"], 'of the same kind as "nm"'),
        (["--output", "7"], 'a column "7"'),
        (["--history", "estimated"], "Invalid value for '--history'"),
        (["--posterior", "nowhere"], "no posterior.json"),
        (["--fit", "none.json"], "found no such file"),
        (["--out", "want.csv"], "a place that can be written"),
    ],
)
def test_unusable_calls_of_the_command(call, words, said, capsys):
    assert call(*words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == 1
    assert not Path("out").exists()


# A virtual bench ----------------------------------------------------------------------------------


def test_the_stage_has_the_hysteresis_it_is_said_to_have():
    """19.5 % of the height at full swing, in its reading, and less of it in a smaller loop."""
    times = stage.STEP * np.arange(250)
    shares = []
    for half in (50.0, 7.0):
        swings = np.tile(50 - half * np.cos(2 * np.pi * times), 3)
        drive = np.concatenate([np.linspace(0, 98, 100), np.linspace(98, 50 - half, 100), swings])
        loop = stage.measure(drive, seed=0)[-250:]
        shares.append(np.abs(loop[1:125] - loop[126:][::-1]).max() / np.ptp(loop))
    assert shares[0] == pytest.approx(0.195, abs=2e-3)
    assert shares[1] < 0.7 * shares[0]


@pytest.mark.parametrize(("drive", "most"), [("foh", 0.02), ("foh, extended", 0.006)])
def test_a_stage_that_shares_nothing_with_the_models_is_tracked(drive, most):
    """Check 1 on the sine: the largest steady error over the stroke, the zero set."""
    used = {one.name: one for one in run_bench.identified(Path(run_bench.__file__).parent / "fits")}
    one = used[drive]
    desired = signals.motions(2.2, 7.3)["sine 1 Hz"][: -round(signals.PERIOD / stage.STEP)]
    motion = fj.Trajectory(desired, stage.STEP)
    found = fj.compensate(one.model, motion, history=one.history, offset=one.offset)
    error = signals.steady(stage.measure(found.drive, seed=2) - desired)
    assert np.abs(error - error.mean()).max() < most * np.ptp(signals.steady(desired))
