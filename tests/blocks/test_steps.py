"""Machines step by step: exact steps, forces that agree with the motion, starts in motion, cycles.

The references are SciPy's: `lsim`, which is exact for straight inputs, and a matrix exponential.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lsim

from fracjax._blocks import (
    AbstractMachine,
    CubicStiffness,
    Curvature,
    Diode,
    DryFriction,
    EndStop,
    HystereticSpring,
    Impedance,
    InternalSaturation,
    Lag,
    LuGre,
    Mass,
    Modes,
    Motion,
    NegativeStiffness,
    Oscillator,
    PositionDependentGain,
    QuadraticDamping,
    RootOutflow,
    Within,
)
from fracjax._operators import Grid
from fracjax._parameters import set_values
from tests.blocks.forms import FILTERS, FORMS, MEASURED, MODES, NAMES, OSCILLATORS, of_system
from tests.helpers import respond

STEP = 0.02

# Linear steps -------------------------------------------------------------------------------------


def inputs(machine: AbstractMachine, count: int = 80) -> tuple[np.ndarray, np.ndarray]:
    """A drive (N,) and what acts at each port (p, N), of chance."""
    rng = np.random.default_rng(12)
    return rng.standard_normal(count), rng.standard_normal((len(machine.ports()), count))


@pytest.mark.parametrize("history", ["rest", "constant"])
@pytest.mark.parametrize("name", NAMES)
def test_linear_steps_are_exact_for_straight_drives_and_forces_from_any_start(name, history):
    machine = FORMS[name][0]
    drive, pushes = inputs(machine)
    a, b, c, d = of_system(machine)
    deviation = np.linspace(0.3, -0.7, len(a))
    within = set_values(Within(machine), {"start": deviation, "drive_offset": 0.4})
    start = deviation * np.asarray(machine.scales())
    if history == "constant" and machine.settles:
        start = start - np.linalg.solve(a, b[:, 0]) * (drive[0] + 0.4)
    times = STEP * np.arange(drive.size)
    outputs = lsim((a, b, c, d), np.column_stack([drive + 0.4, *pushes]), times, start)[1]
    response, motion = within.respond_to(
        jnp.asarray(drive), jnp.asarray(pushes), Grid(STEP, history)
    )
    size, ports = np.abs(outputs).max(), len(pushes)
    np.testing.assert_allclose(response, outputs[:, 0], atol=1e-10 * size)
    np.testing.assert_allclose(motion.position.T, outputs[:, 1 : 1 + ports], atol=1e-10 * size)
    np.testing.assert_allclose(motion.velocity.T, outputs[:, 1 + ports :], atol=1e-10 * size)
    np.testing.assert_allclose(motion.drive, np.tile(drive + 0.4, (ports, 1)))


@pytest.mark.parametrize("measured", MEASURED)
def test_a_start_of_one_swings_the_response_by_one(measured):
    """Of whatever is measured, and of each mode."""
    oscillator = Oscillator(0.5, 3.0, 1e-4, measured)
    modes = Modes((1.0, -0.4), (3.0, 7.0), (1e-4, 1e-4), measured)
    for machine, size in ((oscillator, 2), (modes, 4)):
        for start in np.eye(size):
            begun = set_values(Within(machine), {"start": start})
            swing = respond(begun, np.zeros(401), Grid(2.5e-3, "rest"))
            assert np.abs(swing).max() == pytest.approx(1.0, abs=2e-2)


def test_a_start_of_one_is_in_the_response_where_nothing_swings():
    still = Grid(1e-3, "rest")
    for machine, start in (
        (Lag(0.8, (0.4,)), [1.0]),
        (Lag(0.8, (0.4, 1.1)), [0.0, 1.0]),
        (Mass(2.0, 0.7), [1.0, 0.0]),
        (Mass(2.0, 0.7, of_velocity=True), [0.0, 1.0]),
        (FILTERS, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
        (set_values(FILTERS, {"gain": -4.0}), [0.0, 0.0, 0.0, -1.0, 0.0, 0.0]),
    ):
        begun = set_values(Within(machine), {"start": np.array(start)})
        assert respond(begun, np.zeros(9), still)[0] == pytest.approx(1.0)


def test_steps_of_many_time_constants_are_exact():
    stiff = Lag(0.8, (1e-5,))
    drive = np.array([0.0, 1.0, 1.0, -2.0])
    # After a straight line a lag is behind by its time constant.
    behind = 0.8 * (drive - np.diff(drive, prepend=0.0) * 1e-5)
    np.testing.assert_allclose(
        respond(Within(stiff), drive, Grid(1.0, "rest")), behind, 1e-9, 1e-12
    )


# Forces -------------------------------------------------------------------------------------------

ACTED = {
    "spring and drag": (OSCILLATORS["position"], [CubicStiffness(0.7), QuadraticDamping(0.02)]),
    "stops of a velocity": (OSCILLATORS["velocity"], [EndStop(40.0, 0.1), EndStop(9.0, 0.2, -1)]),
    "accelerated": (OSCILLATORS["acceleration"], [PositionDependentGain(0.2, 0.3)]),
    "a joint": (MODES["position"], [NegativeStiffness(0.1, 0.4), CubicStiffness(0.02)]),
    "an accelerated joint": (MODES["acceleration"], [HystereticSpring(1.0, 0.3, 0.4)]),
    "a guide": (Mass(2.0, 0.7), [LuGre(0.4, 0.1, 0.3, 0.5)]),
    "an orifice": (Lag(0.8, (0.4,)), [RootOutflow(0.5, -2.0), InternalSaturation(30.0, 0.4)]),
    "two filters": (FILTERS, [Diode(1.2, 0.2, 0.05), Curvature(0.6, 0.5)]),
}


@pytest.mark.parametrize("name", ACTED)
def test_forces_agree_with_the_motion_that_they_make(name):
    """From outside they make the same response of the linear machine."""
    machine, effects = ACTED[name]
    acting = Within(machine)
    for effect in effects:
        acting = acting @ effect
    drive, _ = inputs(machine, 60)
    drive, grid, none = jnp.asarray(2.5 * drive), Grid(STEP, "constant"), jnp.zeros((1, 60))
    acting = set_values(acting, {"start": np.full(acting.start.value.shape, 0.2)})
    response, motion = jax.jit(lambda d: acting.respond_to(d, none, grid))(drive)
    forces = acted(effects, motion, 0)
    linear = set_values(Within(acting.machine), {"start": acting.start.value})
    pushed, moved = linear.respond_to(drive, jnp.asarray(forces)[None], grid)
    size = np.ptp(response)
    np.testing.assert_allclose(pushed, response, atol=1e-9 * size)
    np.testing.assert_allclose(moved.position, motion.position, atol=1e-9 * size)
    plain, _ = linear.respond_to(drive, none, grid)
    assert np.abs(plain - response).max() > 1e-2 * size


def acted(effects, motion, place) -> np.ndarray:
    """The sum (N,) of what effects make of the motion at a port, step by step."""
    path = [Motion(*(signal[place, k] for signal in motion)) for k in range(motion.drive.shape[1])]
    total = np.zeros(len(path))
    for effect in effects:
        memory, before = effect.memory(), path[0]
        for k, now in enumerate(path):
            force, memory = effect.act(now, before, memory, STEP)
            total[k], before = total[k] + float(force), now
    return total


def test_each_effect_acts_at_its_own_port():
    machine = Lag(0.8, (0.4, 1.1))
    first, last = InternalSaturation(30.0, 0.3), RootOutflow(0.5, -4.0)
    both = Within(machine).at("last", last).at("outflow", first).at("last", first)
    assert both.sites == ("last", "outflow", "last")
    drive, grid = jnp.asarray(3 * inputs(machine)[0]), Grid(STEP, "rest")
    response, motion = jax.jit(lambda d: both.respond_to(d, jnp.zeros((1, d.size)), grid))(drive)
    forces = [acted([first], motion, 0), acted([last, first], motion, 1)]
    pushed, _ = Within(machine).respond_to(drive, jnp.asarray(np.stack(forces)), grid)
    np.testing.assert_allclose(pushed, response, atol=1e-9)
    # One is taken away by its place, the others stay.
    fewer = both.without(1)
    assert (fewer.sites, fewer.effects) == (("last", "last"), (last, first))


def test_what_acts_from_outside_adds_to_what_acts_inside():
    effect, machine = CubicStiffness(0.7), OSCILLATORS["acceleration"]
    drive, pushes = inputs(machine, 60)
    grid = Grid(STEP, "rest")
    response, motion = (machine @ effect).respond_to(jnp.asarray(drive), jnp.asarray(pushes), grid)
    forces = np.asarray(effect.force(motion)) + pushes
    pushed, _ = Within(machine).respond_to(jnp.asarray(drive), jnp.asarray(forces), grid)
    np.testing.assert_allclose(pushed, response, atol=1e-9 * np.ptp(response))


@pytest.mark.parametrize("machine", [OSCILLATORS["position"], Mass(2.0, 0.7, of_velocity=True)])
@pytest.mark.parametrize("beside", [(), (CubicStiffness(0.7),)], ids=["alone", "beside a spring"])
def test_what_can_stop_a_motion_acts_by_the_implicit_rule(machine, beside):
    """Each force is that of the motion at the end of its step, held over the step."""
    friction, step = DryFriction(0.6, 1e-3, 0.3, 2.0), 0.02
    drive, grid = inputs(machine, 60)[0], Grid(step, "rest")
    pushes = jnp.asarray(inputs(machine, 60)[1])
    acting = machine @ friction
    for effect in beside:
        acting = acting @ effect
    response, motion = acting.respond_to(jnp.asarray(drive), pushes, grid)
    forces = np.asarray(pushes[0]) + acted([friction, *beside], motion, 0)
    a, b, c, _ = of_system(machine)
    n, whole = len(a), np.zeros((len(a) + 2, len(a) + 2))
    states, wanted = np.zeros(n), [0.0]
    for k in range(1, 60):
        # States, drive and its slope: straight; the force is constant.
        whole[:n, :n], whole[:n, n], whole[n, n + 1] = a, b[:, 0], 1.0
        linear = expm(whole * step) @ [*states, drive[k - 1], (drive[k] - drive[k - 1]) / step]
        whole[:n, n], whole[n, n + 1] = b[:, 1], 0.0
        states = linear[:n] + (expm(whole * step)[:n, n] * forces[k])
        wanted.append(float(c[0] @ states))
    np.testing.assert_allclose(response, wanted, atol=1e-9)
    assert (np.abs(motion.velocity) < 1e-3).sum() > 10  # it sticks now and then


# Cycles and motions that are given ----------------------------------------------------------------


def test_a_cycle_closes_for_whatever_acts():
    machine = Oscillator(0.5, 3.0, 0.2) @ CubicStiffness(0.7)
    rng = np.random.default_rng(2)
    drive, pushes = rng.standard_normal(50), rng.standard_normal((1, 50))
    steady, motion = machine.respond_to(
        jnp.asarray(drive), jnp.asarray(pushes), Grid(STEP, "periodic")
    )
    many, _ = machine.respond_to(
        jnp.asarray(np.tile(drive, 12)), jnp.asarray(np.tile(pushes, 12)), Grid(STEP, "rest")
    )
    np.testing.assert_allclose(steady, many[-50:], atol=1e-9 * np.ptp(steady))
    np.testing.assert_allclose(motion.position[0], steady, atol=1e-12)


def test_a_cycles_derivatives_are_central_differences():
    machine = Oscillator(0.5, 3.0, 0.2) @ CubicStiffness(0.7)
    drive = np.sin(2 * np.pi * np.arange(50) / 50)
    grid, values = Grid(STEP, "periodic"), {"machine.frequency": 3.0, "effects.0.stiffness": 0.7}

    @jax.jit
    def moved(v):
        return set_values(machine, v)(jnp.asarray(2 * drive), grid)

    gradient = jax.jit(jax.jacfwd(moved))(values)
    for name, value in values.items():
        ends = [moved(values | {name: value + way * 1e-5}) for way in (1, -1)]
        wanted = np.asarray(ends[0] - ends[1]) / 2e-5
        np.testing.assert_allclose(gradient[name], wanted, atol=1e-6 * np.abs(wanted).max())


@pytest.mark.parametrize("history", ["rest", "constant"])
def test_a_given_motion_has_its_velocity_between_its_neighbours(history):
    """The mean of the changes before and after, the last one twice at the end."""
    x = np.array([0.2, 0.5, 0.4, 0.9, 1.5])
    changes = np.diff(x, prepend=0.0 if history == "rest" else x[0]) / STEP
    v = np.append(changes[:-1] + changes[1:], 2 * changes[-1]) / 2
    impedance = Impedance(2.0, 0.0, 0.0, None)
    pushed = np.array([[0.1, -0.2, 0.3, 0.0, 0.5]])
    effects = [QuadraticDamping(0.7), HystereticSpring(1.0, 0.3, 0.4), LuGre(0.4, 0.1, 0.3, 0.5)]
    within = Within(impedance)
    for effect in effects:
        within = within @ effect
    response, motion = within.respond_to(jnp.asarray(x), jnp.asarray(pushed), Grid(STEP, history))
    np.testing.assert_allclose(motion.position[0], x)
    np.testing.assert_allclose(motion.velocity[0], v)
    np.testing.assert_allclose(motion.drive[0], x)
    forces = acted(effects, Motion(x[None], v[None], x[None]), 0) + pushed[0]
    plain = respond(impedance, x, Grid(STEP, history))
    np.testing.assert_allclose(response, plain - forces, atol=1e-12)
