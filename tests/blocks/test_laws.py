"""Blocks of the first catalogue, each against an oracle of its own."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fracjax as fj
from fracjax._blocks import Creep, Delay, DriveMemory, MinorLoopMemory, QuasiStaticForce, Resonance
from fracjax._blocks.minor_loop_memory import play
from fracjax._operators import Grid, direct_convolution
from tests.blocks.helpers import (
    DRIVE,
    STEP,
    TIMES,
    arms,
    bouc_wen,
    creep,
    drift,
    electrostriction,
    foh,
    ladder,
    lag,
    lfdh,
    log_creep,
    mains,
    memory,
    saturation,
)
from tests.helpers import close, respond, smooth

HISTORIES = ("rest", "constant", "periodic")

DENSE_STEP = 1e-3
DENSE = np.arange(1201) * DENSE_STEP


def test_foh_is_the_sum_of_its_three_terms():
    """By first-order weights and a direct sum, to the first order in the step."""
    found = respond(foh, jnp.asarray(smooth(DENSE)), Grid(DENSE_STEP, "constant"))
    drive = smooth(DENSE)
    parts = {}
    for order in (0.14, -0.13):
        weights = np.ones(drive.size)
        for j in range(1, drive.size):
            weights[j] = weights[j - 1] * (j - 1 - order) / j
        parts[order] = direct_convolution(weights * DENSE_STEP**-order, drive - drive[0])
    speed = np.abs(np.gradient(drive, DENSE_STEP))
    wanted = 0.05 * drive + 0.04 * parts[0.14] + 1e-4 * speed * parts[-0.13]
    close(found, wanted, 2e-3)


def test_lag_is_its_differential_equation():
    solution = solve_ivp(
        lambda t, w: (smooth(t) - w) / 0.02, (0, 1.2), [smooth(0.0)], t_eval=DENSE,
        rtol=1e-10, atol=1e-10,
    )  # fmt: skip
    found = respond(lag, jnp.asarray(smooth(DENSE)), Grid(DENSE_STEP, "constant"))
    close(found, solution.y[0], 1e-6)


@pytest.mark.parametrize(("frequency", "damping"), [(9.0, 0.2), (20.0, 0.02), (3.0, 1.0)])
def test_resonance_is_its_differential_equation(frequency, damping):
    omega = 2 * np.pi * frequency

    def slope(t, state):
        return [state[1], omega**2 * (smooth(t) - state[0]) - 2 * damping * omega * state[1]]

    solution = solve_ivp(
        slope, (0, 1.2), [smooth(0.0), 0.0], "DOP853", t_eval=DENSE, rtol=1e-10, atol=1e-10
    )
    block = Resonance(frequency, damping)
    found = respond(block, jnp.asarray(smooth(DENSE)), Grid(DENSE_STEP, "constant"))
    close(found, solution.y[0], 3e-4)


@pytest.mark.parametrize("late", [3e-4, 1e-3, 2.5e-3, 4.71e-2])
def test_delay_is_the_earlier_drive(late):
    block = Delay(late, longest=0.1)
    found = respond(block, jnp.asarray(smooth(DENSE)), Grid(DENSE_STEP, "constant"))
    close(found[:-2], smooth(np.maximum(DENSE - late, 0.0))[:-2], 5e-6)


@pytest.mark.parametrize("history", HISTORIES)
def test_delay_by_whole_samples_is_a_shift(history):
    found = respond(Delay(3 * STEP, longest=0.1), DRIVE, Grid(STEP, history))
    before = {"rest": np.zeros(3), "constant": np.full(3, DRIVE[0]), "periodic": DRIVE[-3:]}
    close(found, np.concatenate([before[history], DRIVE[:-3]]), 1e-9)


def test_lfdh_has_the_gain_and_phase_of_the_paper_at_1_hz():
    """(11.3885 s^0.046153 + 1)/(16.523 s^0.44346 + 79.6379) at s = 2πj [L 11]."""
    s = 2j * np.pi
    gain = (11.3885 * s**0.046153 + 1) / (16.523 * s**0.44346 + 79.6379)
    times = np.arange(500) / 250
    found = respond(lfdh, jnp.sin(2 * np.pi * times), Grid(1 / 250, "periodic"))
    close(found, np.imag(gain * np.exp(2j * np.pi * times)), 1e-12)
    assert -20 < np.degrees(np.angle(gain)) < -1  # a loop that lags


def test_creep_turns_every_frequency_by_the_same_phase():
    """-90° μ, and 2.303 μ per decade after a step [F 11, F Fig. 12]."""
    for hertz in (1, 8):
        times = np.arange(200) / 200
        found = respond(creep, jnp.sin(2 * np.pi * hertz * times), Grid(1 / 200, "periodic"))
        phase = np.angle(np.fft.fft(found)[hertz] * 1j)
        assert np.degrees(phase) == pytest.approx(-90 * 0.05, abs=1e-9)
    step = respond(Creep(1.0, 0.01), jnp.ones(2001), Grid(1e-2, "rest"))
    assert float(step[2000] / step[200] - 1) == pytest.approx(np.log(10) * 0.01, rel=0.03)


def test_logarithmic_creep_is_the_log_law_after_a_step():
    """A jump from rest falls half a sample before the first one."""
    found = respond(log_creep, np.ones(1001), Grid(1e-2, "rest"))[20:]
    wanted = 1 + 0.05 * np.log10(1 + np.arange(20.5, 1001) * 1e-2 / 0.03)
    close(found - 1, wanted - 1, 1e-3)


def test_a_ladder_creeps_and_a_layer_of_arms_gives_way():
    """After a step each relaxation is an exponential of its own, up or down."""
    times = np.arange(20.5, 1001) * 1e-3
    step = np.ones(1001)
    for block, sizes, first, ratio, sign in (
        (ladder, [0.02, 0.0, 0.05, 0.01], 0.02, 5.0, 1),
        (arms, [0.02, 0.05, 0.0, 0.01], 0.01, 7.0, -1),
    ):
        decays = np.exp(-times[:, None] / (first * ratio ** np.arange(4)))
        moved = (1 - decays if sign > 0 else decays) @ np.array(sizes)
        close(respond(block, step, Grid(1e-3, "rest"))[20:] - 1, moved, 2e-3)


def test_bouc_wen_is_its_differential_equation():
    rho, sigma, n, omega = 0.05, 1.3, 1.6, 2 * np.pi

    def slope(t, h):
        speed, size = 40 * omega * np.cos(omega * t), np.abs(h)
        return rho * (
            speed - sigma * abs(speed) * size ** (n - 1) * h + (sigma - 1) * speed * size**n
        )

    times = np.arange(801) / 400
    solution = solve_ivp(
        slope, (0, 2), [0.0], "LSODA", times, rtol=1e-10, atol=1e-12, max_step=0.01
    )
    drive = 40 * np.sin(omega * times)
    found = respond(bouc_wen, jnp.asarray(drive), Grid(1 / 400, "constant"))
    close(found, 0.1 * drive - 1.5 * solution.y[0], 1e-7)


def test_play_is_the_plain_recursion():
    drive, radii = np.random.default_rng(5).uniform(-10, 10, 200), np.array([0.0, 0.5, 3.0, 8.0])
    state, wanted = np.full(radii.size, 4.0), []
    for value in drive:
        state = np.minimum(np.maximum(state, value - radii), value + radii)
        wanted.append(state)
    found = jax.jit(play)(jnp.asarray(drive), jnp.asarray(radii), 4.0)
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("along", ["drive", "radii", "start"])
def test_plays_move_as_their_differences(along):
    generator = np.random.default_rng(3)
    drive = jnp.asarray(np.cumsum(generator.standard_normal(700)))
    # One is never pushed, and keeps its start; a rest pushes none, whatever it is held at.
    at = {"drive": drive.at[300:400].set(drive[300]), "radii": jnp.array([0.3, 2.0, 9.0, 500.0])}
    at["start"] = at["drive"][0] + 0.4 * at["radii"]
    ways = {name: jnp.asarray(generator.standard_normal(each.shape)) for name, each in at.items()}
    ways = {name: way * (name == along) for name, way in ways.items()}
    ways["drive"] = ways["drive"].at[300:400].set(ways["drive"][300])
    _, found = jax.jit(lambda a, w: jax.jvp(play, a, w))((*at.values(),), (*ways.values(),))
    there, back = (play(*(at[n] + h * ways[n] for n in at)) for h in (1e-7, -1e-7))
    np.testing.assert_allclose(found, (there - back) / 2e-7, atol=1e-6)
    assert np.abs(found).max() > 0.1


def test_memory_is_wiped_out_by_a_larger_excursion():
    outer = np.array([0.0, 45.0])
    inner = np.array([0.0, 20.0, 10.0, 17.0, 12.0, 45.0])
    ends = [float(respond(memory, u, Grid(STEP, "rest"))[-1]) for u in (outer, inner)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-12)


def test_memory_ahead_of_a_gain_is_memory_beside_it():
    """And beside a law that is no gain another: there the two differ."""
    shares, grid = np.linspace(-0.02, 0.05, 12), Grid(STEP, "constant")
    ahead = DriveMemory(shares, span=45.0)
    beside = QuasiStaticForce(1 - shares.sum()) + MinorLoopMemory(shares, span=45.0)
    close(ahead(DRIVE, grid), beside(DRIVE, grid), 1e-12)


@pytest.mark.parametrize("law", [MinorLoopMemory, DriveMemory])
def test_memory_of_another_number_of_thresholds_is_refused(law):
    with pytest.raises(fj.InputError, match=r"expected 12 or 6 weights, .*, found .* \(8,\)"):
        law(np.zeros(8), span=45.0)


def test_electrostriction_saturation_drift_and_mains_are_their_formulas():
    grid = Grid(STEP, "constant")
    close(electrostriction(DRIVE, grid), DRIVE + 0.1 * (DRIVE - 60) ** 2 / 45, 1e-14)
    assert float(jnp.max(DRIVE)) > 70.3
    np.testing.assert_array_equal(saturation(DRIVE, grid), np.minimum(DRIVE, 70.3))
    close(drift(DRIVE, grid), 0.3 * (1 - np.exp(-TIMES / 0.2)) - 0.2 * TIMES, 1e-13)
    lines = [
        a * np.cos(2 * np.pi * 50 * k * TIMES) + b * np.sin(2 * np.pi * 50 * k * TIMES)
        for k, a, b in zip(
            range(1, 6), np.linspace(0.3, 0.1, 5), np.linspace(-0.1, 0.2, 5), strict=True
        )
    ]
    close(mains(DRIVE, grid), np.sum(lines, axis=0), 1e-11)


def test_rate_independent_laws_do_not_see_the_clock():
    for block in (bouc_wen, memory, electrostriction, saturation):
        slow, fast = (respond(block, DRIVE, Grid(step, "constant")) for step in (1.0, 1e-4))
        np.testing.assert_array_equal(slow, fast)
