"""Convolution quadrature: the direct sum, closed forms, finite differences, symmetries."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import gamma

from fracjax._operators import Grid, Laplace, convolve, derivative, direct_convolution, kernel
from tests.helpers import close
from tests.operators.helpers import GENERATOR, SAMPLES, WALK

HISTORIES = ("rest", "constant", "periodic")
ACCURACIES = (1, 2, 3, 4)
ORDERS = (-0.95, -0.5, -0.1, 0.0, 0.1, 0.5, 0.9, 1.0, 1.5, 2.0)
STEP = 0.01

SMOOTH = np.sin(3 * np.arange(SAMPLES) * STEP) ** 2 + 0.5
operate = jax.jit(derivative, static_argnames="accuracy")


def power_series(polynomial: np.ndarray, power: float, count: int) -> np.ndarray:
    """Coefficients (count,) of polynomial(ζ)^power, by Miller's recurrence."""
    series = np.zeros(count)
    series[0] = polynomial[0] ** power
    for n in range(1, count):
        k = np.arange(1, min(n, polynomial.size - 1) + 1)
        series[n] = ((k * power - (n - k)) * polynomial[k]) @ series[n - k]
        series[n] /= n * polynomial[0]
    return series


def weights_by_recurrence(order: float, accuracy: int) -> np.ndarray:
    """Quadrature weights (SAMPLES,) of s^order without any transform."""
    if accuracy == 3:
        fine = weights_by_recurrence(order, 2)
        coarse = np.zeros(SAMPLES)
        coarse[::2] = weights_by_recurrence(order, 2)[: SAMPLES // 2] * 2.0**-order
        return (4 * fine - coarse) / 3
    polynomial = np.zeros(accuracy + 1)
    for k in range(1, accuracy + 1):
        polynomial[: k + 1] += np.polynomial.polynomial.polypow([1, -1], k) / k
    return power_series(polynomial, order, SAMPLES) * STEP**-order


# Kernel and convolution ---------------------------------------------------------------------------


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("order", ORDERS)
def test_kernel_is_the_power_series(order, accuracy):
    found = kernel(lambda s: s**order, SAMPLES, Grid(STEP), accuracy)
    close(found, weights_by_recurrence(order, accuracy), 1e-10)


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("order", ORDERS)
def test_convolution_is_the_direct_sum(order, accuracy):
    weights = weights_by_recurrence(order, accuracy)
    at_rest = operate(order, jnp.asarray(WALK), Grid(STEP, "rest"), accuracy=accuracy)
    close(at_rest, direct_convolution(weights, WALK), 1e-10)
    held = operate(order, jnp.asarray(WALK), Grid(STEP, "constant"), accuracy=accuracy)
    close(held, direct_convolution(weights, WALK - WALK[0]), 1e-10)


@pytest.mark.parametrize("order", ORDERS)
def test_first_order_weights_are_gruenwald_letnikov(order):
    weights = np.ones(SAMPLES)
    for j in range(1, SAMPLES):
        weights[j] = weights[j - 1] * (j - 1 - order) / j
    close(kernel(lambda s: s**order, SAMPLES, Grid(STEP), 1), weights * STEP**-order, 1e-10)


@pytest.mark.parametrize("accuracy", [3, 4])
@pytest.mark.parametrize("samples", [2, 3, 17])
def test_any_length(samples, accuracy):
    drive = WALK[:samples]
    found = convolve(lambda s: 1 / (1 + s), 1.0, jnp.asarray(drive), Grid(STEP, "rest"), accuracy)
    weights = np.asarray(kernel(lambda s: 1 / (1 + s), samples, Grid(STEP), accuracy))
    close(found, direct_convolution(weights, drive), 1e-10)


# Closed forms -------------------------------------------------------------------------------------


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("order", [-0.9, -0.3, 0.2, 0.7, 1.0, 1.4])
def test_error_on_powers_falls_with_the_order_of_the_quadrature(order, accuracy):
    """D^a t^3 = Γ(4)/Γ(4-a) t^(3-a): halving the step divides the error at t = 1 by 2^p."""
    errors = []
    for samples in (40, 80):
        times = np.arange(samples + 1) / samples
        found = derivative(order, jnp.asarray(times**3), Grid(1 / samples, "rest"), accuracy)
        errors.append(abs(float(found[-1]) - gamma(4) / gamma(4 - order)))
    if accuracy >= 3 and order == 1.0:
        assert max(errors) < 1e-9  # a difference of third order is exact on a cubic
    else:
        assert errors[0] / errors[1] == pytest.approx(2**accuracy, rel=0.1)


@pytest.mark.parametrize("order", [-0.8, -0.2, 0.3, 0.9])
@pytest.mark.parametrize("k", [1, 2])
def test_powers_at_every_time(order, k):
    times = np.arange(1001) / 1000
    found = derivative(order, jnp.asarray(times**k), Grid(1e-3, "rest"))
    wanted = gamma(k + 1) / gamma(k + 1 - order) * times[20:] ** (k - order)
    close(found[20:], wanted, 1e-4)


@pytest.mark.parametrize("history", HISTORIES)
def test_order_zero_is_the_identity(history):
    excursion = {
        "rest": WALK,
        "constant": WALK - WALK[0],
        "periodic": WALK - WALK.mean(),
    }[history]
    close(derivative(0.0, jnp.asarray(WALK), Grid(STEP, history)), excursion, 1e-11)


def test_orders_one_and_minus_one_are_derivative_and_integral():
    times = np.arange(401) * 2.5e-3
    drive = jnp.asarray(times**3 * np.cos(5 * times))
    slope = 3 * times**2 * np.cos(5 * times) - 5 * times**3 * np.sin(5 * times)
    grid = Grid(2.5e-3, "rest")
    close(derivative(1.0, drive, grid), slope, 1e-5)
    close(derivative(-1.0, jnp.asarray(slope), grid), drive, 1e-6)


# Histories ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [-0.9, -0.2, 0.4, 1.2])
def test_what_was_always_held_has_no_derivative(order):
    found = derivative(order, jnp.full(SAMPLES, 7.0), Grid(STEP, "constant"))
    np.testing.assert_array_equal(found, 0.0)


@pytest.mark.parametrize("order", [-0.6, -0.1, 0.2, 0.7])
def test_constant_history_sees_only_the_excursion(order):
    grids = Grid(STEP, "constant"), Grid(STEP, "rest")
    held = derivative(order, jnp.asarray(WALK + 40), grids[0])
    close(held, derivative(order, jnp.asarray(WALK - WALK[0]), grids[1]), 1e-9)


@pytest.mark.parametrize("order", [-0.6, -0.1, 0.2, 0.7])
@pytest.mark.parametrize("accuracy", [1, 2, 4])
def test_a_jump_from_rest_decays_as_a_power_of_time(order, accuracy):
    """D^a 1 = t^-a/Γ(1-a), to the one sample (1/n) that a jump leaves open."""
    count = np.arange(1, 1000)
    found = derivative(order, jnp.ones(1000), Grid(STEP, "rest"), accuracy)[1:]
    ratio = np.asarray(found) / ((count * STEP) ** -order / gamma(1 - order))
    assert np.all(np.abs(ratio[20:] - 1) < 1 / count[20:])


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("harmonic", [1, 7, 40])
@pytest.mark.parametrize("samples", [240, 241])
def test_periodic_sine_is_exact(order, harmonic, samples):
    """A sin ωt → A ω^a sin(ωt + aπ/2); the mean is not transmitted.

    To 1e-12 of the drive times the largest gain in the band, which rounding errors are raised by.
    """
    omega = 2 * np.pi * harmonic / (samples * STEP)
    times = np.arange(samples) * STEP
    drive = jnp.asarray(5 + 3 * np.sin(omega * times))
    found = operate(order, drive, Grid(STEP, "periodic"))
    wanted = 3 * omega**order * np.sin(omega * times + order * np.pi / 2)
    largest = max(omega**order, (np.pi / STEP) ** order)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * 3 * largest)


@pytest.mark.parametrize("history", HISTORIES)
def test_static_gain_carries_what_is_held(history):
    found = convolve(lambda s: 2 / (1 + s), 2.0, jnp.full(64, 3.0), Grid(STEP, history))
    settled = 6.0 if history != "rest" else 6 * (1 - np.exp(-STEP * np.arange(64)))
    close(found[4:], np.broadcast_to(settled, 64)[4:], 1e-10 if history != "rest" else 0.02)


# Gradients and transformations --------------------------------------------------------------------


@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.parametrize("order", [-1.0, -0.5, 0.0, 0.5, 1.0])
def test_gradient_in_the_order_is_the_central_difference(order, history):
    aim = jnp.asarray(GENERATOR.standard_normal(SAMPLES))

    def project(a):
        return aim @ operate(a, jnp.asarray(SMOOTH), Grid(STEP, history))

    wanted = (project(order + 1e-5) - project(order - 1e-5)) / 2e-5
    assert float(jax.grad(project)(order)) == pytest.approx(float(wanted), rel=1e-6)


@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.parametrize("order", [-1.0, -0.5, 0.0, 0.5, 1.0])
def test_gradient_in_the_signal_is_the_difference(order, history):
    aim, move = jnp.asarray(GENERATOR.standard_normal((2, SAMPLES)))

    def project(drive):
        return aim @ operate(order, drive, Grid(STEP, history)) ** 2

    wanted = (project(SMOOTH + 1e-5 * move) - project(SMOOTH - 1e-5 * move)) / 2e-5
    found = jax.grad(project)(jnp.asarray(SMOOTH)) @ move
    size = float(jnp.abs(jax.grad(project)(jnp.asarray(SMOOTH))) @ jnp.abs(move))
    assert float(found) == pytest.approx(float(wanted), abs=1e-7 * size)


@pytest.mark.parametrize("history", HISTORIES)
def test_jit_is_eager(history):
    for order in (-0.4, 0.0, 0.8):
        eager = derivative(order, jnp.asarray(WALK), Grid(STEP, history))
        found = operate(order, jnp.asarray(WALK), Grid(STEP, history))
        # At the end of the record the transform is divided by 1e-5, and so is its rounding.
        close(found, eager, np.finfo(float).eps / 1e-5)


@pytest.mark.parametrize("history", HISTORIES)
def test_vmap_is_a_loop(history):
    orders = jnp.asarray(ORDERS)
    drives = jnp.asarray(WALK + np.arange(len(ORDERS))[:, None] * SMOOTH)
    grid = Grid(STEP, history)
    batch = jax.vmap(lambda a, u: derivative(a, u, grid))(orders, drives)
    for found, order, drive in zip(batch, orders, drives, strict=True):
        close(found, operate(order, drive, grid), 1e-11)


@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.parametrize("accuracy", ACCURACIES)
def test_several_orders_at_once_are_each_alone(accuracy, history):
    grid = Grid(STEP, history)
    together = operate(jnp.asarray(ORDERS)[:, None], WALK, grid, accuracy=accuracy)
    for found, order in zip(together, ORDERS, strict=True):
        close(found, operate(order, WALK, grid, accuracy=accuracy), 1e-11)


@pytest.mark.parametrize("history", HISTORIES)
def test_several_lags_at_once_are_each_alone(history):
    grid, drive = Grid(STEP, history), jnp.asarray(WALK)
    gains, times = np.array([[0.5], [2.0]]), np.array([[0.03], [0.2]])
    together = convolve(lambda s: gains / (1 + times * s), gains, drive, grid)
    for found, gain, time in zip(together, gains[:, 0], times[:, 0], strict=True):
        close(found, convolve(lambda s, g=gain, t=time: g / (1 + t * s), gain, drive, grid), 1e-11)


# Properties ---------------------------------------------------------------------------------------

fractions = st.floats(-0.95, 0.95)
seeds = st.integers(0, 2**32 - 1)
accuracies = st.sampled_from(ACCURACIES)
at_rest = Grid(STEP, "rest")


def draw(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((2, SAMPLES))


@settings(max_examples=40)
@given(fractions, seeds, st.floats(-10, 10), st.sampled_from(HISTORIES))
def test_superposition(order, seed, factor, history):
    u, v = draw(seed)
    grid = Grid(STEP, history)
    parts = [np.asarray(operate(order, x, grid)) for x in (u, v)]
    scale = np.abs(parts[0]).max() + abs(factor) * np.abs(parts[1]).max()
    whole = operate(order, u + factor * v, grid)
    np.testing.assert_allclose(whole, parts[0] + factor * parts[1], rtol=0, atol=1e-9 * scale)


@settings(max_examples=40)
@given(fractions, seeds, st.integers(1, SAMPLES - 1), accuracies)
def test_a_late_drive_has_a_late_response(order, seed, late, accuracy):
    drive = draw(seed)[0]
    delayed = np.concatenate([np.zeros(late), drive[:-late]])
    found = np.asarray(operate(order, delayed, at_rest, accuracy=accuracy))
    prompt = np.asarray(operate(order, drive, at_rest, accuracy=accuracy))
    scale = np.abs(prompt).max()
    np.testing.assert_allclose(found[:late], 0.0, atol=1e-9 * scale)
    np.testing.assert_allclose(found[late:], prompt[:-late], rtol=0, atol=1e-9 * scale)


@settings(max_examples=40)
@given(fractions, seeds, st.integers(1, SAMPLES - 1), accuracies)
def test_the_future_does_not_change_the_past(order, seed, now, accuracy):
    one, other = draw(seed)
    other[:now] = one[:now]
    grid = Grid(STEP, "constant")
    past, changed = (np.asarray(operate(order, x, grid, accuracy=accuracy)) for x in (one, other))
    assert np.abs(past[now:] - changed[now:]).max() > 1e-6  # the futures do differ
    scale = np.abs(past).max()
    np.testing.assert_allclose(changed[:now], past[:now], rtol=0, atol=1e-9 * scale)


@settings(max_examples=40)
@given(fractions, fractions, seeds, accuracies.filter(lambda p: p != 3))
def test_orders_add_from_rest(a, b, seed, accuracy):
    drive = draw(seed)[0]
    inner = operate(b, drive, at_rest, accuracy=accuracy)
    found = np.asarray(operate(a, inner, at_rest, accuracy=accuracy))
    wanted = np.asarray(operate(a + b, drive, at_rest, accuracy=accuracy))
    gain = float(np.abs(kernel(lambda s: s**a, SAMPLES, at_rest, accuracy)).sum())
    scale = np.abs(wanted).max() + gain * float(np.abs(inner).max())
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9 * scale)


@settings(max_examples=40)
@given(fractions, seeds, st.floats(1e-3, 1e3), st.sampled_from(HISTORIES))
def test_time_in_another_unit(order, seed, unit, history):
    drive = draw(seed)[0]
    found = np.asarray(operate(order, drive, Grid(STEP * unit, history)))
    close(found, unit**-order * np.asarray(operate(order, drive, Grid(STEP, history))), 1e-10)


# The Laplace variable -----------------------------------------------------------------------------


@pytest.mark.parametrize("factor", [2, 2.0, np.float64(2), np.array(2.0), jnp.asarray(2.0)])
def test_the_laplace_variable_calculates_as_its_array(factor):
    points = np.array([0.3 + 0.4j, 1e-3j, 2 - 1j])
    s, plain = Laplace(points, 0.5), points / 0.5
    for found, wanted in (
        (factor * s, 2 * plain),
        (s * factor, 2 * plain),
        (s + factor, plain + 2),
        (factor + s, plain + 2),
        (s - factor, plain - 2),
        (factor - s, 2 - plain),
        (s / factor, plain / 2),
        (factor / s, 2 / plain),
        (-s, -plain),
        (s**2, plain**2),
        (s**factor, plain**2),
        (s**-0.4, plain**-0.4),
        (jnp.exp(jnp.asarray(s)), np.exp(plain)),
    ):
        np.testing.assert_allclose(found, wanted, rtol=1e-14)
