"""Noise from what repeats, its colour, and floors that are believed or not."""

import numpy as np
import pytest
from scipy.signal import lfilter

import fracjax as fj
from fracjax._prepare import autoregression, measured_noise
from fracjax._recording import Recording
from tests.diagnose.helpers import STEP, TIMES, TONE, creeping


def test_autoregression_finds_the_colour():
    white = np.random.default_rng(0).standard_normal(20_000)
    coefficients, innovation = autoregression([np.asarray(lfilter([1], [1, -0.6], white))])
    assert coefficients[1] == pytest.approx(-0.6, abs=0.03)
    assert innovation == pytest.approx(1.0, rel=0.03)


def test_a_mains_line_does_not_enter_the_whitening():
    generator = np.random.default_rng(1)
    noise = generator.standard_normal(8000)
    line = 3 * np.sin(2 * np.pi * 0.1 * np.arange(8000))
    with_line = autoregression([noise + line])[1]
    assert with_line == pytest.approx(autoregression([noise])[1], rel=0.05)


def test_repeats_show_the_noise_under_a_slow_decay():
    generator = np.random.default_rng(2)
    time = np.arange(8000) / 200
    drive = np.sin(2 * np.pi * time)
    response = 5 * drive + 0.1 * np.log(time + 0.1) + 0.01 * generator.standard_normal(8000)
    noise = measured_noise(Recording(drive, response, 0.005))
    assert noise is not None
    assert noise.method == "repeats"
    assert noise.sigma == pytest.approx(0.01, rel=0.05)


def test_spikes_are_no_noise():
    """Five in eight thousand samples would be a floor fifty times as high."""
    generator = np.random.default_rng(2)
    time = np.arange(8000) / 200
    drive = np.sin(2 * np.pi * time)
    response = 5 * drive + 0.01 * generator.standard_normal(8000)
    for at in (700, 1803, 3010, 4507, 6404):
        response[at] += generator.choice([-1, 1]) * 20
    noise = measured_noise(Recording(drive, response, 0.005))
    assert noise is not None
    assert noise.method == "repeats"
    assert noise.sigma == pytest.approx(0.01, rel=0.05)


def test_a_noise_floor_above_what_a_fit_leaves_is_not_believed():
    """What differs between the periods is a motion of the model's own, not noise."""
    drive = TONE * (1 + 0.02 * np.floor(TIMES))
    white = 0.005 * np.random.default_rng(0).standard_normal(TIMES.size)
    law = fj.simulate(fj.parse_model("creep"), drive, STEP, "constant").response
    told = fj.Noise(0.5, "um", "repeats", np.ones(1), 0.5)
    found = fj.fit(fj.parse_model("creep"), Recording(drive, law + white, STEP), noise=told)
    noise = found.preparation.takes[0].noise
    assert noise is not None
    assert noise.method == "residual"
    assert noise.sigma == pytest.approx(0.005, rel=0.05)


def test_a_specification_is_believed():
    white = 0.005 * np.random.default_rng(0).standard_normal(TIMES.size)
    told = fj.Noise(0.5, "um", "specification", np.ones(1), 0.5)
    found = fj.fit(fj.parse_model("creep"), creeping(white), noise=told)
    assert found.preparation.takes[0].noise == told
