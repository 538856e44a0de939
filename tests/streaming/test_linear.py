"""Linear laws as difference equations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fracjax as fj
import fracjax._compensate
from fracjax import blocks
from fracjax._streaming._program import InverseProgram
from fracjax._streaming._sections.linear import discretised
from fracjax._streaming._stages import Filtered
from tests.streaming.helpers import model

RATE_STEP = 1e-3
STREAMED = {
    "lfdh": blocks.LFDH(),
    "creep": blocks.Creep(0.1, 0.01),
    "lfdh >> log creep": blocks.LFDH() >> blocks.LogarithmicCreep(0.02, 0.05),
    "pea_dynamics": blocks.PEADynamics(0.1, 0.01, -0.1, 300.0, 0.05),
    "lfdh >> lag": blocks.LFDH() >> blocks.DriveLag(1e-3),
}


def streamed(block, **options) -> fj.StreamingInverse:
    limits = (-1e6, 1e6)
    return fj.streaming_inverse(model(block), RATE_STEP, (0.05, 10.0), limits=limits, **options)


@pytest.mark.parametrize("name", STREAMED)
def test_the_streaming_inverse_holds_its_stated_error(name):
    block, inverse = STREAMED[name], streamed(STREAMED[name])
    assert inverse.error < 0.02
    # Between the frequencies at which the error was stated.
    frequencies = np.geomspace(0.051, 9.7, 333)
    exact = 1 / fj.frequency_response(block, frequencies)
    assert isinstance(inverse.program, InverseProgram)
    (stage,) = inverse.program.chain.stages
    assert isinstance(stage, Filtered)
    error = np.abs(stage.inverse.frequency_response(frequencies) / exact - 1)
    assert error.max() < 1.2 * inverse.error


@given(st.floats(-300, -1e-6), st.floats(0, 300))
@settings(max_examples=50)
def test_sections_follow_a_straight_motion_exactly(real, imaginary):
    pole = complex(real, imaginary)
    decay, before, now = discretised(np.array([pole]), np.array([1.0]), 0.01)
    # The state's response to v = t from rest, by its closed form.
    t = 0.01 * np.arange(1, 5)
    x = pole * t
    exact = np.where(np.abs(x) < 1e-4, t**2 / 2 * (1 + x / 3), (np.expm1(x) - x) / pole**2)
    state, found = 0j, []
    for n in range(4):
        state = decay[0] * state + before[0] * 0.01 * n + now[0] * 0.01 * (n + 1)
        found.append(state)
    np.testing.assert_allclose(found, exact, rtol=1e-6)


def test_a_mode_is_inverted_with_its_acceleration():
    """Without s²/ω_0² the error would be (f/f_0)²: 1 % at a tenth of the mode, 4.9 % at 40 Hz."""
    law = blocks.QuasiStaticForce(0.05) >> blocks.Resonance(180.0, 0.05)
    inverse = fj.streaming_inverse(model(law), 1e-3, (0.1, 40.0), limits=(-20.0, 120.0))
    tenth, top = inverse._linear_error(np.array([18.0, 40.0]))
    assert tenth < 0.13 * 0.01
    assert top < 0.3 * 0.049
    finer = fj.streaming_inverse(model(law), 2.5e-4, (0.1, 40.0), limits=(-20.0, 120.0))
    assert finer._linear_error(np.array([40.0]))[0] < top / 3.5
