"""The rate of a drive: exact on polynomials, both-sided at corners, calm at the ends."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fracjax._operators import Grid, rate, speed
from tests.helpers import close

HISTORIES = ("rest", "constant", "periodic")

STEP = 0.01


@pytest.mark.parametrize("history", ["rest", "constant", "periodic"])
def test_at_the_corners_of_a_triangle_the_speed_is_that_of_both_sides(history):
    """On the corner itself; beside it the difference across it errs, on a finer grid between
    samples."""
    triangle = jnp.asarray(np.tile(np.r_[np.arange(0.0, 20), np.arange(20.0, 0, -1)], 3))
    found = np.asarray(speed(triangle, Grid(0.5, history)))
    near = np.min(np.abs(np.arange(120)[:, None] - 20 * np.arange(7)), axis=1)
    inner = slice(0 if history == "periodic" else 3, -3)
    np.testing.assert_allclose(found[inner][near[inner] != 1], 2.0, rtol=1e-12)
    assert np.all(np.abs(found[inner][near[inner] == 1] - 2) < 0.4)


def test_the_speed_of_a_smooth_signal_is_the_size_of_its_rate():
    angles = jnp.asarray(2 * np.pi / 400 * np.arange(400))
    grid = Grid(angles[1], "periodic")
    found = np.asarray(speed(jnp.sin(angles), grid))
    np.testing.assert_allclose(found, np.abs(np.cos(angles)), rtol=0, atol=1e-6)
    slope = jax.jvp(lambda a: speed(a * jnp.sin(angles), grid), (1.0,), (1.0,))[1]
    np.testing.assert_allclose(slope, found, rtol=0, atol=1e-12)


@pytest.mark.parametrize("history", HISTORIES)
def test_rate_is_exact_on_polynomials_of_degree_four(history):
    times = np.arange(50) * STEP
    found = rate(jnp.asarray(times**4 - times), Grid(STEP, history))
    close(found[2:-2], (4 * times**3 - 1)[2:-2], 1e-11)


def test_rate_at_the_ends():
    """Held before the first sample, foretold after the last; wrapped where periodic."""
    ramp = jnp.arange(20.0)
    found = rate(ramp, Grid(1.0, "constant"))
    close(found[2:], np.ones(18), 1e-12)
    assert 0 < float(found[0]) < 1
    angles = 2 * np.pi * np.arange(400) / 400
    close(rate(jnp.sin(angles), Grid(angles[1], "periodic")), np.cos(angles), 1e-8)


@pytest.mark.parametrize("samples", [40, 80, 160])
def test_rate_at_the_last_sample_of_a_sine(samples):
    """Of third order: at 40 samples a period it errs by less than 0.2 % of the largest rate, where
    a straight line errs by 5 %."""
    for phase in np.linspace(0, 2 * np.pi, 16):
        angles = 2 * np.pi * np.arange(3 * samples) / samples + phase
        found = np.asarray(rate(jnp.sin(angles), Grid(2 * np.pi / samples, "constant")))
        bound = 1.05 * (2 * np.pi / samples) ** 3 / 4
        assert np.abs(found - np.cos(angles))[-2:].max() < bound + (2 * np.pi / samples) ** 4


@pytest.mark.parametrize("after", [3, 4, 6, 20])
def test_rate_after_a_corner_is_that_of_the_line(after):
    """A cubic through the corner would miss by several times the rate."""
    signal = 10.0 - np.abs(np.arange(50.0) - (49 - after))
    found = np.asarray(rate(jnp.asarray(signal), Grid(1.0, "constant")))
    np.testing.assert_allclose(found[-1], -1.0, rtol=1e-12)


def test_rate_of_noise_goes_straight_on():
    generator = np.random.default_rng(0)
    ramps = np.arange(60.0) + generator.standard_normal((400, 60))
    found = np.array([rate(jnp.asarray(ramp), Grid(1.0, "constant"))[-1] for ramp in ramps])
    # Straight on it is (7, -8, 1)/6, whose noise is 1.78; through a cubic 3.84.
    assert np.std(found - 1) < 2.0


@pytest.mark.parametrize("history", ["constant", "periodic"])
@pytest.mark.parametrize("every", [1, 2, 4])
def test_speeds_of_many_signals_at_some_samples_are_those_of_each(history, every):
    signals, grid = np.random.default_rng(0).standard_normal((3, 41)), Grid(0.5, history)
    signals[2] = np.abs(np.arange(41) % 8 - 4.0)
    each = [np.asarray(speed(signal, grid))[::every] for signal in signals]
    np.testing.assert_allclose(speed(signals, grid, every), each, rtol=1e-12)
