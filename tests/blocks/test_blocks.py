"""Every block by the same properties, and each against an oracle of its own."""

from functools import reduce
from itertools import pairwise
from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fracjax as fj
from fracjax._blocks import (
    EFFECTS,
    FOH,
    LFDH,
    AbstractBlock,
    AbstractLinearBlock,
    AmplitudeDependence,
    Backlash,
    BoucWen,
    ClockSkew,
    CoulombFriction,
    Creep,
    CubicNonlinearity,
    Delay,
    DriveCircuit,
    DriveLag,
    DriveMemory,
    Electrostriction,
    FOHLinear,
    FOHRateTerm,
    GainDrift,
    InverseLFDH,
    LostContact,
    LuGreFriction,
    MainsInterference,
    MinorLoopMemory,
    PEADynamics,
    Quantisation,
    QuasiStaticForce,
    Resonance,
    Saturation,
    SecondMode,
    SensorFilter,
    SensorLag,
    SensorNonlinearity,
    Setting,
    SingleOperator,
    SlewRateLimit,
    ThermalDrift,
    ThrownLoad,
    ViscoelasticLayer,
    linear_gains,
)
from fracjax._blocks._block import LinearParallel
from fracjax._blocks._effect import Site
from fracjax._blocks.creep import KelvinVoigtCreep, LogarithmicCreep
from fracjax._blocks.minor_loop_memory import play
from fracjax._blocks.viscoelastic_layer import MaxwellLayer
from fracjax._fit import prepare
from fracjax._operators import Grid, direct_convolution, kernel
from fracjax._parameters import named_parameters, set_values
from tests.helpers import close, respond, smooth

HISTORIES = ("rest", "constant", "periodic")
STEP = 4.6e-3  # no line of the mains falls on half the sampling rate
SAMPLES = 161


TIMES = np.arange(SAMPLES) * STEP
DRIVE = jnp.asarray(smooth(TIMES))

foh = FOH(k_l=0.05, k_h=0.04, k_p=1e-4, alpha=0.14, beta=-0.13)
lfdh, creep, lag = LFDH(), Creep(2.0, 0.05), DriveLag(0.02)
log_creep = LogarithmicCreep(0.05, 0.03)
ladder = set_values(KelvinVoigtCreep(0.02, 0.02, 5.0), {"gains": np.array([0.02, 0.0, 0.05, 0.01])})
arms = set_values(MaxwellLayer(0.03, 0.01, 7.0), {"shares": np.array([0.02, 0.05, 0.0, 0.01])})
bouc_wen = BoucWen(0.1, -1.5, 0.05, 1.3, 1.6)
delay = Delay(2.4 * STEP, longest=20 * STEP)
resonance = Resonance(9.0, 0.2)
electrostriction = Electrostriction(0.1, centre=60.0, span=45.0)
saturation = Saturation(70.3, low=40.0, high=85.0)
memory = MinorLoopMemory(np.linspace(0.1, 0.3, 12), span=45.0)
drift = set_values(ThermalDrift(0.2, longest=0.8), {"amplitude": 0.3, "slope": -0.2})
mains = set_values(
    MainsInterference(50.0),
    {"cosines": np.linspace(0.3, 0.1, 5), "sines": np.linspace(-0.1, 0.2, 5)},
)
friction = CoulombFriction(0.7, 6.0, span=45.0)
contact = LostContact(0.6, 9.3, 0.1, low=0.0, span=45.0)
thrown = ThrownLoad(2e3, typical=9e3)
sticking = LuGreFriction(2.0, 0.7, 0.4, 100.0, span=45.0)
slew = SlewRateLimit(160.0, top=400.0)
warming = GainDrift(0.2, 1.5, 0.5, 1.5, speed=140.0, size=15.0)
layer = ViscoelasticLayer(0.3, 0.02, 0.4)
skew = ClockSkew(-9e-4)
converter = Quantisation(0.3, 0.2, step=4.0)
circuit, force = DriveCircuit(1.4, 0.02), QuasiStaticForce(30.0)
operator, inverse_lfdh = SingleOperator(0.3, 0.4), InverseLFDH()
pea = PEADynamics(0.8, 0.3, -0.25, 9.0, 0.2)
BLOCKS: dict[str, AbstractBlock] = {
    "foh": foh,
    "foh_linear": FOHLinear(0.05, 0.04, 0.14),
    "foh_rate_term": FOHRateTerm(1e-4, -0.13),
    "drive_circuit": circuit,
    "quasi_static_force": force,
    "single_operator": operator,
    "inverse_lfdh": inverse_lfdh,
    "inverse of a sum": LinearParallel(creep, lag).inverse(),
    "pea_dynamics": pea,
    "lfdh": lfdh,
    "creep": creep,
    "logarithmic creep": log_creep,
    "ladder of creep": ladder,
    "layer of arms": arms,
    "bouc_wen": bouc_wen,
    "drive_lag": lag,
    "delay": delay,
    "resonance": resonance,
    "electrostriction": electrostriction,
    "saturation": saturation,
    "minor_loop_memory": memory,
    "thermal_drift": drift,
    "mains_interference": mains,
    "coulomb_friction": friction,
    "lost_contact": contact,
    "thrown load": thrown,
    "LuGre's friction": sticking,
    "slew_rate_limit": slew,
    "gain_drift": warming,
    "viscoelastic_layer": layer,
    "clock_skew": skew,
    "quantisation": converter,
    "sensor_lag": SensorLag(12.0),
    "sensor filter": SensorFilter(12.0),
    "second_mode": SecondMode(9.0, 1.7, -0.3, 0.2, 0.1),
    "cubic_nonlinearity": CubicNonlinearity(0.3, low=40.0, high=85.0),
    "amplitude_dependence": AmplitudeDependence(0.2, 0.3, span=45.0),
    "backlash": Backlash(0.6, 3.3, span=45.0),
    "sensor_nonlinearity": SensorNonlinearity(0.02, -0.03, centre=60.0, span=45.0),
    "linear chain": lag >> lfdh >> resonance,
    "linear sum": creep + lag,
    "coupled, drifting": (foh >> Creep(fixed_gain=True)) + drift,
    "whole actuator": delay >> electrostriction >> foh >> resonance,
}
INDEPENDENT_OF_THE_DRIVE = {"thermal_drift", "mains_interference"}
# Samples ahead that central differences look.
LOOK_AHEAD = {
    "clock_skew": 1,
    "foh": 2,
    "foh_rate_term": 2,
    "coupled, drifting": 2,
    "whole actuator": 2,
}

each_block = pytest.mark.parametrize("name", BLOCKS)


def free_values(block: AbstractBlock) -> dict[str, np.ndarray]:
    return {n: np.asarray(p.value) for n, p in named_parameters(block).items() if not p.fixed}


# Properties of all --------------------------------------------------------------------------------


@pytest.mark.parametrize("history", HISTORIES)
@each_block
def test_the_response_is_real_and_finite(name, history):
    response = respond(BLOCKS[name], DRIVE, Grid(STEP, history))
    assert response.shape == DRIVE.shape
    assert response.dtype == jnp.float64
    assert np.isfinite(response).all()
    assert np.ptp(response) > 0


@each_block
def test_jit_is_eager(name):
    grid = Grid(STEP, "constant")
    close(respond(BLOCKS[name], DRIVE, grid), BLOCKS[name](DRIVE, grid), 1e-10)


@each_block
def test_vmap_over_a_parameter_is_a_loop(name):
    block, grid = BLOCKS[name], Grid(STEP, "constant")
    parameter, value = list(free_values(block).items())[-1]
    values = np.multiply.outer([0.9, 1.0, 1.07], value)
    batch = jax.vmap(lambda v: set_values(block, {parameter: v})(DRIVE, grid))(values)
    assert np.abs(batch[0] - batch[2]).max() > 0
    loop = [respond(set_values(block, {parameter: v}), DRIVE, grid) for v in values]
    close(batch, loop, 1e-10)


@pytest.mark.parametrize("history", ["rest", "constant"])
@each_block
def test_the_future_does_not_change_the_past(name, history):
    grid, now = Grid(STEP, history), 90
    changed = DRIVE.at[now:].add(10 * np.sin(np.arange(SAMPLES - now) + 1))
    one, other = (np.asarray(respond(BLOCKS[name], u, grid)) for u in (DRIVE, changed))
    assert (np.abs(other - one).max() == 0) == (name in INDEPENDENT_OF_THE_DRIVE)
    until = now - LOOK_AHEAD.get(name, 0)
    close(other[:until], one[:until], 1e-9, one)


@each_block
def test_gradient_in_every_free_parameter_is_the_central_difference(name):
    block, grid = BLOCKS[name], Grid(STEP, "constant")
    values = free_values(block)
    gradient = jax.jit(jax.jacfwd(lambda v: set_values(block, v)(DRIVE, grid)))(values)
    assert gradient.keys() == values.keys()
    for parameter, value in values.items():
        found = np.asarray(gradient[parameter]).reshape(SAMPLES, -1)
        for place in range(value.size):
            move = np.zeros(value.size)
            move[place] = 2e-6 * max(1e-3, float(np.abs(value).max()))
            shift = move.reshape(value.shape)
            ends = [
                respond(set_values(block, {parameter: v}), DRIVE, grid)
                for v in (value + shift, value - shift)
            ]
            wanted = np.asarray(ends[0] - ends[1]) / (2 * move[place])
            assert np.abs(wanted).max() > 0, parameter
            # Rounding: the convolution's 1e-12 of the response, over the move.
            rounding = 1e-12 * float(jnp.abs(ends[0]).max()) / move[place]
            np.testing.assert_allclose(
                found[:, place], wanted, rtol=0, atol=1e-5 * np.abs(wanted).max() + rounding
            )


@pytest.mark.parametrize("name", ["foh", "lfdh", "resonance", "coupled, drifting"])
def test_reverse_mode_is_forward_mode(name):
    block, grid = BLOCKS[name], Grid(STEP, "constant")
    aim = jnp.asarray(np.random.default_rng(3).standard_normal(SAMPLES))
    values = {n: jnp.asarray(v) for n, v in free_values(block).items()}

    def project(values):
        return aim @ set_values(block, values)(DRIVE, grid)

    forward, reverse = (jax.jit(mode(project))(values) for mode in (jax.jacfwd, jax.grad))
    for parameter, wanted in forward.items():
        assert float(reverse[parameter]) == pytest.approx(float(wanted), rel=1e-8)


# A turning point between samples is met to the square of the step, but by chance more or less.
REFINEMENT = {
    "bouc_wen": 4,
    "coulomb_friction": 4,
    "LuGre's friction": 4,
    "minor_loop_memory": 4,
    "amplitude_dependence": 4,
    "backlash": 4,
    "coupled, drifting": 4,
}


@each_block
def test_the_response_converges_as_the_step_is_refined(name):
    factor, reach = REFINEMENT.get(name, 2), LOOK_AHEAD.get(name, 0)
    coarse, middle, fine = (
        np.asarray(
            respond(
                BLOCKS[name],
                smooth(np.arange((SAMPLES - 1) * k + 1) * STEP / k),
                Grid(STEP / k, "constant"),
            )
        )[::k][: SAMPLES - reach]
        for k in (1, factor, factor**2)
    )
    span = np.ptp(fine)
    first, second = np.abs(middle - coarse).max(), np.abs(fine - middle).max()
    assert second < 5e-4 * span
    assert second < first / 3 or second < 1e-9 * span


@each_block
def test_linear_means_superposition(name):
    block, grid = BLOCKS[name], Grid(STEP, "rest")
    other = jnp.asarray(30 * np.cos(17 * TIMES))
    parts = respond(block, DRIVE, grid) + 2 * respond(block, other, grid)
    error = np.abs(respond(block, DRIVE + 2 * other, grid) - parts).max()
    assert (error < 1e-9 * np.abs(parts).max()) == block.linear


@pytest.mark.parametrize(
    "block",
    [
        bouc_wen,
        memory,
        BoucWen(0.0, 1.0, rho=0.01),
    ],
    ids=["bouc_wen", "minor_loop_memory", "slow bouc_wen"],
)
def test_periodic_history_is_the_last_of_many_cycles(block):
    angles = 2 * np.pi * np.arange(40) / 40
    cycle = 50 + 30 * np.sin(angles) + 5 * np.cos(2 * angles)
    steady = respond(block, cycle, Grid(STEP, "periodic"))
    many = np.asarray(respond(block, np.tile(cycle, 30), Grid(STEP, "constant")))
    close(many[-40:], many[-80:-40], 1e-3)
    close(steady, many[-40:], 1e-3)


# Laws against oracles of their own ----------------------------------------------------------------

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


# Compositions -------------------------------------------------------------------------------------


@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.parametrize("pair", [(lag, lfdh), (creep, lag), (lfdh, creep)])
def test_linear_blocks_in_series_are_one_after_the_other(pair, history):
    first, second = pair
    grid = Grid(STEP, history)
    joined = first >> second
    assert isinstance(joined, AbstractLinearBlock)
    close(respond(joined, DRIVE, grid), second(first(DRIVE, grid), grid), 1e-10)


@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.parametrize("pair", [(lag, lfdh), (foh, drift), (bouc_wen, creep)])
def test_parallel_blocks_add(pair, history):
    grid = Grid(STEP, history)
    first, second = pair
    wanted = respond(first, DRIVE, grid) + respond(second, DRIVE, grid)
    close(respond(first + second, DRIVE, grid), wanted, 1e-11)


def test_a_sum_takes_the_lower_order_of_quadrature():
    """That is the only difference from the two responses, and small on a smooth drive."""
    joined = lag + resonance
    assert isinstance(joined, AbstractLinearBlock)
    assert joined.accuracy == resonance.accuracy
    grid = Grid(STEP, "constant")
    wanted = respond(lag, DRIVE, grid) + respond(resonance, DRIVE, grid)
    close(respond(joined, DRIVE, grid), wanted, 1e-4)


def test_a_series_with_a_nonlinear_block_is_one_after_the_other():
    grid = Grid(STEP, "constant")
    joined = foh >> saturation >> creep
    assert not isinstance(joined, AbstractLinearBlock)
    assert not joined.linear
    close(respond(joined, DRIVE, grid), creep(saturation(foh(DRIVE, grid), grid), grid), 1e-12)


def test_a_linear_kernel_is_the_response_to_one_sample():
    impulse = jnp.zeros(SAMPLES).at[0].set(1.0)
    for block in (lag, lfdh, creep, lag >> resonance):
        assert isinstance(block, AbstractLinearBlock)
        weights = kernel(block.symbol, SAMPLES, Grid(STEP), block.accuracy)
        close(respond(block, impulse, Grid(STEP, "rest")), weights, 1e-10)


@pytest.mark.parametrize(
    ("block", "gains"),
    [
        (foh, {"k_l", "k_h", "k_p"}),
        (lfdh, {"k_0", "k_delta"}),
        (resonance, set()),
        (pea, {"gain", "creep_gain"}),
        (inverse_lfdh, {"c_0", "c_mu"}),
        (lfdh.inverse(), set()),
        (bouc_wen >> PEADynamics(fixed_gain=True), {"first.k_u", "first.k_h"}),
        (foh >> Creep(fixed_gain=True), {"first.k_l", "first.k_h", "first.k_p"}),
        (foh >> creep, {"first.k_l", "first.k_h", "first.k_p"}),
        (lag >> foh, {"second.k_l", "second.k_h", "second.k_p"}),
        (foh >> saturation, set()),
        (foh >> saturation >> creep, {"second.k_c"}),
        (foh >> bouc_wen, {"second.k_u", "second.k_h"}),
        (lfdh + drift, {"first.k_0", "first.k_delta", "second.amplitude", "second.slope"}),
        ((lfdh + mains) >> resonance, {
            "first.first.k_0", "first.first.k_delta", "first.second.cosines", "first.second.sines",
        }),
        (lag >> creep >> resonance, {"first.second.k_c"}),
    ],
)  # fmt: skip
def test_gains_of_compositions(block, gains):
    assert set(linear_gains(block)) == gains


@each_block
def test_the_response_is_proportional_to_its_gains(name):
    block, grid = BLOCKS[name], Grid(STEP, "constant")
    gains = linear_gains(block)
    values = free_values(block)
    zero = respond(set_values(block, {n: 0 * values[n] for n in gains}), DRIVE, grid)
    once, thrice = (
        respond(set_values(block, {n: k * values[n] for n in gains}), DRIVE, grid) - zero
        for k in (1.0, 3.0)
    )
    close(thrice, 3 * once, 1e-11, respond(block, DRIVE, grid))
    assert bool(gains) == bool(np.abs(once).max() > 0)


# The catalogue ------------------------------------------------------------------------------------

SETTINGS = {
    "common": Setting(0.0, 100.0, 10.0, 1e-3, 10.0, 10.0, 3e3, 2e3, 0.0, 1e-3),
    "bipolar, fast": Setting(-150.0, 30.0, 0.2, 2e-5, 0.01, 5e2, 3e5, 1e5, -0.15, 0.0),
    "slow": Setting(40.0, 85.0, 1500.0, 0.5, 3600.0, 0.01, 2.0, 0.3, -3.0, 0.5),
}
FITTING = Setting(
    float(DRIVE.min()), float(DRIVE.max()), 5.0, STEP, 0.74, 5.0,
    float(np.abs(np.diff(DRIVE)).max() / STEP), 200.0, 0.0, 0.05,
)  # fmt: skip
# The values at which an effect does nothing; extreme where no amplitude can be zero.
NOTHING = {
    "creep": {"gamma": 0.0},
    "drive_lag": {"time_constant": 1e-14},
    "delay": {"delay": 0.0},
    "resonance": {"frequency": 1e11},
    "electrostriction": {"q": 0.0},
    "minor_loop_memory": {"weights": np.zeros(12)},
    "saturation": {"threshold": 85.0},
    "thermal_drift": {"amplitude": 0.0, "slope": 0.0},
    "mains_interference": {"cosines": np.zeros(5), "sines": np.zeros(5)},
    "coulomb_friction": {"amplitude": 0.0},
    "lost_contact": {"share": 0.0, "compliance": 0.0},
    "slew_rate_limit": {"rate": 1e9},
    "gain_drift": {"gain": 0.0},
    "viscoelastic_layer": {"strength": 0.0},
    "clock_skew": {"skew": 0.0},
    "quantisation": {"share": 0.0},
    "sensor_lag": {"corner": 1e14},
    "second_mode": {"frequency": 1e11},
    "cubic_nonlinearity": {"q_3": 0.0},
    "amplitude_dependence": {"alpha": 0.0},
    "backlash": {"weight": 0.0},
    "sensor_nonlinearity": {"s_2": 0.0, "s_3": 0.0},
}
each_effect = pytest.mark.parametrize("name", EFFECTS)


@pytest.mark.parametrize("setting", SETTINGS.values(), ids=SETTINGS)
@each_effect
def test_trials_of_one_law_have_one_structure_and_lie_within_bounds(name, setting):
    trials = EFFECTS[name].trials(setting)
    assert len(trials) >= 1
    laws = {type(trial) for trial in trials}
    assert len({jax.tree_util.tree_structure(trial) for trial in trials}) == len(laws)
    shapes = {tuple(np.shape(x) for x in jax.tree_util.tree_leaves(trial)) for trial in trials}
    assert len(shapes) <= len(laws)
    for trial in trials:
        for parameter in named_parameters(trial).values():
            assert np.all(parameter.lower <= parameter.value)
            assert np.all(parameter.value <= parameter.upper)
            low, high = parameter.plausible
            assert np.all(low <= high)


def test_trials_of_a_resonance_at_500_khz():
    EFFECTS["resonance"].trials(Setting(0.0, 100.0, 10.0, 2e-6, 0.01, 5e3, 2e6, 1e6, 0.0, 0.0))


@each_effect
def test_trials_differ_and_change_the_base(name):
    effect, grid = EFFECTS[name], Grid(STEP, "constant")
    plain = np.asarray(respond(foh, DRIVE, grid))
    changed = [
        np.asarray(respond(effect.insert(foh, trial), DRIVE, grid))
        for trial in effect.trials(FITTING)
    ]
    # A load that is held down well is not thrown.
    changed = [c for c in changed if name != "lost_contact" or np.abs(c - plain).max() > 1e-9]
    assert len(changed) > 10 or name != "lost_contact"
    assert all(np.abs(response - plain).max() > 1e-9 for response in changed)
    assert all(np.abs(one - other).max() > 0 for one, other in pairwise(changed))


@each_effect
def test_an_effect_of_no_size_leaves_the_base_alone(name):
    effect, grid = EFFECTS[name], Grid(STEP, "constant")
    trial = effect.trials(FITTING)[0]
    inserted = effect.insert(foh, set_values(trial, NOTHING[name]))
    drive = DRIVE.at[-1].set(85.0)
    close(respond(inserted, drive, grid), respond(foh, drive, grid), 1e-9)


def test_the_null_of_every_effect_is_known():
    assert NOTHING.keys() == EFFECTS.keys()


@each_effect
def test_an_entry_says_what_it_is(name):
    effect = EFFECTS[name]
    assert effect.name == name
    assert effect.site in get_args(Site)
    for text in (effect.sentence, effect.equation, effect.source, effect.concealed_by):
        assert text.strip() == text
        assert len(text) > 5
    assert effect.separated_by.keys() <= EFFECTS.keys() - {name}
    assert effect.separated_by
    assert all(len(experiment) > 10 for experiment in effect.separated_by.values())
    assert effect.axes
    places = {"time", "frequency", "level", "rate", "reversal", "phase", "harmonics"}
    assert set(effect.axes) <= places
    assert len(set(effect.axes)) == len(effect.axes)


def test_site_of_insertion():
    grid = Grid(STEP, "constant")
    for effect in EFFECTS.values():
        for block in {type(trial): trial for trial in effect.trials(FITTING)}.values():
            after = block(foh(DRIVE, grid), grid)
            wanted = {
                "drive": foh(block(DRIVE, grid), grid),
                "additive": foh(DRIVE, grid) + block(DRIVE, grid),
            }.get(effect.site_of(block), after)
            close(respond(effect.insert(foh, block), DRIVE, grid), wanted, 1e-10)


def test_long_chains_join():
    grid = Grid(STEP, "periodic")
    chain = reduce(lambda a, b: a >> b, [Creep(1.0, 0.01)] * 10)
    close(respond(chain, DRIVE, grid), respond(Creep(1.0, 0.1), DRIVE, grid), 1e-11)


@pytest.mark.parametrize(
    ("rate", "counts"), [(2000, (5, 5)), (250, (2, 2)), (330, (3, 2)), (90, (1, 1))]
)
def test_the_mains_has_the_harmonics_that_the_rate_can_show(rate, counts):
    """One folded down from above it, such as 250.1 Hz at 250 Hz, would follow any slow drift."""
    times = np.arange(600) / rate
    drive = 50 - 40 * np.cos(2 * np.pi * 0.01 * rate * times)
    setting = prepare([fj.Recording(drive, 0.1 * drive, 1 / rate)]).setting
    found = {}
    for trial in EFFECTS["mains_interference"].trials(setting):
        known = named_parameters(trial)
        found[round(float(known["frequency"].value), -1)] = known["cosines"].value.size
    assert found == dict(zip((50.0, 60.0), counts, strict=True))
