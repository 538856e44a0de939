"""Sensor lag and curvature, second mode, cubic, Rayleigh, backlash: each against its own oracle.

What all blocks have in common is tested in test_blocks.py.
"""

from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, least_squares, linprog
from scipy.special import gammainc

from fracjax._blocks import (
    EFFECTS,
    FOH,
    AmplitudeDependence,
    Backlash,
    CubicNonlinearity,
    DriveLag,
    Resonance,
    SecondMode,
    SensorFilter,
    SensorLag,
    SensorNonlinearity,
    Setting,
    frequency_response,
    poles,
    step_response,
)
from fracjax._operators import Grid
from fracjax._operators._grid import History
from fracjax._parameters import named_parameters, set_values
from tests.helpers import respond

NAMES = (
    "sensor_lag",
    "second_mode",
    "cubic_nonlinearity",
    "amplitude_dependence",
    "backlash",
    "sensor_nonlinearity",
)
GRID = Grid(1e-3, "constant")
STARTS: tuple[History, ...] = ("rest", "constant")
each_effect = pytest.mark.parametrize("name", NAMES)


def smooth(times):
    """A drive that leaves 3 V as t⁶, so that a quadrature shows its full order."""
    return 3 + 5 * np.sin(9 * times) ** 6


def solved(numerator, denominator, times) -> np.ndarray:
    """The law's response to `smooth`, at rest at its first value, by an adaptive solver."""
    a, b, c, d = signal.tf2ss(numerator, denominator)
    excursion = solve_ivp(
        lambda t, state: a @ state + b[:, 0] * (smooth(t) - 3),
        (0, times[-1]),
        np.zeros(len(a)),
        "DOP853",
        times,
        rtol=1e-12,
        atol=1e-12,
    ).y
    gain = numerator[-1] / denominator[-1]
    return gain * 3 + c[0] @ excursion + d[0, 0] * (smooth(times) - 3)


def order_of(block, numerator, denominator, samples: int) -> tuple[float, float]:
    """Largest error against the solver on the finest of three grids, and the order it shows."""
    errors = []
    for steps in (samples, 2 * samples, 4 * samples):
        times = np.linspace(0, 1, steps + 1)
        found = respond(block, smooth(times), Grid(1 / steps, "constant"))
        errors.append(np.abs(found - solved(numerator, denominator, times)).max())
    return errors[-1], float(np.log2(errors[-2] / errors[-1]))


# Sensor lag ---------------------------------------------------------------------------------------


def gains(numerator, denominator, frequencies) -> np.ndarray:
    s = 2j * np.pi * frequencies
    return np.polyval(numerator, s) / np.polyval(denominator, s)


def chain(order: int, corner: float) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator of equal low-passes that together have their corner there."""
    pole = 2 * np.pi * corner / np.sqrt(2 ** (1 / order) - 1)
    denominator = np.poly(np.full(order, -pole))
    return denominator[-1:], denominator


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_sensor_lag_is_a_chain_of_low_passes(order):
    block = SensorLag(40.0, order)
    numerator, denominator = chain(order, 40.0)
    frequencies = np.geomspace(0.1, 4000, 50)
    wanted = gains(numerator, denominator, frequencies)
    np.testing.assert_allclose(frequency_response(block, frequencies), wanted, rtol=1e-10)
    assert abs(frequency_response(block, 40.0)[0]) == pytest.approx(1 / np.sqrt(2), rel=1e-12)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_sensor_lag_is_its_differential_equation_to_fourth_order(order):
    numerator, denominator = chain(order, 6.0)
    error, shown = order_of(SensorLag(6.0, order), numerator, denominator, 500)
    assert error < 1e-7
    assert shown == pytest.approx(4, abs=0.2)


@pytest.mark.parametrize(("order", "damping"), [(2, 0.8660254037844386), (2, 0.5**0.5), (4, 1.0)])
def test_a_sensor_filter_is_bessels_butterworths_or_a_chain(order, damping):
    block = SensorFilter(40.0, order, damping)
    pair = np.array([1, 2 * damping, 1.0])
    pole = float(block.frequency)
    denominator = np.array([1.0])
    for _ in range(order // 2):
        denominator = np.polymul(denominator, pair * [1 / pole**2, 1 / pole, 1.0])
    frequencies = np.geomspace(0.1, 4000, 50)
    wanted = gains(np.ones(1), denominator, frequencies)
    np.testing.assert_allclose(frequency_response(block, frequencies), wanted, rtol=1e-10)
    assert abs(frequency_response(block, 40.0)[0]) == pytest.approx(1 / np.sqrt(2), rel=1e-12)


ANALOG: dict[str, Any] = {
    "bessel": lambda order: signal.bessel(order, 100.0, analog=True),
    "butter": lambda order: signal.butter(order, 100.0, analog=True),
}


@pytest.mark.parametrize(
    ("design", "order", "limit"),
    [("bessel", 3, 1e-4), ("bessel", 4, 8e-4), ("butter", 3, 1e-3), ("butter", 4, 6e-3)],
)
def test_a_sensor_filter_comes_close_to_those_of_unlike_pairs(design, order, limit):
    numerator, denominator = ANALOG[design](order)
    frequencies = np.geomspace(0.1, 0.5 * corner_of(numerator, denominator), 200)
    wanted = gains(numerator, denominator, frequencies)

    def miss(numbers: np.ndarray) -> np.ndarray:
        block = SensorFilter(numbers[0], numbers[1], numbers[2])
        change = frequency_response(block, frequencies) - wanted
        return np.concatenate([np.real(change), np.imag(change)])

    bounds = ([5.0, 1.01, 0.66], [50.0, 3.999, 0.99])
    found = least_squares(miss, [16.0, 3.0, 0.8], bounds=bounds, x_scale=[10, 1, 0.1])
    assert np.sqrt(2 * found.cost / frequencies.size) < limit


def corner_of(numerator, denominator) -> float:
    """Where the gain is 1/√2, in Hz."""
    root: Any = brentq(lambda f: np.abs(gains(numerator, denominator, f)) - np.sqrt(0.5), 0.1, 100)
    return root


@pytest.mark.parametrize("order", [1.3, 2.0, 3.6])
def test_a_step_through_a_sensor_of_any_order_is_a_gamma_distribution(order):
    block = SensorLag(5.0, order)
    times = np.arange(2001) * 1e-4
    with jax.enable_x64(True):
        wanted = gammainc(order, times / float(block.time_constant))
    found = step_response(block, times)
    assert np.abs(found - wanted)[10:].max() < 2e-3
    assert np.abs(found - wanted)[200:].max() < 1e-5


def test_a_sensor_of_first_order_is_a_lag_of_the_drive():
    drive = smooth(np.arange(500) * 1e-3)
    wanted = respond(DriveLag(1 / (2 * np.pi * 7)), drive, GRID)
    np.testing.assert_allclose(respond(SensorLag(7.0, 1.0), drive, GRID), wanted, rtol=1e-12)


# Second mode --------------------------------------------------------------------------------------


def rational(block: SecondMode) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator of the sum of the two modes, by polynomials."""
    v = {name: float(p.value) for name, p in named_parameters(block).items()}
    omega = 2 * np.pi * v["frequency"] * np.array([1, v["ratio"]])
    zeta = np.array([v["damping"], v["second_damping"]])
    first, second = ([1 / w**2, 2 * z / w, 1] for w, z in zip(omega, zeta, strict=True))
    share = v["participation"]
    numerator = np.polyadd(np.multiply(1 - share, second), np.multiply(share, first))
    return numerator, np.polymul(first, second)


BOTH_SIGNS = [SecondMode(8.0, 1.6, p, 0.05, 0.1) for p in (0.4, -0.3)]


@pytest.mark.parametrize("block", BOTH_SIGNS)
def test_second_mode_is_its_rational_function(block):
    numerator, denominator = rational(block)
    frequencies = np.geomspace(0.1, 100, 60)
    wanted = gains(numerator, denominator, frequencies)
    found = frequency_response(block, frequencies)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)
    roots = np.sort_complex(np.roots(denominator))
    np.testing.assert_allclose(np.sort_complex(poles(block)), roots, rtol=1e-9)


@pytest.mark.parametrize("block", BOTH_SIGNS)
def test_second_mode_is_its_differential_equation_to_third_order(block):
    numerator, denominator = rational(block)
    error, shown = order_of(block, numerator, denominator, 2000)
    assert error < 4e-6
    assert shown == pytest.approx(3, abs=0.2)


def test_the_notch_lies_where_the_modes_cancel():
    """(1-p)/(1 - f²/f_1²) + p/(1 - f²/f_2²) = 0: between the peaks, beyond both, or nowhere."""
    for share in (0.3, 0.8, -0.2):
        block = SecondMode(100.0, 2.0, share, 1e-3, 1e-3)
        notch = 100 / np.sqrt(share + (1 - share) / 4)
        assert (100 < notch < 200) if share > 0 else notch > 200
        depth, beside = np.abs(frequency_response(block, [notch, 1.2 * notch]))
        assert depth < 0.03 * beside
    none = np.abs(frequency_response(SecondMode(100.0, 2.0, -0.5), np.linspace(1, 1000, 2000)))
    slope = np.diff(np.log(none))
    assert np.count_nonzero((slope[:-1] < 0) & (slope[1:] >= 0)) == 1  # only between the peaks
    assert none[100:400].min() > 0.3


def test_second_mode_without_participation_is_one_mode():
    drive = smooth(np.arange(500) * 1e-3)
    alone = SecondMode(30.0, 2.5, 0.0, 0.04)
    np.testing.assert_allclose(
        respond(alone, drive, GRID), respond(Resonance(30.0, 0.04), drive, GRID), 1e-12
    )
    beyond = SecondMode(30.0, 100.0, 0.2, 0.04, 0.7)
    wanted = 0.8 * respond(Resonance(30.0, 0.04), drive, GRID) + 0.2 * drive
    np.testing.assert_allclose(respond(beyond, drive, GRID), wanted, atol=2e-2)


@pytest.mark.parametrize("block", [SensorLag(9.0), *BOTH_SIGNS])
def test_steady_periods_have_the_gain_of_each_harmonic(block):
    times = np.arange(400) / 400
    for harmonic in (2, 11):
        gain = frequency_response(block, harmonic)[0]
        found = respond(block, 1 + np.cos(2 * np.pi * harmonic * times), Grid(1 / 400, "periodic"))
        wanted = 1 + np.real(gain * np.exp(2j * np.pi * harmonic * times))
        np.testing.assert_allclose(found, wanted, atol=1e-10)


# Cubic --------------------------------------------------------------------------------------------


def harmonics(response) -> np.ndarray:
    """Real amplitudes of the cosines in one period."""
    return 2 * np.real(np.fft.rfft(response)) / response.size


def test_cubic_nonlinearity_makes_the_harmonics_of_a_cube():
    """cos³ = (3 cos + cos 3)/4, and about another point the square of electrostriction."""
    cosine = np.cos(2 * np.pi * np.arange(64) / 64)
    block = CubicNonlinearity(0.4, low=20.0, high=100.0)
    for amplitude in (10.0, 40.0):
        found = harmonics(respond(block, 60 + amplitude * cosine, GRID))
        size = 0.4 * amplitude**3 / 80**2
        np.testing.assert_allclose(found[1:5], [amplitude + 0.75 * size, 0, size / 4, 0], atol=1e-9)
    moved = set_values(block, {"centre": 48.0})
    found = harmonics(respond(moved, 60 + 40 * cosine, GRID))
    assert found[2] == pytest.approx(0.5 * 3 * 0.4 * 12 * 40**2 / 80**2, rel=1e-9)
    assert respond(block, np.array([100.0]), GRID)[0] == pytest.approx(
        100 + 0.4 * 80 / 8, rel=1e-14
    )


def test_cubic_nonlinearity_rises_within_its_bounds():
    drive = np.linspace(20, 100, 200)
    for q in (-1.0, 1.0):
        assert np.all(np.diff(respond(CubicNonlinearity(q, low=20.0, high=100.0), drive, GRID)) > 0)


# Rayleigh -----------------------------------------------------------------------------------------

ALPHA, SPAN = 0.3, 80.0
rayleigh = AmplitudeDependence(ALPHA, span=SPAN)
GRAIN = 2.5e-4 * ALPHA * SPAN  # of the sum over radii, for each turning point kept


def parabolas(path, start: float) -> float:
    """Rayleigh's response at the end of a path of turning points: a chain of parabolas.

    A chain holds the farthest point from the virgin state and the ever smaller swings after it.
    """
    chain: list[float] = []
    for level in path:
        while True:
            if len(chain) >= 2 and (level - chain[-1]) * (chain[-1] - chain[-2]) >= 0:
                chain.pop()
            elif len(chain) >= 2 and abs(level - chain[-1]) >= abs(chain[-1] - chain[-2]):
                del chain[-2:]
            elif len(chain) == 1 and abs(level - start) >= abs(chain[0] - start):
                chain.pop()
            else:
                break
        if not chain or level != chain[-1]:
            chain.append(level)
    virgin = 2 * (chain[0] - start) * abs(chain[0] - start)
    branches = sum((b - a) * abs(b - a) for a, b in pairwise(chain))
    return ALPHA / SPAN * (virgin + branches)


levels = st.floats(0, SPAN, width=32)


@given(levels, st.lists(levels, min_size=1, max_size=15))
def test_rayleigh_remembers_turning_points_as_a_chain_of_parabolas(start, path):
    drive = np.array([start, *path] + [path[-1]] * (15 - len(path)))
    found = respond(rayleigh, drive, GRID) - drive - 4 * ALPHA * start
    for count, response in enumerate(found[1 : len(path) + 1], start=1):
        assert abs(response - parabolas(path[:count], start)) <= count * GRAIN


def test_rayleigh_starts_on_the_virgin_parabola():
    drive = np.linspace(0, SPAN, 300)
    for history in STARTS:
        found = respond(rayleigh, drive, Grid(1e-3, history)) - drive
        np.testing.assert_allclose(found, 2 * ALPHA * drive**2 / SPAN, atol=GRAIN)


@pytest.mark.parametrize(("exercised", "share"), [(0.0, 1.0), (0.5, 2 / 3), (1.0, 0.5)])
def test_rayleigh_of_an_exercised_actuator_starts_on_a_later_branch(exercised, share):
    """Come down from beyond its range it rises as from any turning point, by half the virgin
    parabola; and where it comes back to, it does as before."""
    rise = np.linspace(0, SPAN, 300)
    drive = np.concatenate([rise, rise[::-1], rise])
    block = AmplitudeDependence(ALPHA, exercised, span=SPAN)
    found = respond(block, drive, GRID) - drive
    first = found[:300] - found[0]
    np.testing.assert_allclose(first, 2 * share * ALPHA * rise**2 / SPAN, atol=2 * GRAIN)
    again = found[600:] - found[600]
    np.testing.assert_allclose(again, ALPHA * rise**2 / SPAN, atol=2 * GRAIN)


@pytest.mark.parametrize("width", [10.0, 20.0, 40.0, 80.0])
def test_rayleigh_loops_are_parabolas_with_area_as_the_cube(width):
    rise = np.linspace(0, width, 400, endpoint=False)
    low = 40 - width / 2
    drive = low + np.concatenate([rise, width - rise])
    found = respond(rayleigh, drive, Grid(1e-3, "periodic")) - drive
    up, down = found[:400], found[400:]
    np.testing.assert_allclose(up - up[0], ALPHA * rise**2 / SPAN, atol=2 * GRAIN)
    np.testing.assert_allclose(down - down[0], -ALPHA * rise**2 / SPAN, atol=2 * GRAIN)
    assert (down[0] - up[0]) / width == pytest.approx(ALPHA * width / SPAN, abs=2 * GRAIN / width)
    opening = down[200] - up[200]
    assert opening == pytest.approx(ALPHA * width**2 / (2 * SPAN), abs=2 * GRAIN)
    area = np.sum(down[::-1][:-1] - up[1:]) * width / 400
    assert area == pytest.approx(ALPHA * width**3 / (3 * SPAN), abs=2 * GRAIN * width)


def test_laws_of_plays_and_powers_do_not_see_the_clock():
    drive = smooth(np.arange(300) * 5e-3)
    for block in (
        rayleigh,
        Backlash(0.5, 0.3, span=8.0),
        CubicNonlinearity(0.2, low=3.0, high=8.0),
        SensorNonlinearity(0.02, 0.01, centre=5.0, span=8.0),
    ):
        np.testing.assert_array_equal(
            respond(block, drive, Grid(1.0, "constant")),
            respond(block, drive, Grid(1e-5, "constant")),
        )


# Backlash -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", STARTS)
def test_backlash_is_a_plain_loop(start):
    motion = np.random.default_rng(8).uniform(-3, 3, 400).cumsum()
    weight, radius = 0.7, 1.3
    joint, wanted = (0.0 if start == "rest" else motion[0]), []
    for y in motion:
        if y - joint > radius:
            joint = y - radius
        elif joint - y > radius:
            joint = y + radius
        wanted.append((1 - weight) * y + weight * joint)
    found = respond(Backlash(weight, radius, span=100.0), motion, Grid(1e-3, start))
    np.testing.assert_allclose(found, wanted, atol=1e-12)


@pytest.mark.parametrize("width", [3.0, 8.0, 20.0])
def test_backlash_has_one_opening_at_all_amplitudes(width):
    rise = np.linspace(0, width, 600, endpoint=False)
    block = Backlash(0.6, 1.0, span=20.0)
    found = respond(block, np.concatenate([rise, width - rise]), Grid(1e-3, "periodic"))
    up, down = found[:600], np.concatenate([found[600:], found[:1]])[::-1][:600]
    crossing = rise <= 2.0
    np.testing.assert_allclose((up - up[0])[crossing], 0.4 * rise[crossing], atol=1e-12)
    beyond = (rise >= 2.0) & (rise <= width - 2.0)
    np.testing.assert_allclose((down - up)[beyond], 2 * 0.6 * 1.0, atol=1e-12)


def test_backlash_passes_a_constant_on():
    motion = 5 * np.sin(np.arange(300) / 20)
    block = Backlash(0.6, 1.0, span=10.0)
    for history in ("constant", "periodic"):
        shifted = respond(block, motion + 7, Grid(1e-3, history))
        np.testing.assert_allclose(
            shifted, respond(block, motion, Grid(1e-3, history)) + 7, atol=1e-12
        )


def test_radius_moves_the_reading_by_the_weight_while_the_joint_is_closed():
    motion = 5 * np.sin(np.arange(300) / 20)
    block = Backlash(0.6, 1.0, span=10.0)
    ends = [respond(set_values(block, {"radius": 1.0 + e}), motion, GRID) for e in (1e-6, -1e-6)]
    slope = (ends[0] - ends[1]) / 2e-6
    behind = motion - respond(set_values(block, {"weight": 1.0}), motion, GRID)
    closed = np.abs(behind) > 1 - 1e-9
    assert 0.5 < closed.mean() < 1
    np.testing.assert_allclose(slope[closed], -0.6 * np.sign(behind[closed]), atol=1e-6)


# Sensor nonlinearity ------------------------------------------------------------------------------


def off_the_best_line(x, z) -> float:
    """Largest distance from the straight line that makes it least, by linear programming."""
    one = np.ones_like(x)
    above, below = np.column_stack([x, one, -one]), np.column_stack([-x, -one, -one])
    return linprog(
        [0, 0, 1], np.vstack([above, below]), np.concatenate([z, -z]), bounds=(None, None)
    ).fun


def test_sensor_nonlinearity_is_that_of_the_data_sheet():
    reach = np.linspace(-30, 50, 401)
    for s_2, s_3, share in ((0.02, 0.0, 0.01), (0.0, -0.04, 0.01)):
        block = SensorNonlinearity(s_2, s_3, centre=10.0, span=80.0)
        reading = respond(block, reach, GRID)
        np.testing.assert_allclose(
            reading[[0, 200, 400]],
            [-30 + 80 * (s_2 - s_3), 10.0, 50 + 80 * (s_2 + s_3)],
            atol=1e-12,
        )
        assert off_the_best_line(reach, reading) == pytest.approx(share * 80, rel=1e-3)


def test_another_centre_is_the_same_law_at_another_gain_and_offset():
    reach, move = np.linspace(-30, 50, 101), 0.3
    one = SensorNonlinearity(0.02, 0.03, centre=10.0, span=80.0)
    other = SensorNonlinearity(0.02 - 3 * 0.03 * move, 0.03, centre=10.0 - move * 40.0, span=80.0)
    difference = respond(one, reach, GRID) - respond(other, reach, GRID)
    assert np.ptp(difference) > 0.5
    np.testing.assert_allclose(np.diff(difference, 2), 0, atol=1e-10)


def test_sensor_nonlinearity_rises_within_its_bounds():
    reach = np.linspace(-30, 50, 200)
    for s_2 in (-0.1, 0.1):
        for s_3 in (-0.1, 0.1):
            block = SensorNonlinearity(s_2, s_3, centre=10.0, span=80.0)
            assert np.all(np.diff(respond(block, reach, GRID)) > 0)


# The catalogue ------------------------------------------------------------------------------------

SETTINGS = {
    "common": Setting(0.0, 100.0, 10.0, 1e-3, 10.0, 20.0, 3e3, 2e3, 0.0, 0.0),
    "bipolar, fast": Setting(-150.0, 30.0, 0.2, 2e-5, 0.03, 5e2, 3e5, 1e5, -0.15, 0.0),
}


def driven(setting: Setting) -> tuple[np.ndarray, FOH]:
    """A drive from end to end with its fastest part near the top, and a base of the span."""
    times = np.arange(1500) * setting.step
    fastest = 2 * np.pi * setting.top_frequency * times
    shape = np.sin(fastest / 7) + 0.5 * np.sin(fastest)
    drive = setting.drive_centre + setting.drive_span * shape / np.ptp(shape)
    slope = setting.response_span / setting.drive_span
    return drive, FOH(k_l=0.6 * slope, k_h=0.2 * slope, k_p=0.0, alpha=0.14, beta=-0.13)


@pytest.mark.parametrize("setting", SETTINGS.values(), ids=SETTINGS)
@each_effect
def test_every_trial_is_of_a_sensible_size(name, setting):
    effect = EFFECTS[name]
    drive, base = driven(setting)
    plain = respond(base, drive, Grid(setting.step, "constant"))
    assert np.ptp(plain) == pytest.approx(setting.response_span, rel=0.5)
    for trial in effect.trials(setting):
        change = respond(effect.insert(base, trial), drive, Grid(setting.step, "constant")) - plain
        assert 1e-4 < np.std(change) / np.ptp(plain) < 0.3


@each_effect
def test_reverse_mode_is_forward_mode(name):
    """In the parameters and in the drive, also where plays start from an open interval."""
    drive = jnp.asarray(smooth(np.arange(300) * 5e-3))
    block = EFFECTS[name].trials(Setting(3.0, 8.0, 5.0, 5e-3, 1.5, 5.0, 80.0, 40.0, 0.0, 0.0))[0]
    aim = jnp.asarray(np.random.default_rng(4).standard_normal(300))
    values = {n: jnp.asarray(p.value) for n, p in named_parameters(block).items()}

    def project(values, drive):
        return aim @ set_values(block, values)(drive, Grid(5e-3, "periodic"))

    at = values, drive
    towards = {n: 0.3 * v for n, v in values.items()}, jnp.roll(aim, 7)
    forward = jax.jit(lambda: jax.jvp(project, at, towards)[1])()
    reverse = jax.jit(lambda: jax.vjp(project, *at)[1](1.0))()
    parts = jax.tree_util.tree_map(lambda a, b: float(jnp.sum(a * b)), reverse, towards)
    assert sum(jax.tree_util.tree_leaves(parts)) == pytest.approx(float(forward), rel=1e-9)


@each_effect
def test_trials_lie_where_the_literature_has_them(name):
    for trial in EFFECTS[name].trials(SETTINGS["common"]):
        for parameter in named_parameters(trial).values():
            low, high = parameter.plausible
            assert np.all(low <= parameter.value)
            assert np.all(parameter.value <= high)


@each_effect
def test_an_effect_is_no_other(name):
    """What the base's gain and offset leave of one trial is nowhere that of a look-alike."""
    drive, base = driven(SETTINGS["common"])
    plain = respond(base, drive, GRID)
    absorbed = np.linalg.qr(np.column_stack([plain, drive, np.ones_like(plain)]))[0]

    def direction(effect, trial) -> np.ndarray:
        change = respond(effect.insert(base, trial), drive, GRID) - plain
        change = change - absorbed @ (absorbed.T @ change)
        # What a recording gives no scale for, such as a converter's steps, moves nothing here.
        return change / max(float(np.linalg.norm(change)), 1e-9)

    trial = EFFECTS[name].trials(SETTINGS["common"])[0]
    own = direction(EFFECTS[name], trial)
    for other in EFFECTS[name].separated_by.keys() & EFFECTS.keys():
        for rival in EFFECTS[other].trials(SETTINGS["common"]):
            assert abs(own @ direction(EFFECTS[other], rival)) < 0.99999
