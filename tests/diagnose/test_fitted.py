"""A fit on a coarse grid, corrected by a fine one."""

import jax
import numpy as np
import pytest

import fracjax as fj
from fracjax._diagnose._fitted import fitted
from fracjax._prepare import Preparation, prepare
from tests.diagnose.helpers import STEP, TIMES, white

SIGMA = 1e-3
DRIVE = 50 + 40 * np.sin(2 * np.pi * 0.9 * TIMES**1.5)
RINGING = fj.parse_model("foh >> resonance")


@pytest.fixture
def ringing() -> Preparation:
    """A mode so near the sampling rate that the recording's own steps are too coarse for it."""
    generator = np.random.default_rng(0)
    law = fj.simulate(RINGING, DRIVE, STEP, "constant").response
    recording = fj.Recording(DRIVE, law + SIGMA * generator.standard_normal(DRIVE.size), STEP)
    return prepare([recording], history="constant", noise=white(SIGMA))


def test_the_law_of_another_fit_sees_the_recorded_response(ringing):
    with jax.enable_x64(True):
        corrected = fitted([fj.parse_model("foh").block], ringing).preparation
        recorded = ringing.problems()[0].response
        assert np.any(corrected.problems()[0].response != recorded)
        again = corrected.uncorrected.problems()[0].response
    np.testing.assert_array_equal(again, recorded)


def test_a_fit_that_cannot_reach_its_aim_is_left_before_it_is_corrected(ringing):
    with jax.enable_x64(True):
        whole, reached, vain = (
            fitted([RINGING.block], ringing, aim).solved.cost for aim in (np.inf, 2e4, 60.0)
        )
    assert reached == whole == pytest.approx(DRIVE.size, rel=0.1)
    assert vain > 1.1 * whole
