"""Every law sample by sample, against the law itself and against its inverse in closed form."""

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fracjax as fj
from fracjax import blocks
from fracjax._compensate._inverse import inverse_of as closed_form
from fracjax._operators import Grid
from tests.streaming.helpers import (
    BAND,
    GAIN,
    HIGH,
    LINEAR,
    LOW,
    NONLINEAR,
    PLAYS,
    STACK,
    STEP,
    SWINGS,
    TIMES,
    inverse_of,
    model,
    model_of,
)

ALL = {**NONLINEAR, **LINEAR, "stack": STACK}


@pytest.mark.parametrize("name", ALL)
def test_the_model_is_that_of_simulate(name):
    """Within the error that it states of its linear parts, else to the discretisation's."""
    stream = model_of(ALL[name])
    streamed = stream.run(SWINGS).output
    simulated = fj.simulate(model(ALL[name]), SWINGS, STEP, "constant").response
    error = np.abs(streamed - simulated).max() / np.ptp(simulated)
    assert error < 2e-5 + stream.error


@pytest.mark.parametrize("name", NONLINEAR)
def test_a_law_that_is_solved_gives_back_the_drive(name):
    response = model_of(NONLINEAR[name]).run(SWINGS).output
    inverse = inverse_of(NONLINEAR[name])
    streamed = inverse.run(response, inverse.start(SWINGS[0]))
    np.testing.assert_allclose(streamed.output, SWINGS, atol=1e-9)
    np.testing.assert_allclose(streamed.predicted, response, atol=1e-11)
    assert not streamed.flags.any()


@pytest.mark.parametrize("name", [*LINEAR, "stack"])
def test_a_law_that_is_filtered_gives_back_a_drive_in_the_band(name):
    response = fj.simulate(model(ALL[name]), SWINGS, STEP, "constant").response
    inverse = inverse_of(ALL[name])
    error = (inverse.run(response, inverse.start(SWINGS[0])).output - SWINGS)[200:]
    assert np.abs(error).max() < 2e-3 * np.ptp(SWINGS)


def test_plays_are_inverted_as_krejci_and_kuhnen_do():
    """An oracle that shares nothing with the search of a root."""
    response = model_of(PLAYS).run(SWINGS).output
    inversion = closed_form(PLAYS, 1.0)
    assert inversion is not None
    with jax.enable_x64(True):
        drive = np.asarray(inversion.block(jax.numpy.asarray(response), Grid(STEP, "constant")))
    inverse = inverse_of(PLAYS)
    streamed = inverse.run(response, inverse.start(SWINGS[0])).output
    np.testing.assert_allclose(streamed, drive, atol=1e-9)


@given(
    st.lists(st.floats(0.0, 0.02), min_size=12, max_size=12),
    st.lists(st.floats(0.0, 100.0), min_size=2, max_size=12),
)
@settings(max_examples=4, deadline=None)
def test_any_plays_with_any_turns_are_inverted(weights, turns):
    law = blocks.PrandtlIshlinskii(np.append(0.03, weights), 0.2, low=0.0, high=100.0)
    drive = np.interp(np.linspace(0, len(turns) - 1, 400), np.arange(len(turns)), turns)
    response = model_of(law).run(drive).output
    inverse = inverse_of(law)
    back = inverse.run(response, inverse.start(drive[0])).output
    np.testing.assert_allclose(back, drive, atol=1e-8)


def test_the_error_of_a_coarse_step_is_of_second_order():
    """Halving the step divides Bouc–Wen's by four at least."""
    errors = []
    law = NONLINEAR["bouc_wen"]
    for every in (8, 4):
        step, drive = every * STEP, SWINGS[::every]
        stream = fj.streaming_model(model(law), step, (0.1, 10.0), limits=(LOW, HIGH))
        fine = fj.simulate(model(law), SWINGS, STEP, "constant").response[::every]
        errors.append(np.abs(stream.run(drive).output - fine).max())
    assert errors[1] < errors[0] / 3


def test_a_delay_looks_ahead_of_a_smooth_motion():
    """At ω τ = 0.13 its error is a thousandth, at ω τ = 1 it is large: so it is stated."""
    inverse = inverse_of(LINEAR["delay"])
    assert inverse.error > 0.1
    narrow = fj.streaming_inverse(model(LINEAR["delay"]), STEP, (0.1, 6.0), limits=(LOW, HIGH))
    assert narrow.error < 2e-3


def test_without_a_limit_a_stream_goes_on_where_it_ended():
    stream = inverse_of(STACK)
    desired = model_of(STACK).run(SWINGS).output
    whole = stream.run(desired)
    first = stream.run(desired[:1000])
    second = stream.run(desired[1000:], first.state)
    np.testing.assert_array_equal(np.append(first.output, second.output), whole.output)


def test_the_promise_grows_towards_the_mode_and_says_where_a_limit_binds():
    promise = inverse_of(PLAYS >> blocks.Resonance(180.0, 0.05), slew=5000.0).promise()
    rows = promise.rows
    small = [row for row in rows if row.height == min(r.height for r in rows)]
    errors = [row.error for row in sorted(small, key=lambda row: row.frequency)]
    assert errors[0] < 1e-3
    assert errors[-1] > 30 * errors[0]
    assert any(row.limited > 0.2 for row in rows if row.frequency > 20)
    assert not any(row.limited for row in small if row.frequency < 5)
    # 5000 V/s over 140 V: a sine of 11.4 Hz; and 1 % of error from the differences' own formula.
    assert "followed up to 11.4 Hz: beyond, it changes by more than 5000" in promise.failures[1]
    assert "the linear parts miss by more than 10 %" in promise.failures[2]
    assert all(row.interval is None for row in rows)


def test_a_promise_from_a_fit_has_the_interval_of_its_parameters():
    """Against draws of the gain alone, whose error is its relative one by the rms of a sine."""
    law = blocks.Gain(0.1)
    noise = 0.2 * np.random.default_rng(1).standard_normal(TIMES.size)
    recording = fj.Recording(SWINGS, 0.1 * SWINGS + noise, STEP, "V", "um")
    fitted = fj.fit(fj.Model(law, "gain"), recording, starts=1)
    (estimate,) = fitted.parameters.values()
    relative = estimate.standard_error / estimate.value / np.sqrt(8)
    rows = fj.streaming_inverse(fitted, STEP).promise().rows
    for row in rows:
        assert row.interval is not None
        # The 5 % and 95 % points of |z| are 0.06 and 1.96.
        assert row.interval[0] < 0.3 * relative
        np.testing.assert_allclose(row.interval[1], 1.96 * relative, rtol=0.35)
    given = {"k": np.full(8, 1.1 * estimate.value)}
    wide = fj.streaming_inverse(fitted, STEP).promise(given).rows
    intervals = np.array([row.interval for row in wide])
    np.testing.assert_allclose(intervals, 0.1 / np.sqrt(8), rtol=1e-2)
    with pytest.raises(fj.InputError, match=r"none of k"):
        fj.streaming_inverse(fitted, STEP).promise({})


@pytest.mark.parametrize(
    ("block", "options", "said"),
    [
        (GAIN, {"limits": None}, "lowest and highest drive, which a loop must never leave"),
        (GAIN, {"limits": (1.0, 0.0)}, "lowest and highest drive"),
        (GAIN, {"limits": (0.0, np.inf)}, "lowest and highest drive"),
        (GAIN, {"slew": -1.0}, "a rate above 0"),
        (blocks.FOHRateTerm(1.0), {}, "moves the same way as its drive"),
        (blocks.BoucWen(0.01, -1.0, 0.1), {}, "moves the same way as its drive"),
        (blocks.FOH(12.0, -0.3, 0.1, 0.95, -0.9), {}, "and 12 at rest"),
        (blocks.ClockSkew(1e-4) >> GAIN, {}, "laws that run sample by sample"),
        (blocks.PEADynamics(-0.1, 0.2, 0.3), {}, "a stable transfer function"),
        (blocks.ThermalDrift(1.0, longest=10.0), {}, "a model with a drive"),
        (GAIN, {"adaptive": fj.Adaptation()}, "a model with hysteresis"),
        (PLAYS, {"adaptive": fj.Adaptation(memory=0.0)}, "a number above 0"),
    ],
)
def test_what_has_no_inverse_in_a_loop_is_refused(block, options, said):
    with pytest.raises(fj.InputError, match=said):
        inverse_of(block, **options)


@pytest.mark.parametrize("band", [(1.0, 0.1), (1.0, 600.0)])
def test_a_band_out_of_order_is_refused(band):
    with pytest.raises(fj.InputError, match="0 < low < high below 500 Hz"):
        fj.streaming_inverse(model(GAIN), STEP, band, limits=(LOW, HIGH))
    assert BAND[1] < 0.5 / STEP


def test_a_fit_gives_range_offset_and_units():
    law = blocks.Gain(0.1)
    recording = fj.Recording(SWINGS, 0.1 * SWINGS - 3, STEP, "V", "um")
    fitted = fj.fit(fj.Model(law, "gain"), recording, starts=1)
    stream = fj.streaming_inverse(fitted, "1 ms")
    assert stream.limits == (SWINGS.min(), SWINGS.max())
    assert stream.units == ("V", "um")
    np.testing.assert_allclose(stream.run(np.array([2.0, 3.0])).output, [50.0, 60.0], rtol=1e-6)
    with pytest.raises(fj.InputError, match="a fit or a model"):
        fj.streaming_inverse("foh", 1e-3)  # type: ignore[arg-type]
