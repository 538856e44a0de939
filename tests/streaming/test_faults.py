"""What a loop meets: no numbers, limits, a lost state; the drive never leaves its range."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fracjax as fj
from fracjax._streaming import FLAGS
from fracjax._streaming._program import HELD, LEVEL, RESTARTED, SLEW, InverseProgram
from fracjax._streaming._stream import EPS
from tests.streaming.helpers import PLAYS, STACK, STEP, SWINGS, TIMES, inverse_of, model_of

LIMITED = inverse_of(STACK, limits=(0.0, 100.0), slew=4000.0)
DESIRED = model_of(STACK).run(SWINGS).output
SAMPLES = st.lists(
    st.one_of(st.floats(-30, 30), st.floats(allow_nan=True, allow_infinity=True)),
    min_size=8,
    max_size=8,
)


@given(SAMPLES, st.floats(0, 100))
@settings(max_examples=40, deadline=None)
def test_whatever_is_asked_the_drive_is_in_its_range_and_no_faster(samples, start):
    streamed = LIMITED.run(np.array(samples), LIMITED.start(start))
    drive = np.append(start, streamed.output)
    assert np.all((drive >= 0) & (drive <= 100))
    assert np.abs(np.diff(drive)).max() <= 4000.0 * STEP * (1 + 1e-9)
    assert np.isfinite(streamed.predicted).all()
    held = ~np.isfinite(samples)
    np.testing.assert_array_equal(streamed.flags & HELD != 0, held)


def test_a_sample_that_is_no_number_is_the_last_one_again():
    spoilt, repaired = DESIRED.copy(), DESIRED.copy()
    spoilt[500:503] = np.nan, np.inf, -np.inf
    repaired[500:503] = DESIRED[499]
    one, two = LIMITED.run(spoilt), LIMITED.run(repaired)
    np.testing.assert_array_equal(one.output, two.output)
    np.testing.assert_array_equal(np.flatnonzero(one.flags & HELD), [500, 501, 502])


def test_at_a_limit_nothing_winds_up():
    """A motion out of reach for a second leaves what the drive that was applied leaves: from there,
    the inverse is that of a stage which had this drive."""
    out = np.where((TIMES > 0.5) & (TIMES < 1.5), 2 * DESIRED.max(), DESIRED)
    inverse = inverse_of(PLAYS, limits=(0.0, 100.0))
    observer = model_of(PLAYS, limits=(0.0, 100.0))
    desired = np.where((TIMES > 0.5) & (TIMES < 1.5), 50.0, 0.05 * SWINGS)
    streamed = inverse.run(desired, inverse.start(5.0))
    at_limit = (TIMES > 0.51) & (TIMES < 1.5)
    assert np.all(streamed.flags[at_limit] & LEVEL)
    assert np.all(streamed.output[at_limit] == 100.0)
    np.testing.assert_allclose(
        observer.run(streamed.output, observer.start(5.0)).output, streamed.predicted, atol=1e-10
    )
    after = (TIMES > 1.51) & (streamed.flags == 0)
    assert after.sum() > 500
    np.testing.assert_allclose(streamed.predicted[after], desired[after], atol=1e-9)
    # With creep and a mode behind the plays, the motion is back within two periods of the mode.
    stacked = inverse_of(STACK, limits=(0.0, 100.0))
    back = stacked.run(out, stacked.start(SWINGS[0]))
    error = (back.predicted - out)[(TIMES > 1.52) & (back.flags == 0)]
    assert error.size > 500
    assert np.abs(error).max() < 1e-6


def test_limits_are_said():
    desired = np.where(TIMES < 1, DESIRED[0], DESIRED.max())
    streamed = LIMITED.run(desired)
    jump = np.flatnonzero(streamed.flags & SLEW)
    assert jump[0] == np.flatnonzero(TIMES >= 1)[0]
    assert 15 < jump.size < 40  # some 80 V at 4 V per sample
    assert set(FLAGS) == {HELD, LEVEL, SLEW, RESTARTED}


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_a_lost_state_is_started_anew_where_the_drive_was(broken):
    state = LIMITED.run(DESIRED[:400]).state
    drive = float(state["drive"])
    state["stage"][1]["law"]["play"] = np.full_like(state["stage"][1]["law"]["play"], broken)
    streamed = LIMITED.run(DESIRED[400:420], state)
    assert streamed.flags[0] & RESTARTED
    assert not np.any(streamed.flags[1:] & RESTARTED)
    assert abs(streamed.output[0] - drive) <= 4000.0 * STEP * (1 + 1e-9)
    anew = LIMITED.run(DESIRED[400:420], LIMITED.start(drive))
    np.testing.assert_array_equal(streamed.output, anew.output)


def test_a_state_of_zeros_was_never_started():
    zeros = jax.tree.map(np.zeros_like, LIMITED.start())
    streamed = LIMITED.run(DESIRED[:5], zeros)
    assert streamed.flags[0] & RESTARTED
    np.testing.assert_array_equal(
        streamed.output, LIMITED.run(DESIRED[:5], LIMITED.start(0.0)).output
    )


def test_adaptive_gains_follow_a_stage_that_changed():
    """A gain of 95 % and an offset: a twentieth of the error is left, and gains are bounded."""
    adaptation = fj.Adaptation(memory=5.0, spread=0.1, error=5e-3, together=0.02)
    inverse, stage = inverse_of(PLAYS, adaptive=adaptation), model_of(PLAYS)
    program = inverse.program
    assert isinstance(program, InverseProgram)
    times = STEP * np.arange(8000)
    desired = 0.055 * (50 - 30 * np.cos(3 * times) * (1 - 0.3 * np.sin(0.8 * times)))

    def step(carry, aim):
        state, observed, reading = carry
        out, state = program.step(jnp.asarray(EPS), state, aim, reading)
        moved, observed = stage.program.step(jnp.asarray(EPS), observed, out.output)
        reading = 0.95 * moved.output + 0.1
        return (state, observed, reading), reading - aim

    with jax.enable_x64(True):
        begin = (inverse.start(20.0), stage.start(20.0), jnp.asarray(np.nan))
        begin = jax.tree.map(jnp.asarray, begin)
        (state, *_), errors = jax.lax.scan(step, begin, jnp.asarray(desired))
    # Fixed gains would leave the 5 % of the motion.
    assert np.std(errors[-2000:]) < 0.05 * np.std(0.05 * desired)
    assert np.all(np.abs(np.asarray(state["learning"]["gain"])[:-1] - 1) <= 0.3 + 1e-12)


def test_a_measured_motion_belongs_to_an_adaptive_inverse():
    with pytest.raises(fj.InputError, match="the measured response of an adaptive inverse"):
        LIMITED.run(DESIRED, measured=DESIRED)
    with pytest.raises(fj.InputError, match="the measured response of an adaptive inverse"):
        inverse_of(PLAYS, adaptive=fj.Adaptation()).run(DESIRED)


def test_a_stage_that_rested_at_a_response_is_at_its_drive():
    streamed = LIMITED.run(np.full(50, 2.5))
    assert np.ptp(streamed.output) < 5e-3  # V, of a grid for the drive at rest
    np.testing.assert_allclose(streamed.predicted, 2.5, atol=1e-3)
