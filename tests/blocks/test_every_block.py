"""Every block by the same properties."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fracjax._blocks import (
    AbstractBlock,
    AmplitudeDependence,
    Backlash,
    BoucWen,
    CoulombFriction,
    Creep,
    CubicNonlinearity,
    DriveCircuit,
    FOHLinear,
    FOHRateTerm,
    GainDrift,
    LostContact,
    LuGreFriction,
    PrandtlIshlinskii,
    Quantisation,
    QuasiStaticForce,
    SecondMode,
    SensorFilter,
    SensorLag,
    SensorNonlinearity,
    SlewRateLimit,
    ThrownLoad,
    ViscoelasticLayer,
    linear_gains,
)
from fracjax._blocks._block import LinearParallel
from fracjax._operators import Grid
from fracjax._parameters import named_parameters, set_values
from tests.blocks.helpers import (
    DRIVE,
    SAMPLES,
    STEP,
    TIMES,
    arms,
    bouc_wen,
    creep,
    delay,
    drift,
    electrostriction,
    foh,
    inverse_lfdh,
    ladder,
    lag,
    lfdh,
    log_creep,
    mains,
    memory,
    operator,
    pea,
    resonance,
    saturation,
    skew,
)
from tests.helpers import close, respond, smooth

HISTORIES = ("rest", "constant", "periodic")

friction = CoulombFriction(0.7, 6.0, span=45.0)
contact = LostContact(0.6, 9.3, 0.1, low=0.0, span=45.0)
thrown = ThrownLoad(2e3, typical=9e3)
sticking = LuGreFriction(2.0, 0.7, 0.4, 100.0, span=45.0)
slew = SlewRateLimit(160.0, top=400.0)
warming = GainDrift(0.2, 1.5, 0.5, 1.5, speed=140.0, size=15.0)
layer = ViscoelasticLayer(0.3, 0.02, 0.4)

plays = PrandtlIshlinskii(np.linspace(0.4, 0.05, 13), 0.4, low=42.0, high=84.0)

converter = Quantisation(0.3, 0.2, step=4.0)
circuit, force = DriveCircuit(1.4, 0.02), QuasiStaticForce(30.0)

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
    "prandtl_ishlinskii": plays,
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
    batch = jax.jit(jax.vmap(lambda v: set_values(block, {parameter: v})(DRIVE, grid)))(values)
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
    "prandtl_ishlinskii": 4,
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
        plays,
        BoucWen(0.0, 1.0, rho=0.01),
    ],
    ids=["bouc_wen", "minor_loop_memory", "prandtl_ishlinskii", "slow bouc_wen"],
)
def test_periodic_history_is_the_last_of_many_cycles(block):
    angles = 2 * np.pi * np.arange(40) / 40
    cycle = 50 + 30 * np.sin(angles) + 5 * np.cos(2 * angles)
    steady = respond(block, cycle, Grid(STEP, "periodic"))
    many = np.asarray(respond(block, np.tile(cycle, 30), Grid(STEP, "constant")))
    close(many[-40:], many[-80:-40], 1e-3)
    close(steady, many[-40:], 1e-3)


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
