"""Where a mismatch is: the axes of places, on residuals whose place is known."""

import jax
import numpy as np
from scipy.stats import kstest

import fracjax as fj
from fracjax._diagnose._locate import locate
from fracjax._diagnose._residual import residual_of
from fracjax._fit import prepare, solve_from

STEP = 4e-3
TIMES = STEP * np.arange(1500)
TONES = np.sin(2 * np.pi * np.outer(TIMES, [0.37, 1.1, 2.3, 5.1, 9.7]) + np.arange(5))
DRIVE = 50 + TONES @ np.array([14.0, 9.0, 6.0, 4.0, 3.0])
NOISE = 0.01


def axes_of(extra: np.ndarray, seed: int = 0) -> dict:
    """Axes of a creep law's fit to itself, noise and something more (N,) [um]."""
    law = fj.simulate(fj.parse_model("creep"), DRIVE, STEP, "constant").response
    noise = NOISE * np.random.default_rng(seed).standard_normal(TIMES.size)
    recording = fj.Recording(DRIVE, law + noise + extra, STEP, "V", "um")
    told = fj.Noise(NOISE, "um", "specification", np.ones(1), NOISE)
    with jax.enable_x64(True):
        preparation = prepare([recording], history="constant", noise=told)
        solved = solve_from([fj.parse_model("creep").block], preparation)
        residual = residual_of(solved, preparation)
        found = locate(preparation, preparation.problems(), residual, 1e6)
    return {axis.axis: axis for axis in found}


def test_what_is_coherent_with_fast_drive_stands_out_in_its_band():
    """A lag of the fastest tone alone, 0.7 of the noise."""
    axes = axes_of(NOISE * np.cos(2 * np.pi * 9.7 * TIMES + 4))
    assert min(axes.values(), key=lambda axis: axis.p_value).axis == "frequency"
    (low, high), *_ = axes["frequency"].intervals
    assert low <= 9.7 <= high


def test_a_law_of_the_level_stands_out_along_the_level():
    bent = np.clip(DRIVE - 75, 0, None)
    axes = axes_of(4 * NOISE * bent / bent.max())
    assert min(axes.values(), key=lambda axis: axis.p_value).axis == "level"
    assert all(low >= 65 for low, _ in axes["level"].intervals)


def test_a_knock_stands_out_along_the_time():
    axes = axes_of(4 * NOISE * np.exp(-(((TIMES - 4.0) / 0.1) ** 2)))
    assert min(axes.values(), key=lambda axis: axis.p_value).axis == "time"
    ((low, high),) = axes["time"].intervals
    assert low <= 4.0 <= high


def test_of_noise_alone_no_axis_has_too_small_a_p_value():
    """Each p-value is the least of several, so that it may be too large, not too small."""
    found = [axes_of(np.zeros(TIMES.size), seed) for seed in range(40)]
    for name in found[0]:
        p_values = np.array([axes[name].p_value for axes in found])
        assert kstest(p_values, "uniform", alternative="greater").pvalue > 1e-3, name
