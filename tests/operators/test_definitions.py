"""The classical definitions against closed forms, direct sums and each other; Oustaloup."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lsim
from scipy.special import gamma, rgamma

import fracjax as fj
from fracjax import _operators as ops

ORDERS = (-2.0, -1.3, -0.4, 0.3, 0.7, 1.3, 2.0)
POLYNOMIAL = (1.0, 2.0, 3.0, 1.0)  # f = 1 + 2t + 3t² + t³: starts neither at zero nor flat


def on_grid(samples: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Times (N+1,) from 0 to 1 s, the polynomial there, and the step."""
    times = np.linspace(0, 1, samples + 1)
    return times, np.polynomial.polynomial.polyval(times, POLYNOMIAL), 1 / samples


def exact(order: float, times: np.ndarray, first_term: int = 0) -> np.ndarray:
    """D^a of the polynomial from its `first_term` on, each D^a t^k = Γ(k+1)/Γ(k+1-a) t^(k-a)."""
    terms = [
        c * gamma(k + 1) * rgamma(k + 1 - order) * times ** (k - order)
        for k, c in enumerate(POLYNOMIAL)
    ]
    return np.sum(terms[first_term:], axis=0)


# Riemann–Liouville, Caputo, Grünwald–Letnikov -----------------------------------------------------


@pytest.mark.parametrize("order", ORDERS)
def test_riemann_liouville_and_caputo_of_a_polynomial(order):
    """At the end of the record, to second order or better."""
    first_term = int(np.ceil(max(order, 0)))
    for operator, start in ((ops.riemann_liouville, 0), (ops.caputo, first_term)):
        errors = []
        for samples in (100, 200):
            times, signal, step = on_grid(samples)
            found = np.asarray(operator(order, signal, step))
            errors.append(abs(found[-1] - exact(order, times[-1:], start)[0]))
        assert errors[0] < 1e-5
        if order == 2:
            # Exact for a cubic: only the transform's rounding is left, over h².
            assert errors[1] < 1e-8 * abs(exact(order, times[-1:], start)[0])
        else:
            assert errors[1] < errors[0] / 3.9


@pytest.mark.parametrize("order", [0.3, 0.7, 1.3, 1.8])
def test_caputo_is_riemann_liouville_without_the_known_terms(order):
    times, signal, step = on_grid(400)
    known = signal[0] * times[1:] ** -order / gamma(1 - order)
    if order > 1:
        known = known + 2.0 * times[1:] ** (1 - order) / gamma(2 - order)
    difference = ops.riemann_liouville(order, signal, step) - ops.caputo(order, signal, step)
    np.testing.assert_allclose(difference[1:], known, rtol=1e-8, atol=1e-11 * np.abs(known).max())


@pytest.mark.parametrize("order", [0.3, 0.7])
def test_grunwald_letnikov_differs_from_caputo_by_the_known_term(order):
    """For a signal that does not start at zero, to the first order of the sum."""
    errors = []
    for samples in (500, 1000):
        times, signal, step = on_grid(samples)
        known = signal[0] * times[1:] ** -order / gamma(1 - order)
        sums = np.asarray(ops.grunwald_letnikov(order, signal, step))[1:]
        errors.append(np.abs(sums - np.asarray(ops.caputo(order, signal, step))[1:] - known)[-1])
    assert errors[0] < 1e-2
    assert errors[1] == pytest.approx(errors[0] / 2, rel=0.02)


@pytest.mark.parametrize("order", ORDERS)
def test_grunwald_letnikov_is_its_definition(order):
    _, signal, step = on_grid(300)
    weights = np.ones(301)
    for j in range(1, 301):
        weights[j] = weights[j - 1] * (j - 1 - order) / j
    wanted = ops.direct_convolution(weights * step**-order, signal)
    found = ops.grunwald_letnikov(order, signal, step)
    # What wraps round the circle has grown, where the order is below -1.
    share = 1e-9 if order < -1 else 1e-10
    np.testing.assert_allclose(found, wanted, rtol=0, atol=share * np.abs(wanted).max())


@pytest.mark.parametrize("order", [0.5, 0.8, 1.6])
def test_caputo_of_an_exponential_is_mittag_leffler(order):
    """D^a e^-t = (-1)^m t^(m-a) E_{1,m+1-a}(-t), by mpmath's series; 1e-5 of its peak."""
    times = np.linspace(0, 2, 2001)
    terms = int(np.ceil(order))
    at = times[[200, 1000, 2000]]

    def closed(t: float) -> float:
        series = mpmath.nsum(lambda k: (-t) ** int(k) / mpmath.gamma(int(k) + terms + 1 - order),
                             [0, mpmath.inf])  # fmt: skip
        return (-1) ** terms * t ** (terms - order) * float(series)

    found = np.asarray(ops.caputo(order, np.exp(-times), times[1]))[[200, 1000, 2000]]
    np.testing.assert_allclose(found, [closed(t) for t in at], rtol=0, atol=1e-5)


@pytest.mark.parametrize("order", [0.25, 1.0, 1.5])
def test_the_integral_undoes_the_derivative(order):
    times = np.linspace(0, 1, 401)
    signal = times**3
    back = ops.riemann_liouville(order, ops.fractional_integral(order, signal, times[1]), times[1])
    np.testing.assert_allclose(back, signal, rtol=0, atol=1e-6)


@pytest.mark.parametrize("order", [-1.5, -0.5, 0.5, 1.5])
def test_weyl_turns_and_scales_a_sine(order):
    omega, samples = 2 * np.pi * 3, 300
    times = np.arange(samples) / samples
    found = ops.weyl(order, 2 + np.sin(omega * times), 1 / samples)
    wanted = omega**order * np.sin(omega * times + order * np.pi / 2)
    np.testing.assert_allclose(
        found, wanted, rtol=0, atol=1e-11 * (np.pi * samples) ** max(order, 0)
    )


# Through integer orders, gradients, types ---------------------------------------------------------


@pytest.mark.parametrize("operator", [ops.riemann_liouville, ops.grunwald_letnikov, ops.weyl])
@pytest.mark.parametrize("order", [-1.0, 0.0, 0.4, 1.0])
def test_gradient_in_the_order_is_the_difference(operator, order):
    _, signal, step = on_grid(60)
    aim = np.random.default_rng(0).standard_normal(60)

    def project(a):
        return jnp.asarray(aim) @ operator(a, signal - 1, step)[1:]

    wanted = float(project(order + 1e-5) - project(order - 1e-5)) / 2e-5
    assert float(jax.grad(project)(order)) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("order", [-1.0, 0.0, 1.0, 2.0])
def test_integer_orders_are_the_classical_operators(order):
    times, signal, step = on_grid(400)
    found = np.asarray(ops.caputo(order, signal, step))
    by_order = {
        -1.0: np.polyint,
        0.0: lambda p: p,
        1.0: np.polyder,
        2.0: lambda p: np.polyder(p, 2),
    }
    wanted = np.polyval(by_order[order](np.poly1d(POLYNOMIAL[::-1])), times)
    np.testing.assert_allclose(found[10:], wanted[10:], rtol=1e-6)


def test_float64_whatever_the_user_has_set(float32_default):
    _, signal, step = on_grid(50)
    for operator in (ops.riemann_liouville, ops.caputo, ops.grunwald_letnikov, ops.weyl):
        assert operator(0.4, signal, step).dtype == np.float64
    with pytest.raises(fj.InputError, match="expected float64 inside a JAX transformation"):
        jax.grad(lambda a: ops.weyl(a, signal, step).sum())(0.4)


@pytest.mark.parametrize("operator", ["riemann_liouville", "caputo", "grunwald_letnikov", "weyl"])
@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        ((0.4, np.ones((3, 50)), 0.1), r"shape \(3, 50\)"),
        ((0.4, np.ones(50) * 1j, 0.1), "complex"),
        ((0.4, np.ones(3), 0.1), r"shape \(3,\)"),
        ((2.5, np.ones(50), 0.1), "2.5"),
        ((np.nan, np.ones(50), 0.1), "nan"),
        ((0.4, np.ones(50), 0.0), "0.0"),
        ((0.4, np.ones(50), np.inf), "inf"),
    ],
)
def test_bad_arguments_are_refused_in_one_sentence(operator, arguments, found):
    with pytest.raises(fj.InputError, match=f"^{operator}.*: expected .*found .*{found}.*; .*"):
        getattr(ops, operator)(*arguments)


def test_caputo_wants_a_plain_order():
    with pytest.raises(fj.InputError, match=r"use fracjax\.derivative"):
        jax.jit(lambda a: ops.caputo(a, np.ones(50), 0.1))(0.4)


# Long records -------------------------------------------------------------------------------------


def test_a_million_samples():
    """D^0.4 t² at the end of a long record, to 1e-11: memory is linear in the length."""
    count = 1_000_000
    times = np.arange(count) / count
    found = np.asarray(ops.riemann_liouville(0.4, times**2, 1 / count))
    wanted = 2 / gamma(2.6) * times**1.6
    np.testing.assert_allclose(found[10:], wanted[10:], rtol=0, atol=1e-9)


# Oustaloup ----------------------------------------------------------------------------------------

LOW, HIGH = 0.1, 1e4
order_of_filter = st.floats(-0.95, 0.95)


@settings(max_examples=30)
@given(order_of_filter)
def test_oustaloup_follows_the_power_inside_its_band(order):
    omega = np.geomspace(10 * LOW, HIGH / 10, 20)
    filtered = ops.oustaloup(order, LOW, HIGH, 8)
    wanted = (1j * omega) ** order
    np.testing.assert_allclose(filtered.symbol(1j * omega) / wanted, 1.0, rtol=0, atol=0.1)


def test_oustaloup_limits_of_the_band():
    """[F 10]: with unit gain at the centre, (ω_h/ω_b)^(∓μ/2) far below and far above."""
    for order in (-0.3, 0.3):
        filtered = ops.oustaloup(order, LOW, HIGH, 5, unit_gain_at_centre=True)
        at = np.array([1e-9, np.sqrt(LOW * HIGH), 1e12]) * 1j
        wanted = [(HIGH / LOW) ** (-order / 2), 1.0, (HIGH / LOW) ** (order / 2)]
        np.testing.assert_allclose(np.abs(filtered.symbol(at)), wanted, rtol=1e-6)


def test_oustaloup_poles_and_zeros_swap_with_the_sign():
    one, other = (ops.oustaloup(sign * 0.4, LOW, HIGH, 3) for sign in (1, -1))
    np.testing.assert_allclose(one.zeros, other.poles)
    np.testing.assert_allclose(one.poles, other.zeros)
    assert one.gain * other.gain == pytest.approx(1.0)


@settings(max_examples=20)
@given(order_of_filter, st.integers(0, 8))
def test_partial_fractions_are_the_filter(order, number):
    filtered = ops.oustaloup(order, LOW, HIGH, number)
    s = 1j * np.geomspace(1e-3, 1e6, 15)
    fractions = filtered.gain + (filtered.residues() / (s[:, None] + filtered.poles)).sum(1)
    np.testing.assert_allclose(fractions, filtered.symbol(s), rtol=1e-9)


@pytest.mark.parametrize("order", [-0.4, 0.3])
@pytest.mark.parametrize("settled", [False, True])
def test_streaming_is_the_exact_response_to_a_straight_drive(order, settled):
    """Against SciPy's state-space simulation, and sample by sample against the scan."""
    filtered = ops.oustaloup(order, 1.0, 1e4, 3)
    step, times = 1e-3, np.arange(400) * 1e-3
    drive = 2 + np.sin(30 * times) + (times > 0.2)
    streamed = ops.streaming(filtered, step)
    found = np.asarray(streamed.run(jnp.asarray(drive), settled=settled))
    system = (np.diag(-filtered.poles), np.ones((7, 1)), filtered.residues()[None], filtered.gain)
    start = drive[0] / filtered.poles if settled else np.zeros(7)
    if settled:
        _, wanted, _ = lsim(system, drive, times, X0=start)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())
    states, before = streamed.start(drive[0], settled=settled), drive[0] if settled else 0.0
    for n, sample in enumerate(drive):
        states, response = streamed.step(states, before, sample)
        before = sample
        assert float(response) == pytest.approx(float(found[n]), abs=1e-9)


def test_streaming_is_exact_however_slow_its_poles_are():
    """Over one step of time 1, ∫ e^(-p (1 - τ)) τ dτ and the same of 1 - τ, in 50 digits."""
    poles = np.array([1e-12, 1e-6, 9e-4, 1.1e-3, 1.0])
    filtered = ops.PoleZero(2 * poles, poles, 3.0)
    streamed, residues = ops.streaming(filtered, 1.0), filtered.residues()
    with mpmath.workdps(50):
        exact = [
            ((p - 1 + mpmath.exp(-p)) / p**2, (1 - (1 + p) * mpmath.exp(-p)) / p**2)
            for p in map(mpmath.mpf, poles)
        ]
    now, before = np.array(exact, dtype=float).T
    np.testing.assert_allclose(streamed.now / residues, now, rtol=1e-9)
    np.testing.assert_allclose(streamed.before / residues, before, rtol=1e-9)


def test_streaming_approaches_the_operator_within_the_band():
    times = np.arange(4000) * 1e-3
    drive = np.sin(2 * np.pi * 5 * times)
    found = ops.streaming(ops.oustaloup(0.3, 0.01, 1e5, 10), 1e-3).run(jnp.asarray(drive))
    wanted = ops.caputo(0.3, drive, 1e-3)
    np.testing.assert_allclose(found[500:], wanted[500:], rtol=0, atol=0.01 * np.abs(wanted).max())


@pytest.mark.parametrize(
    ("call", "found"),
    [
        (lambda: ops.oustaloup(1.0, LOW, HIGH), "1.0"),
        (lambda: ops.oustaloup(0.3, HIGH, LOW), "10000.0 to 0.1"),
        (lambda: ops.oustaloup(0.3, LOW, np.inf), "inf"),
        (lambda: ops.oustaloup(0.3, LOW, HIGH, 99), "99"),
        (lambda: ops.streaming(ops.oustaloup(0.3, LOW, HIGH), 0.0), "0.0"),
    ],
)
def test_bad_filters_are_refused_in_one_sentence(call, found):
    with pytest.raises(fj.InputError, match=f"expected .*found .*{found}.*; "):
        call()
