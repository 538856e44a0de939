"""A noise floor that holds noise alone: no start, ringing, event, tone or mismatch."""

import warnings
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

import fracjax as fj
from fracjax._prepare import Residual, measured_noise, residual_noises
from fracjax._prepare._autoregression import autoregression
from fracjax._recording import Recording

STEP, SIGMA, PERIOD = 2e-3, 0.005, 500


def cycles(count: int) -> tuple[np.ndarray, np.ndarray]:
    """The times and a drive of so many cycles."""
    times = STEP * np.arange(count * PERIOD)
    return times, 50 - 50 * np.cos(2 * np.pi * times)


def white(size: int, seed: int = 0) -> np.ndarray:
    return SIGMA * np.random.default_rng(seed).standard_normal(size)


def floor_of(drive: np.ndarray, response: np.ndarray) -> fj.Noise:
    noise = measured_noise(Recording(drive, response, STEP, "V", "um"))
    assert noise is not None
    return noise


@pytest.mark.parametrize("count", [3, 4, 10])
def test_a_first_cycle_does_not_enter_the_floor(count):
    times, drive = cycles(count)
    virgin = 0.3 * np.exp(-times / 0.2) * np.sin(np.pi * np.minimum(2 * times, 1))
    noise = floor_of(drive, 0.1 * drive + virgin + white(times.size))
    assert noise.method == "repeats"
    assert noise.sigma == pytest.approx(SIGMA, rel=0.12)


def test_an_event_in_one_cycle_does_not_enter_the_floor():
    times, drive = cycles(6)
    response = 0.1 * drive + white(times.size)
    response[1700:1730] += np.hanning(30)
    assert floor_of(drive, response).sigma == pytest.approx(SIGMA, rel=0.12)


@pytest.mark.parametrize("pole", [0.0, 0.6])
@pytest.mark.parametrize("frequency", [50.17, 49.8])
def test_mains_that_are_not_locked_to_the_drive_are_no_noise(frequency, pole):
    times, drive = cycles(12)
    coloured = np.sqrt(1 - pole**2) * np.asarray(lfilter([1], [1, -pole], white(times.size)))
    lines = sum(
        size * np.sin(2 * np.pi * k * frequency * times + k)
        for k, size in ((1, 0.12), (2, 0.04), (3, 0.02))
    )
    noise = floor_of(drive, 0.1 * drive + coloured + lines)
    assert noise.sigma == pytest.approx(SIGMA, rel=0.1)
    assert noise.filter.sum() == pytest.approx(1 - pole, abs=0.12)
    assert noise.tone is not None
    assert min(abs(noise.tone.frequency / STEP / k - frequency) for k in (1, 2, 3)) < 0.05


@pytest.mark.parametrize(("ringing", "creep"), [(20.0, 0.0), (50.0, 0.3)])
def test_what_rings_and_creeps_in_a_rest_is_no_noise(ringing, creep):
    levels = np.random.default_rng(1).uniform(10, 90, 13)
    edge = 0.5 - 0.5 * np.cos(np.pi * np.arange(60) / 60)
    drive = np.concatenate(
        [np.r_[np.full(200, low), low + (high - low) * edge] for low, high in pairwise(levels)]
    )
    since = np.arange(drive.size) % 260
    rings = ringing * SIGMA * np.exp(-since / 25) * np.sin(2 * np.pi * since / 9)
    noise = floor_of(drive, 0.1 * drive + rings + creep * np.log1p(since / 2) + white(drive.size))
    assert noise.method == "static"
    assert noise.sigma == pytest.approx(SIGMA, rel=0.12)


@pytest.mark.parametrize("pole", [0.0, 0.7])
def test_a_floor_says_how_sure_it_is(pole):
    floors = []
    for seed in range(120):
        times, drive = cycles(4)
        noise = np.asarray(lfilter([1], [1, -pole], white(times.size, seed)))
        floors.append(floor_of(drive, 0.1 * drive + noise))
    levels = np.array([floor.sigma for floor in floors])
    claimed = np.median([floor.relative_error for floor in floors])
    assert np.std(levels) / np.mean(levels) == pytest.approx(claimed, rel=0.3)


def test_a_level_that_was_not_measured_claims_no_accuracy():
    assert fj.Noise(0.1, "um", "specification", np.ones(1), 0.1).relative_error is None


def test_a_smooth_mismatch_is_no_noise():
    times = STEP * np.arange(3000)
    drive = 50 + 40 * np.sin(2 * np.pi * (0.5 + 0.2 * times) * times)
    mismatch = 100 * SIGMA * np.sin(drive / 20)
    recording = Recording(drive, 0.1 * drive + mismatch, STEP, "V", "um")
    residual = mismatch + white(3000)
    residual[[400, 401, 2000]] += 300 * SIGMA
    (noise,) = residual_noises([Residual(residual, np.ones(3000, bool), recording)])
    assert noise.method == "residual"
    assert noise.sigma == pytest.approx(SIGMA, rel=0.15)
    assert noise.filter.size == 1


def test_codes_that_repeat_hide_no_less_than_their_rounding():
    _, drive = cycles(5)
    noise = floor_of(drive, np.round(0.1 * drive / 0.05) * 0.05)
    assert noise.sigma == pytest.approx(0.05 / np.sqrt(12))


SMOOTH = st.one_of(
    st.builds(
        lambda c: np.polynomial.Polynomial(c), st.lists(st.floats(-9, 9), min_size=1, max_size=4)
    ),
    st.builds(lambda f, p: lambda x: np.sin(f * x + p), st.floats(0.01, 200), st.floats(0, 6)),
    st.builds(lambda r: lambda x: np.exp(-r * x), st.floats(0, 50)),
    st.just(np.zeros_like),
)


@settings(max_examples=150, deadline=None)
@given(SMOOTH, st.floats(-12, 6), st.sampled_from([0.0, 1e-3, 0.3]), st.integers(40, 700))
def test_smooth_constant_and_coarse_signals_have_a_colour(shape, decades, code, size):
    signal = 10.0**decades * np.asarray(shape(np.linspace(0, 1, size)), dtype=float)
    if code:
        signal = np.round(signal / (code * 10.0**decades)) * code * 10.0**decades
    signal = signal + np.zeros(size)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        taps, innovation = autoregression([signal])
    assert np.all(np.isfinite(taps))
    assert 0 <= innovation <= 1.5 * np.sqrt(np.mean(signal**2)) + 1e-300
    drive = np.linspace(0, 1, size) ** 1.5 * 100
    response = np.arange(size) * 0.1
    recording = Recording(drive, response, STEP, "V", "um")
    (noise,) = residual_noises([Residual(signal, np.ones(size, bool), recording)])
    assert np.isfinite(noise.sigma)
    assert noise.innovation > 0


def test_noise_of_which_a_fit_took_the_slow_part_is_white_again():
    """Else what is left looks like noise without slow parts, and slow mismatch beside it large."""
    rng, size = np.random.default_rng(3), 4000
    recording = Recording(np.cumsum(rng.standard_normal(size)), rng.standard_normal(size), 1e-3)
    share = 0.97 / (1 + (np.linspace(0, 1, size // 2 + 1) / 0.3) ** 8)
    lines = np.fft.rfft(0.02 * rng.standard_normal(size))
    rest = np.fft.irfft(lines * np.sqrt(1 - share), size)
    ones = np.ones(size, bool)
    (as_is,), (noise,) = (
        residual_noises([Residual(rest, ones, recording, spent)]) for spent in (None, share)
    )
    assert as_is.filter.size > 5
    assert noise.filter.size <= 3
    assert noise.sigma == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize("kind", ["varying", "heavy"])
def test_noise_that_varies_or_has_heavy_tails_is_no_smooth_mismatch(kind):
    """By a median alone the floor would be too low, and what reaches the noise unexplained."""
    rng, size = np.random.default_rng(4), 6000
    sizes = 0.01 * (1 + 0.9 * np.sin(2 * np.pi * np.arange(size) / 1500))
    noise = (
        sizes * rng.standard_normal(size) if kind == "varying" else 0.01 * rng.standard_t(3, size)
    )
    recording = Recording(np.cumsum(rng.standard_normal(size)), noise, 1e-3)
    (read,) = residual_noises([Residual(noise, np.ones(size, bool), recording)])
    assert read.sigma == pytest.approx(np.std(noise[~recording.spikes]), rel=0.02)


def test_what_is_smooth_in_places_stays_mismatch():
    """Of bursts the median sees nothing, and the floor is that of what is between them."""
    rng, size = np.random.default_rng(5), 6000
    bursts = 0.2 * np.exp(-0.5 * ((np.arange(size) % 1500 - 700) / 30.0) ** 2)
    noise = 0.01 * rng.standard_normal(size)
    recording = Recording(np.cumsum(rng.standard_normal(size)), noise + bursts, 1e-3)
    (read,) = residual_noises([Residual(noise + bursts, np.ones(size, bool), recording)])
    assert read.sigma == pytest.approx(0.01, rel=0.1)
