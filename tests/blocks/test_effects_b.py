"""Friction, lost contact, slew limit, gain drift, viscoelastic layer, clock skew, quantisation:
each against an oracle of its own, and what a recording says about their sizes."""

from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import erfcx
from scipy.stats import norm

import fracjax as fj
from fracjax._blocks import (
    EFFECTS,
    FOH,
    AbstractBlock,
    ClockSkew,
    CoulombFriction,
    GainDrift,
    LostContact,
    LuGreFriction,
    Quantisation,
    SlewRateLimit,
    ThrownLoad,
    ViscoelasticLayer,
)
from fracjax._diagnose._residual import residual_of
from fracjax._diagnose._score import EffectScore, Scorer
from fracjax._fit import prepare, solve_from
from fracjax._fit._problem import resolution, setting_of
from fracjax._operators import Grid
from fracjax._parameters import named_parameters, set_values
from tests.helpers import respond, specified

STEP = 2e-3
TIMES = np.arange(601) * STEP
GRID = Grid(STEP, "constant")
NAMES = (
    "coulomb_friction",
    "LuGre's friction",
    "lost_contact",
    "thrown load",
    "slew_rate_limit",
    "gain_drift",
    "viscoelastic_layer",
    "clock_skew",
    "quantisation",
)
EFFECTS_HERE = [name for name in NAMES if name in EFFECTS]


def motion(times):
    """A motion [um] with inner loops that starts at rest."""
    return 6 * np.sin(np.pi * times) ** 2 + 2 * np.sin(3 * np.pi * times) ** 2


def rate_of_motion(times):
    return 6 * np.pi * np.sin(2 * np.pi * times) + 6 * np.pi * np.sin(6 * np.pi * times)


def errors_of(simulate, exact, counts=(150, 300, 600)) -> list[float]:
    """Largest errors over 1.2 s on ever finer grids."""
    grids = [np.linspace(0, 1.2, count + 1) for count in counts]
    return [float(np.abs(simulate(t) - exact(t)).max()) for t in grids]


# Coulomb friction ---------------------------------------------------------------------------------

friction = CoulombFriction(0.4, 0.7, span=8.0)


def test_friction_is_dahls_differential_equation():
    def slope(t, z):
        speed = rate_of_motion(t)
        return speed * (1 - z * np.sign(speed)) / 0.7

    solution = solve_ivp(
        slope, (0, 1.2), [0.0], t_eval=TIMES, rtol=1e-10, atol=1e-12, max_step=STEP
    )
    wanted = motion(TIMES) - 0.4 * solution.y[0]
    np.testing.assert_allclose(respond(friction, motion(TIMES), GRID), wanted, rtol=0, atol=2e-5)


def test_friction_is_exact_where_the_motion_turns_at_samples():
    """Closed form from turning point to turning point, and a plain loop in between."""
    turns, z = [0.0, 5.0, -1.0, -0.5, 3.0], 0.0
    path = np.concatenate([np.linspace(a, b, 8)[:-1] for a, b in pairwise(turns)])
    ends = []
    for a, b in pairwise(turns):
        sign = np.sign(b - a)
        z = sign + (z - sign) * np.exp(-abs(b - a) / 0.7)
        ends.append(b - 0.4 * z)
    found = respond(friction, np.append(path, turns[-1]), GRID)
    np.testing.assert_allclose(found[7::7], ends, rtol=0, atol=1e-14)


def test_friction_widens_a_large_loop_by_twice_its_deflection():
    angle = np.linspace(0, 6 * np.pi, 1201)
    loop = respond(friction, 20 * np.sin(angle), GRID) - 20 * np.sin(angle)
    rising, falling = loop[800], loop[1000]  # both through the middle
    assert falling - rising == pytest.approx(0.8, abs=1e-9)


def test_friction_after_a_reversal_has_turned_round_after_its_presliding_length():
    """From 1 to -1: at the presliding length z = 2/e - 1."""
    found = respond(friction, np.array([0.0, 50.0, 50.0 - 0.7]), GRID)
    assert found[2] == pytest.approx(50 - 0.7 - 0.4 * (2 / np.e - 1), abs=1e-12)


lubricated = LuGreFriction(0.4, 0.7, 0.5, 20.0, span=8.0)


def test_lugres_friction_is_its_differential_equation():
    """The motion that it sees is the one that it holds back: dx = dy - a dz."""

    def slope(t, z):
        speed = rate_of_motion(t)
        left = 1 - z * np.sign(speed) / (1 + 0.5 * np.exp(-((speed / 20.0) ** 2)))
        return speed * left / (0.7 + 0.4 * left)

    solution = solve_ivp(
        slope, (0, 1.2), [0.0], t_eval=TIMES, rtol=1e-10, atol=1e-12, max_step=STEP
    )
    wanted = motion(TIMES) - 0.4 * solution.y[0]
    errors = []
    for finer in (1, 4, 16):
        fine = np.arange(600 * finer + 1) * STEP / finer
        found = respond(lubricated, motion(fine), Grid(STEP / finer, "constant"))[::finer]
        errors.append(np.abs(found - wanted).max())
    assert errors[0] < 5e-5
    assert errors[1] < 0.4 * errors[0]
    assert errors[2] < 0.4 * errors[1]


def test_lugres_friction_of_stiff_guides_is_dahls_and_of_sticking_ones_a_play():
    plain = {"excess": 0.0, "presliding": 0.7}
    stiff = set_values(lubricated, plain | {"amplitude": 1e-5})
    dahl = set_values(friction, {"amplitude": 1e-5})
    held = motion(TIMES) - respond(dahl, motion(TIMES), GRID)
    np.testing.assert_allclose(
        motion(TIMES) - respond(stiff, motion(TIMES), GRID), held, rtol=0, atol=1e-9
    )
    sticking = set_values(lubricated, {"excess": 0.0, "presliding": 1.6e-3, "amplitude": 0.4})
    play, wanted = 0.0, []
    for y in motion(TIMES):
        play = np.clip(play, y - 0.4, y + 0.4)
        wanted.append(play)
    np.testing.assert_allclose(respond(sticking, motion(TIMES), GRID), wanted, rtol=0, atol=0.02)


def test_lugres_friction_is_larger_in_slow_motion():
    """Pulled steadily it holds back by a g, and a once the pull is fast."""
    for speed, force in ((0.02, 1.5), (200.0, 1.0)):
        pulled = speed * TIMES * 1e3
        found = pulled - respond(lubricated, pulled, Grid(STEP * 1e3, "constant"))
        assert found[-1] == pytest.approx(0.4 * force, rel=1e-3)


# Lost contact -------------------------------------------------------------------------------------

thrown = ThrownLoad(120.0, typical=200.0)


def test_a_thrown_load_falls_freely_until_it_lands_and_rides_on():
    """On 3 cos ωt it leaves on the way up, where the motion's acceleration is -300."""
    omega, step = 2 * np.pi * 2, 1e-4
    block = ThrownLoad(300.0, typical=500.0)
    leaves = 0.5 - np.arccos(300 / (3 * omega**2)) / omega

    def ridden(t):
        return 3 * np.cos(omega * t)

    def flown(t):
        speed = -3 * omega * np.sin(omega * leaves)
        return ridden(leaves) + speed * (t - leaves) - 150 * (t - leaves) ** 2

    # SciPy's types know not which of its two answers this is.
    lands: Any = brentq(lambda t: flown(t) - ridden(t), leaves + 0.2, leaves + 0.4)
    times = np.arange(0, 1.2, step)
    found = respond(block, ridden(times), Grid(step, "constant"))
    in_flight, riding = (
        (low + step < times) & (times < high - step)
        for low, high in ((leaves, lands), (lands, leaves + 0.5))
    )
    np.testing.assert_allclose(found[in_flight], flown(times[in_flight]), rtol=0, atol=3e-3)
    np.testing.assert_array_equal(found[riding], ridden(times[riding]))


def test_lost_contact_has_one_kink_wherever_the_zero_lies():
    block = LostContact(0.6, 1.5, low=0.0, span=8.0)
    for zero in (0.0, 37.0, -4.0):
        lifted = motion(TIMES) + zero
        wanted = zero + np.where(
            motion(TIMES) >= 1.5, motion(TIMES), 1.5 + 0.4 * (motion(TIMES) - 1.5)
        )
        np.testing.assert_allclose(respond(block, lifted, GRID), wanted, rtol=0, atol=1e-13)


def test_a_load_that_is_left_behind_stands_still():
    block = LostContact(1.0, 1.5, low=0.0, span=8.0)
    found = respond(block, motion(TIMES), GRID)
    assert found.min() == pytest.approx(1.5, abs=1e-13)


# Slew rate ----------------------------------------------------------------------------------------


def test_a_slew_limit_is_the_plain_recursion():
    drive = np.random.default_rng(2).uniform(-10, 10, 300)
    voltage, wanted = drive[0], []
    for command in drive:
        voltage += np.clip(command - voltage, -1.5, 1.5)
        wanted.append(voltage)
    found = respond(SlewRateLimit(1.5 / STEP, top=1e4), drive, GRID)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)


def limited_sine(limit: float, times):
    """sin(2πt), followed from t = 0 until its rate falls to the limit's, by the closed form.

    From rest at 0 the voltage rises at the limit R until it meets the sine again, follows it to
    where the sine falls faster than R, and so on in half periods.
    """
    onset = np.arccos(limit / (2 * np.pi)) / (2 * np.pi)  # rate falls below R; mirrored beyond 1/4
    level = np.sin(2 * np.pi * onset)

    def follow(start, value, sign, stop):
        def gap(t):
            return value + sign * limit * (t - start) - np.sin(2 * np.pi * t)

        return brentq(gap, start + 1e-6, stop)

    first = follow(0.0, 0.0, 1, 0.5)
    wanted, t0 = np.sin(2 * np.pi * times), 0.0
    limited = times <= first
    wanted[limited] = limit * times[limited]
    for k in range(1, 3):  # the falling stretch about t = 1/2, the rising one about t = 1
        t0, sign = k / 2 - onset, (-1) ** k
        value = -sign * level
        meet = follow(t0, value, sign, k / 2 + 0.25)
        limited = (times > t0) & (times < meet)
        wanted[limited] = value + sign * limit * (times[limited] - t0)
    return wanted


def test_a_slew_limit_on_a_sine_is_its_closed_form_to_second_order():
    limit = 0.8 * 2 * np.pi
    block = SlewRateLimit(limit, top=10.0)

    def simulate(t):
        return respond(block, np.sin(2 * np.pi * t), Grid(t[1], "constant"))

    errors = errors_of(simulate, lambda t: limited_sine(limit, t), (150, 600, 2400))
    assert errors[0] < 2e-3
    assert errors[1] < errors[0] / 8
    assert errors[2] < errors[1] / 8


def test_a_slew_limit_never_reached_is_exactly_nothing():
    drive = motion(TIMES)
    np.testing.assert_array_equal(respond(SlewRateLimit(100.0, top=100.0), drive, GRID), drive)


# Gain drift ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("losses", [1.0, 1.6, 2.0])
def test_gain_drift_is_its_thermal_equation_to_second_order(losses):
    block = GainDrift(0.2, 2.5, 0.4, losses, speed=14.0, size=3.0)

    def power(t):
        moved = np.abs(motion(t) - motion(0.0)) / 3
        return np.abs(rate_of_motion(t) / 14) ** losses * moved ** (2 - losses)

    def exact(t):
        solution = solve_ivp(
            lambda t, warming: (power(t) - warming) / 0.4,
            (0, 1.2), [0.0], t_eval=t, rtol=1e-10, atol=1e-12, max_step=0.01,
        )  # fmt: skip
        return motion(t) + (0.2 * motion(t) + 0.5) * solution.y[0]

    # The motion counts from its first value, wherever that lies.
    errors = errors_of(lambda t: respond(block, motion(t) + 5, Grid(t[1], "constant")) - 5, exact)
    assert errors[2] < 3e-4
    assert errors[1] < errors[0] / 3.5
    assert errors[2] < errors[1] / 3.5


def test_a_ramp_warms_exactly_as_an_exponential():
    found = respond(GainDrift(1.0, 0.0, 0.4, speed=3.0, size=1.0), 3 * TIMES, GRID) - 3 * TIMES
    # No power has come before the first sample.
    np.testing.assert_allclose(found, -3 * TIMES * np.expm1(-TIMES / 0.4), rtol=0, atol=1e-12)


def test_a_gain_changes_by_its_share_in_the_long_run():
    """At its own mean power the warming goes to 1, and starts there if periodic."""
    angle = 2 * np.pi * np.arange(100) / 100
    power = float(np.mean(np.diff(np.sin(angle), append=0.0) ** 2)) / STEP**2
    block = GainDrift(0.1, 0.0, 20.0, speed=np.sqrt(power), size=1.0)
    steady = respond(block, np.sin(angle), Grid(STEP, "periodic"))
    np.testing.assert_allclose(steady, 1.1 * np.sin(angle), rtol=0, atol=1e-3)


def test_a_gain_that_follows_its_power_within_a_cycle_is_no_drift():
    """Of a sine the motion turns in 1/ω."""
    frequency = 2 * np.pi * 3.0
    fast, slow = (
        GainDrift(0.1, 0.0, tau, speed=frequency, size=1.0).time_constant for tau in (0.04, 0.06)
    )
    assert 0.04 < 1 / frequency < 0.06
    assert not fast.is_plausible
    assert slow.is_plausible


def test_a_gain_that_begins_at_rest_forgets_its_first_response():
    """Of a drive that begins with a jump a fractional law's first response depends on the step."""
    block = GainDrift(0.1, 1.0, 0.01, speed=1.0, size=1.0)
    drive = np.sin(9 * TIMES)
    jumped = np.concatenate([[100.0], drive[1:]])
    late = TIMES > 0.5
    found, other = (respond(block, d, Grid(STEP, "rest"))[late] for d in (drive, jumped))
    np.testing.assert_allclose(other, found, rtol=0, atol=1e-12)


# Viscoelastic layer -------------------------------------------------------------------------------


def test_a_layer_relaxes_as_a_mittag_leffler_function():
    """Of order 1/2 after a step: 1 - Δ E_½(-√(t/τ)), E_½(-x) = exp(x²) erfc(x); of order near 1 an
    exponential."""
    times = np.arange(1, 400) * 1e-2
    block = ViscoelasticLayer(0.3, 0.5, 0.5)
    found = fj.step_response(block, np.append(0.0, times))[1:]
    np.testing.assert_allclose(found[20:], (1 - 0.3 * erfcx(np.sqrt(times / 0.5)))[20:], atol=2e-4)
    single = set_values(block, {"order": 1.0})
    found = fj.step_response(single, np.append(0.0, times))[1:]
    np.testing.assert_allclose(found, 1 - 0.3 * np.exp(-times / 0.5), atol=1e-4)


def test_a_layer_stiffens_from_one_to_the_share_that_is_left():
    block = ViscoelasticLayer(0.3, 1.0, 0.4)
    slow, fast = np.abs(fj.frequency_response(block, [1e-12, 1e12]))
    assert slow == pytest.approx(1, abs=1e-4)
    assert fast == pytest.approx(0.7, abs=1e-4)
    # A layer that the motion passes through leads instead.
    leading = set_values(block, {"strength": -0.3})
    assert (
        np.angle(fj.frequency_response(leading, 0.2))
        > 0
        > np.angle(fj.frequency_response(block, 0.2))
    )


# Clock skew ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("skew", [-8e-4, 8e-4])
def test_a_skewed_clock_reads_the_drive_at_other_times(skew):
    found = respond(ClockSkew(skew), motion(TIMES), GRID)
    np.testing.assert_allclose(found[:-3], motion(TIMES * (1 + skew))[:-3], rtol=0, atol=2e-5)


def test_a_skewed_clock_in_a_periodic_record_reads_on_into_the_next_period():
    times = np.arange(500) * STEP  # motion has the period 1 s
    found = respond(ClockSkew(9e-4), motion(times), Grid(STEP, "periodic"))
    np.testing.assert_allclose(found, motion(times * (1 + 9e-4)), rtol=0, atol=2e-5)


# Quantisation -------------------------------------------------------------------------------------


def test_sharp_quantisation_is_rounding():
    block, values = Quantisation(0.3, 0.02, step=0.5), np.linspace(-7.3, 9.1, 2001)
    found = respond(block, values, GRID)
    wanted = 0.5 * (np.round(values / 0.5 - 0.3) + 0.3)
    corners = np.abs((values / 0.5 - 0.3) % 1 - 0.5) < 0.12
    np.testing.assert_allclose(found[~corners], wanted[~corners], rtol=0, atol=1e-8)
    assert corners.mean() < 0.25


@pytest.mark.parametrize("noise", [0.05, 0.2, 0.5])
def test_quantisation_is_the_mean_of_rounding_over_the_noise(noise):
    """Σ_k k P(the noisy value rounds to k), over all codes."""
    values, codes = np.linspace(-2.2, 3.1, 401), np.arange(-12, 14)
    place = values[:, None] / 0.5 - 0.3
    chance = norm.cdf((codes + 0.5 - place) / noise) - norm.cdf((codes - 0.5 - place) / noise)
    wanted = 0.5 * (chance @ codes + 0.3)
    found = respond(Quantisation(0.3, noise, step=0.5), values, GRID)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-6)


def test_noise_of_a_third_of_a_step_hides_the_steps():
    values = np.linspace(0, 5, 501)
    errors = [
        np.ptp(respond(Quantisation(0.0, noise, step=0.5), values, GRID) - values) / 0.5
        for noise in (0.02, 1 / 3, 0.5)
    ]
    assert errors[0] > 0.8
    assert errors[1] == pytest.approx(2 / np.pi * np.exp(-2 * np.pi**2 / 9), rel=0.02)
    assert errors[2] < 0.005


# What they have in common -------------------------------------------------------------------------

CYCLE = 30 + 20 * np.sin(2 * np.pi * np.arange(200) / 200)


@pytest.mark.parametrize(
    "block",
    [friction, SlewRateLimit(150.0, top=400.0), GainDrift(0.1, 1.0, 0.4, 1.4, speed=1e2, size=5.0)],
    ids=["coulomb_friction", "slew_rate_limit", "gain_drift"],
)
def test_periodic_history_is_the_last_of_many_cycles(block):
    steady = respond(block, CYCLE, Grid(STEP, "periodic"))
    many = respond(block, np.tile(CYCLE, 20), GRID)
    # Of the first cycle gain_drift sees another start: y is counted from the same first value.
    np.testing.assert_allclose(steady, many[-200:], rtol=0, atol=1e-6)


ALL: dict[str, tuple[AbstractBlock, dict]] = {
    "coulomb_friction": (friction, {"amplitude": 0.0}),
    "LuGre's friction": (lubricated, {"amplitude": 1e-17}),
    "lost_contact": (
        LostContact(0.6, 1.5, 0.1, low=0.0, span=8.0),
        {"share": 0.0, "compliance": 0.0},
    ),
    "thrown load": (thrown, {"holding": 1e9}),
    "slew_rate_limit": (SlewRateLimit(15.0, top=60.0), {"rate": 1e9}),
    "gain_drift": (
        GainDrift(0.2, 0.5, 0.4, 1.4, speed=14.0, size=3.0),
        {"gain": 0.0},
    ),
    "viscoelastic_layer": (ViscoelasticLayer(0.3, 0.1, 0.3), {"strength": 0.0}),
    "clock_skew": (ClockSkew(5e-4), {"skew": 0.0}),
    "quantisation": (Quantisation(0.3, 0.2, step=0.5), {"share": 0.0}),
}


@pytest.mark.parametrize("history", ["rest", "constant", "periodic"])
@pytest.mark.parametrize("name", NAMES)
def test_without_amplitude_the_signal_passes_as_it_is(name, history):
    """To the last bit, but for the layer, whose convolution rounds, and where no amplitude is 0."""
    block, nothing = ALL[name]
    signal = motion(TIMES[:500])
    error = respond(set_values(block, nothing), signal, Grid(STEP, history)) - signal
    assert np.abs(error).max() <= {"viscoelastic_layer": 1e-11, "LuGre's friction": 1e-16}.get(
        name, 0
    )
    assert np.abs(respond(block, signal, Grid(STEP, history)) - signal).max() > 1e-3


@pytest.mark.parametrize("history", ["rest", "constant", "periodic"])
@pytest.mark.parametrize("name", NAMES)
def test_reverse_mode_is_the_finite_difference(name, history):
    """Along one direction of all parameters, and along one of the signal."""
    block, _ = ALL[name]
    # Off the turning points, where the friction has a kink.
    signal, grid = jnp.asarray(motion(TIMES[:500] + 0.0137)), Grid(STEP, history)
    values = {n: jnp.asarray(p.value) for n, p in named_parameters(block).items()}
    generator = np.random.default_rng(4)
    aim, turn = jnp.asarray(generator.standard_normal((2, 500)))

    @jax.jit
    def project(values, signal):
        return aim @ set_values(block, values)(signal, grid)

    by_value, by_sample = jax.jit(jax.grad(project, (0, 1)))(values, signal)
    for direction, slope, size in (
        (values, sum(float(g) * float(values[n]) for n, g in by_value.items()), 1e-6),
        (turn, float(by_sample @ turn), 1e-7),
    ):
        ends = [
            project({n: v * (1 + e) for n, v in values.items()}, signal)
            if direction is values
            else project(values, signal + e * turn)
            for e in (size, -size)
        ]
        difference = float(ends[0] - ends[1]) / (2 * size)
        assert slope == pytest.approx(difference, rel=1e-3, abs=1e-5)


def test_from_rest_the_first_sample_is_already_a_motion():
    drive = np.full(50, 5.0)
    moved = respond(friction, drive, Grid(STEP, "rest"))
    np.testing.assert_allclose(moved, 5 + 0.4 * np.expm1(-5 / 0.7), rtol=0, atol=1e-13)
    np.testing.assert_array_equal(respond(friction, drive, GRID), drive)
    climbing = respond(SlewRateLimit(1 / STEP, top=1e3), drive, Grid(STEP, "rest"))
    np.testing.assert_allclose(climbing, np.minimum(np.arange(1, 51), 5.0), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(
        respond(GainDrift(0.1, 1.0, 0.4, speed=1.0, size=1.0), drive, Grid(STEP, "rest")), drive
    )


# What a recording says ----------------------------------------------------------------------------


@given(
    step=st.floats(1e-6, 1e3),
    origin=st.floats(-5, 5),
    noise=st.floats(0.0, 3.0),
    seed=st.integers(0, 1000),
)
def test_the_step_of_a_converter_is_found(step, origin, noise, seed):
    generator = np.random.default_rng(seed)
    codes = np.round(20 * np.sin(np.arange(400) / 9) + noise * generator.standard_normal(400))
    codes[:3] = 0, 1, 3
    assert resolution((codes + origin) * step) == pytest.approx(step, rel=1e-6)


def test_codes_that_were_scaled_and_rounded_still_lie_on_a_grid():
    codes = np.round(60 * np.sin(np.arange(900) / 40))
    assert resolution(np.round(codes * 0.0305176, 3)) == pytest.approx(0.0305176, rel=1e-3)


def test_noise_of_many_digits_lies_on_no_grid():
    generator = np.random.default_rng(5)
    assert resolution(generator.standard_normal(500)) == 0
    assert resolution(np.sin(np.arange(500.0))) == 0


RATE = 500.0
SECONDS = np.arange(3000) / RATE


def rich_drive(times):
    """A drive [V] of growing frequency and changing amplitude, smoothly from 5 V."""
    swell = 0.3 + 0.7 * np.sin(2 * np.pi * times / 6) ** 2
    return (
        50
        + 45 * swell * np.sin(2 * np.pi * (0.6 + 0.4 * times) * times)
        - 45 * np.exp(-((times / 0.4) ** 2))
    )


BASE = FOH(k_l=0.07, k_h=0.04, k_p=1.5e-6, alpha=0.14, beta=-0.13)
DRIVE = rich_drive(SECONDS)
PLAIN = respond(BASE, DRIVE, Grid(1 / RATE, "constant"))


def recorded(response) -> fj.Recording:
    return fj.Recording(drive=DRIVE, response=response, dt=1 / RATE)


def test_the_setting_tells_rates_and_levels_of_the_recordings():
    one, other = recorded(PLAIN), recorded(0.1 * np.round(PLAIN / 0.1))
    setting = setting_of([one, other])
    rates = np.diff(DRIVE) * RATE
    assert setting.top_rate == pytest.approx(np.abs(rates).max())
    assert setting.rms_rate == pytest.approx(np.sqrt(np.mean(rates**2)))
    assert setting.response_low == min((r.response - r.response[0]).min() for r in (one, other))
    assert setting.resolution == 0
    assert setting_of([other]).resolution == pytest.approx(0.1)


@pytest.mark.parametrize("name", EFFECTS_HERE)
def test_every_trial_is_of_a_sensible_size(name):
    """A load is thrown by some of its trials only."""
    setting, effect = setting_of([recorded(0.05 * np.round(PLAIN / 0.05))]), EFFECTS[name]
    sizes: dict[bool, list[float]] = {False: [], True: []}
    for trial in effect.trials(setting):
        changed = respond(effect.insert(BASE, trial), DRIVE, Grid(1 / RATE, "constant"))
        change = (changed - changed.mean()) - (PLAIN - PLAIN.mean())
        size = float(np.abs(change).max() / np.ptp(PLAIN))
        sizes[isinstance(trial, ThrownLoad)].append(size)
    assert all(1e-5 < size < 0.3 for size in sizes[False])
    assert not sizes[True] or any(1e-5 < size < 0.3 for size in sizes[True])


@pytest.mark.parametrize("name", EFFECTS_HERE)
def test_a_program_of_the_derivatives_compiles_quickly(name):
    """It does not grow with the recording: no loop is unrolled over samples or recursed over."""
    effect = EFFECTS[name]
    trial = effect.trials(setting_of([recorded(0.05 * np.round(PLAIN / 0.05))]))[0]

    def size(samples: int) -> int:
        def simulate(scale, u):
            return effect.insert(BASE, trial)(scale * u, Grid(1 / RATE))

        derivative = jax.jacfwd(simulate)
        program = jax.make_jaxpr(derivative)(1.0, jnp.zeros(samples))
        return len(str(program).splitlines())

    assert size(4000) == size(1000)


# The score test -----------------------------------------------------------------------------------


def scored(name: str, response: np.ndarray, sigma: float) -> EffectScore:
    """The effect's score after FOH has been fitted to the response."""
    white = specified(sigma)
    preparation = prepare([recorded(response)], noise=white, history="constant")
    solved = solve_from([BASE], preparation)
    residual = residual_of(solved, preparation)
    setting, problems = preparation.setting, preparation.problems()
    return Scorer(solved.blocks, problems, residual).score(EFFECTS[name], setting)


NOISE = np.random.default_rng(8).standard_normal(DRIVE.size)


@pytest.mark.parametrize(("noise", "seen"), [(0.05, True), (0.2, True), (0.6, False), (1.5, False)])
def test_a_converter_is_seen_only_where_its_noise_is_below_its_step(noise, seen):
    step = 0.1
    response = step * np.round(PLAIN / step + 0.21 + noise * NOISE)
    score = scored("quantisation", response, step * np.hypot(noise, np.sqrt(1 / 12)))
    assert (np.abs(score.z).max() > 8) == seen
    assert seen or np.abs(score.z).max() < 4
