"""Where a mismatch is: planted at one place, it is found there; noise is nowhere."""

from typing import Any

import jax
import numpy as np
import pytest

import fracjax as fj
from fracjax._diagnose._fitted import fitted
from fracjax._diagnose._places import Residual, locate
from fracjax._diagnose._result import Axis
from fracjax._prepare import Preparation, prepare

STEP = 0.01
PERIOD = 250
TIMES = STEP * np.arange(8 * PERIOD)
PHASE = 360 * np.arange(TIMES.size) / PERIOD % 360
DRIVE = 50 - 50 * np.cos(np.deg2rad(PHASE))
RATES = 50 * np.sin(np.deg2rad(PHASE)) * 2 * np.pi / (PERIOD * STEP)
SINCE = PHASE % 180 / 360 * PERIOD * STEP
KNOWN = fj.Noise(1.0, "um", "specification", np.ones(1), 1.0)
TAKEN = prepare(
    [fj.Recording(DRIVE, 0.1 * DRIVE, STEP, "V", "um")], noise=KNOWN, history="constant", settling=0
)


def axes_of(residual: np.ndarray) -> dict[str, Axis]:
    problems = TAKEN.problems()
    whitened = np.zeros(problems[0].response.shape[0])
    whitened[: residual.size] = residual
    axes = locate(TAKEN, problems, Residual(whitened, np.zeros((whitened.size, 0))), 1e9)
    return {axis.axis: axis for axis in axes}


def white(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(TIMES.size)


@pytest.mark.parametrize(
    ("name", "unit", "bins", "planted", "low", "high"),
    [
        ("time", "s", 16, (TIMES > 10) & (TIMES < 11.8), 10, 11.8),
        ("level", "V", 12, np.abs(DRIVE - 62.5) < 4, 58.5, 66.5),
        ("rate", "V/s", 10, RATES > 115, 115, 126),
        ("reversal", "s", 10, np.sign(RATES) * (SINCE < 0.05), 0.005, 0.06),
        ("phase", "deg", 24, np.abs(PHASE - 240) < 15, 225, 255),
        ("harmonics", "1", 10, np.sin(5 * np.deg2rad(PHASE) + 1) / 2, 4.5, 5.5),
        ("frequency", "Hz", 14, np.sin(2 * np.pi * 31 * TIMES), 26, 36),
    ],
)
def test_what_is_planted_at_a_place_is_found_there(name, unit, bins, planted, low, high):
    axis = axes_of(white(0) + planted)[name]
    assert axis.unit == unit
    assert axis.p_value < 1e-6
    assert axis.strength.size == bins
    strongest = int(np.argmax(axis.strength))
    assert axis.edges[strongest] < high
    assert axis.edges[strongest + 1] > low
    assert any(a < high and b > low for a, b in axis.intervals)


def test_what_a_place_takes_is_told_beyond_what_noise_would_give_it():
    planted = 2.0 * ((TIMES > 10) & (TIMES < 11.8))
    gone = float(np.sum(planted**2))
    assert 0.7 * gone < axes_of(white(0) + planted)["time"].excess < 1.1 * gone
    assert axes_of(white(0))["time"].excess == 0


def test_on_noise_no_place_stands_out():
    draws = [axes_of(white(seed)) for seed in range(10)]
    for name in draws[0]:
        p_values = np.array([axes[name].p_value for axes in draws])
        # A bound, by twice the smaller of two tests: never more often than it says.
        assert p_values.min() > 1e-3, name
        assert 0.15 < np.median(p_values) < 1, name


def test_on_noise_with_outliers_no_band_of_frequency_stands_out():
    """Where one sample in fifty is six times as large as the others, their number decides how large
    the noise is, in all bands at once."""
    p_values = []
    for seed in range(100):
        generator = np.random.default_rng(seed)
        noise = white(seed) * np.where(generator.random(TIMES.size) < 0.02, 6.0, 1.0)
        p_values.append(axes_of(noise / np.sqrt(0.98 + 0.02 * 36))["frequency"].p_value)
    assert np.mean(np.array(p_values) < 0.01) <= 0.04


# What a fit leaves --------------------------------------------------------------------------------

TONE_STEP = 4e-3
TONE_TIMES = TONE_STEP * np.arange(1500)
TONES = np.sin(2 * np.pi * np.outer(TONE_TIMES, [0.37, 1.1, 2.3, 5.1, 9.7]) + np.arange(5))
TONE_DRIVE = 50 + TONES @ np.array([14.0, 9.0, 6.0, 4.0, 3.0])
NOISE = 0.01


def residual_of(preparation: Preparation) -> Residual:
    """The residual of a fit of creep."""
    base = fitted([fj.parse_model("creep").block], preparation)
    return Residual.beside(base.whitened(base.error), base.whitened(base.tangent))


def axes_of_a_fit(extra: np.ndarray, seed: int = 0) -> dict:
    """Axes of a creep law's fit to itself, noise and something more (N,) [um]."""
    law = fj.simulate(fj.parse_model("creep"), TONE_DRIVE, TONE_STEP, "constant").response
    noise = NOISE * np.random.default_rng(seed).standard_normal(TONE_TIMES.size)
    recording = fj.Recording(TONE_DRIVE, law + noise + extra, TONE_STEP, "V", "um")
    specification = fj.Noise(NOISE, "um", "specification", np.ones(1), NOISE)
    with jax.enable_x64(True):
        preparation = prepare([recording], history="constant", noise=specification)
        residual = residual_of(preparation)
        axes = locate(preparation, preparation.problems(), residual, 1e6)
    return {axis.axis: axis for axis in axes}


def test_what_is_coherent_with_fast_drive_stands_out_in_its_band():
    """A lag of the fastest tone alone, 0.7 of the noise."""
    axes = axes_of_a_fit(NOISE * np.cos(2 * np.pi * 9.7 * TONE_TIMES + 4))
    assert min(axes.values(), key=lambda axis: axis.p_value).axis == "frequency"
    (low, high), *_ = axes["frequency"].intervals
    assert low <= 9.7 <= high


def test_a_law_of_the_level_stands_out_along_the_level():
    bent = np.clip(TONE_DRIVE - 75, 0, None)
    axes = axes_of_a_fit(4 * NOISE * bent / bent.max())
    assert min(axes.values(), key=lambda axis: axis.p_value).axis == "level"
    assert all(low >= 65 for low, _ in axes["level"].intervals)


def test_a_knock_stands_out_along_the_time():
    axes = axes_of_a_fit(4 * NOISE * np.exp(-(((TONE_TIMES - 4.0) / 0.1) ** 2)))
    assert min(axes.values(), key=lambda axis: axis.p_value).axis == "time"
    ((low, high),) = axes["time"].intervals
    assert low <= 4.0 <= high


def frequency(preparation: Preparation, problems: Any, residual: Residual) -> Axis:
    axes = locate(preparation, problems, residual, 1e6)
    return next(axis for axis in axes if axis.axis == "frequency")


def test_a_hum_that_does_not_repeat_stands_out_in_its_band():
    """In a recording and in its repeat, at another phase: no drive causes it, and no noise."""
    law = fj.simulate(fj.parse_model("creep"), TONE_DRIVE, TONE_STEP, "constant").response
    generator = np.random.default_rng(3)
    once, again = (
        fj.Recording(
            TONE_DRIVE,
            law
            + NOISE * generator.standard_normal(TONE_TIMES.size)
            + NOISE * np.sin(2 * np.pi * 50.02 * TONE_TIMES + phase),
            TONE_STEP,
        )
        for phase in (0.0, 2.0)
    )
    with jax.enable_x64(True):
        preparation = prepare([once], history="constant", repeats=[again])
        shown = frequency(preparation, preparation.problems(), residual_of(preparation))
    assert shown.p_value < 1e-6
    ((low, high),) = shown.intervals
    assert low <= 50.02 <= high
