"""Noise from what repeats, its colour, and floors that are believed or not."""

import numpy as np
import pytest
from scipy.signal import lfilter

import fracjax as fj
from fracjax._prepare import Residual, autoregression, measured_noise, refine_noise, residual_noises
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


def test_an_offset_does_not_colour_noise():
    noise = np.asarray(lfilter([1], [1, -0.6], np.random.default_rng(3).standard_normal(1000)))
    taps, innovation = autoregression([noise])
    beside, of_offset = autoregression([noise + 1000])
    np.testing.assert_allclose(beside, taps, rtol=1e-6)
    assert of_offset == pytest.approx(innovation, rel=1e-6)


def test_repeats_show_the_noise_under_a_slow_decay():
    generator = np.random.default_rng(2)
    time = np.arange(8000) / 200
    drive = np.sin(2 * np.pi * time)
    response = 5 * drive + 0.1 * np.log(time + 0.1) + 0.01 * generator.standard_normal(8000)
    noise = measured_noise(Recording(drive, response, 0.005, "V", "um"))
    assert noise is not None
    assert noise.method == "repeats"
    assert noise.sigma == pytest.approx(0.01, rel=0.05)


def test_repeats_of_a_few_samples_show_the_noise_in_full():
    """Of twenty samples a relaxation, were it fitted, would take a quarter."""
    generator = np.random.default_rng(4)
    drive = np.tile(np.sin(2 * np.pi * np.arange(20) / 20), 200)
    noise = measured_noise(
        Recording(drive, 5 * drive + 0.01 * generator.standard_normal(4000), 0.005, "V", "um")
    )
    assert noise is not None
    assert noise.method == "repeats"
    assert noise.sigma == pytest.approx(0.01, rel=0.05)


# A drive that neither rests nor repeats within itself.
PATTERN = np.cumsum(np.random.default_rng(5).standard_normal(600))


def test_of_a_drive_given_three_times_the_third_tells_nothing():
    recording = Recording(np.tile(PATTERN, 3), np.tile(PATTERN, 3), STEP, "V", "um")
    residual, used = np.random.default_rng(6).standard_normal(1800), np.ones(1800, bool)
    (twice,) = residual_noises([Residual(residual, used, recording)])
    residual[1200:] += 1000
    assert twice.method == "repeats"
    assert residual_noises([Residual(residual, used, recording)])[0].sigma == twice.sigma


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_a_drive_given_twice_shows_more_than_rests_unless_it_shows_more_than_noise(unit):
    """In any unit."""
    drive, used = np.tile(PATTERN, 2), np.ones(1200, bool)
    rests = fj.Noise(unit, "um", "static", np.ones(1), unit, effective=50.0)
    white = unit * np.random.default_rng(7).standard_normal(1200)
    recording = Recording(drive, 100 * unit * drive, STEP, "V", "um")
    noise = refine_noise(rests, Residual(white, used, recording))
    assert (noise.method, noise.sigma) == ("repeats", pytest.approx(unit, rel=0.1))
    # It was measured, and a better fit does not change it.
    assert not noise.is_leftover
    assert refine_noise(rests, Residual(3 * white, used, recording)) is rests


def test_noises_read_together_are_those_read_alone():
    generator, residuals = np.random.default_rng(9), []
    for size, memory in ((400, 0.0), (700, -0.6), (400, 0.9), (37, 0.0), (700, 0.0)):
        drive = np.cumsum(generator.standard_normal(size))
        noise = np.asarray(lfilter([1], [1, -memory], generator.standard_normal(size)))
        recording = Recording(drive, drive + 0.1 * noise, STEP, "V", "um")
        residuals.append(Residual(0.1 * noise, np.arange(size) >= size // 10, recording))
    recording = Recording(np.tile(PATTERN, 2), np.tile(PATTERN, 2), STEP, "V", "um")
    residuals.append(Residual(generator.standard_normal(1200), np.ones(1200, bool), recording))
    residuals.append(Residual(np.zeros(400), residuals[0].used, residuals[0].recording))
    together = residual_noises(residuals)
    assert {noise.filter.size > 1 for noise in together} == {True, False}
    for noise, residual in zip(together, residuals, strict=True):
        (alone,) = residual_noises([residual])
        np.testing.assert_allclose(noise.filter, alone.filter, rtol=1e-12)
        numbers = [(n.sigma, n.innovation, n.effective) for n in (noise, alone)]
        np.testing.assert_allclose(*numbers, rtol=1e-12)
        assert noise.method == alone.method


def test_spikes_are_no_noise():
    """Five in eight thousand samples would be a floor fifty times as high."""
    generator = np.random.default_rng(2)
    time = np.arange(8000) / 200
    drive = np.sin(2 * np.pi * time)
    response = 5 * drive + 0.01 * generator.standard_normal(8000)
    for at in (700, 1803, 3010, 4507, 6404):
        response[at] += generator.choice([-1, 1]) * 20
    noise = measured_noise(Recording(drive, response, 0.005, "V", "um"))
    assert noise is not None
    assert noise.method == "repeats"
    assert noise.sigma == pytest.approx(0.01, rel=0.05)


def test_a_noise_floor_above_what_a_fit_leaves_is_not_believed():
    """What differs between the periods is a motion of the model's own, not noise."""
    drive = TONE * (1 + 0.02 * np.floor(TIMES))
    white = 0.005 * np.random.default_rng(0).standard_normal(TIMES.size)
    law = fj.simulate(fj.parse_model("creep"), drive, STEP, "constant").response
    told = fj.Noise(0.5, "um", "repeats", np.ones(1), 0.5)
    found = fj.fit(
        fj.parse_model("creep"), Recording(drive, law + white, STEP, "V", "um"), noise=told
    )
    noise = found.preparation.takes[0].noise
    assert noise is not None
    assert noise.method == "residual"
    assert noise.sigma == pytest.approx(0.005, rel=0.05)


def test_a_specification_is_believed():
    white = 0.005 * np.random.default_rng(0).standard_normal(TIMES.size)
    told = fj.Noise(0.5, "um", "specification", np.ones(1), 0.5)
    found = fj.fit(fj.parse_model("creep"), creeping(white), noise=told)
    assert found.preparation.takes[0].noise == told
