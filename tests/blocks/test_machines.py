"""Machines and the physics inside them: closed forms, other integrators, energies, derivatives."""

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lsim
from scipy.special import wrightomega

import fracjax as fj
from fracjax._blocks import (
    INSIDE,
    Clearance,
    Clipping,
    CubicStiffness,
    Curvature,
    DeadZone,
    Diode,
    DryFriction,
    EndStop,
    Filters,
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
    QuadraticStiffness,
    RootOutflow,
    StaticCurve,
    Within,
)
from fracjax._operators import Grid
from fracjax._parameters import named_parameters, set_values
from tests.helpers import respond

W, ZETA = 2 * np.pi * 3.0, 0.08
OSCILLATOR = Oscillator(0.5, 3.0, ZETA)
FILTERS = Filters(0.5, (2.0, 3.0), (0.3, 0.5), (2.5, 4.0), (9.0, 6.0), (0.4, 0.0))
MACHINES = {
    "oscillator": OSCILLATOR,
    "velocity": Oscillator(0.5, 3.0, ZETA, "velocity"),
    "acceleration": Oscillator(0.5, 3.0, ZETA, "acceleration"),
    "mass": Mass(2.0, 0.7),
    "velocity of a mass": Mass(2.0, 0.7, of_velocity=True),
    "lag": Lag(0.8, (0.4,)),
    "two lags": Lag(0.8, (0.4, 1.1)),
    "modes": Modes((1.0, -0.4), (2.0, 5.0), (0.05, 0.03)),
    "accelerating modes": Modes((1.0, -0.4), (2.0, 5.0), (0.05, 0.03), "acceleration"),
    "filters": FILTERS,
}
FORCES = {
    "cubic_stiffness": CubicStiffness(0.7),
    "quadratic_stiffness": QuadraticStiffness(0.4),
    "clearance": Clearance(0.8, 0.3),
    "end_stop": EndStop(40.0, 0.5),
    "dry_friction": DryFriction(0.3, 0.05, 0.4, 2.0),
    "lugre": LuGre(0.3, 0.05, 0.4, 2.0),
    "quadratic_damping": QuadraticDamping(0.02),
    "position_dependent_gain": PositionDependentGain(0.1, 0.5),
    "hysteretic_spring": HystereticSpring(1.0, 0.3, 0.3),
    "negative_stiffness": NegativeStiffness(1.2, 0.4),
}
FLOWS = {
    "root_outflow": RootOutflow(0.5, -0.6),
    "internal_saturation": InternalSaturation(30.0, 0.4),
}
SIGNALS = {
    "diode": Diode(1.2, 0.2, 0.05),
    "clipping": Clipping(1.2, 0.3, 0.1, 0.05),
    "dead_zone": DeadZone(1.2, 0.3, 0.1),
    "curvature": Curvature(0.6, 0.5),
}
HOSTS = {"force": OSCILLATOR, "flow": Lag(0.8, (0.3, 0.5)), "signal": FILTERS}
PERIOD = 2.0


def drive_at(times):
    """A drive that leaves 0 smoothly."""
    return 2.5 * np.sin(2 * np.pi * 1.3 * times) * np.minimum(times, 1.0) ** 3


def solved(machine: Within, times: np.ndarray, law) -> np.ndarray:
    """The response at times (N,) by an adaptive solver, of a force law(position, velocity, u)."""
    a, b, c, d = (np.asarray(each, float) for each in machine.machine.system())
    port = machine.machine.ports()[machine.sites[0]]
    enters, position, velocity = (
        np.asarray(x) for x in (port.enters, port.position, port.velocity)
    )

    def force(x, u):
        return law(position @ x, velocity @ x, u)

    def rate(t, x):
        u = drive_at(t)
        return a @ x + b * u + enters * force(x, u)

    states = solve_ivp(
        rate, (0, times[-1]), 0 * b, "RK45", times, rtol=1e-8, atol=1e-10, max_step=0.01
    ).y
    u = drive_at(times)
    forces = np.array([force(x, v) for x, v in zip(states.T, u, strict=True)])
    return c @ states + d * u + np.asarray(port.direct) * forces


@pytest.mark.parametrize("name", MACHINES)
def test_the_states_have_the_transfer_function(name):
    machine = MACHINES[name]
    a, b, c, d = (np.asarray(each, float) for each in machine.system())
    s = 2j * np.pi * np.array([0.07, 0.9, 3.1, 20.0])
    by_states = [c @ np.linalg.solve(z * np.eye(b.size) - a, b) + d for z in s]
    with jax.enable_x64(True):
        np.testing.assert_allclose(machine.symbol(jnp.asarray(s)), by_states, rtol=1e-9)


@pytest.mark.parametrize("name", [n for n in MACHINES if "mass" not in n])
def test_without_effects_the_states_respond_as_the_convolution(name):
    machine, times = MACHINES[name], np.linspace(0, PERIOD, 801)
    grid = Grid(times[1], "rest")
    one = np.asarray(respond(machine, drive_at(times), grid))
    other = np.asarray(respond(Within(machine), drive_at(times), grid))
    assert np.abs(one - other).max() < 1e-3 * np.ptp(one)


LAWS = {
    "cubic_stiffness": lambda x, v, u: -0.7 * x**3,
    "quadratic_damping": lambda x, v, u: -0.02 * v * abs(v),
    "position_dependent_gain": lambda x, v, u: 0.1 * x * (1 + 0.5 * x) * u,
    "clearance": lambda x, v, u: 0.8 * np.clip(x, -0.3, 0.3),
    "end_stop": lambda x, v, u: -40.0 * max(x - 0.5, 0.0),
    "negative_stiffness": lambda x, v, u: 1.2 * x * 0.4 / np.hypot(0.4, x),
    "dry_friction": lambda x, v, u: -0.3 * (1 + 0.4 * np.exp(-((v / 2) ** 2)))
    * np.clip(v / 0.05, -1, 1),
}  # fmt: skip


@pytest.mark.parametrize("name", LAWS)
def test_the_step_converges_at_its_order_to_another_integrator(name):
    """Of second order, and of first where a force can stop the motion."""
    machine, errors = OSCILLATOR @ FORCES[name], []
    for steps in (400, 800, 1600):
        times = np.linspace(0, PERIOD, steps + 1)
        found = np.asarray(respond(machine, drive_at(times), Grid(times[1], "rest")))
        wanted = solved(machine, times[:: steps // 400], LAWS[name])
        errors.append(np.abs(found[:: steps // 400] - wanted).max() / np.ptp(wanted))
    order = 1.0 if FORCES[name].sticks else 2.0
    assert errors[-1] < (2e-2 if order == 1 else 5e-4)
    assert np.log2(errors[0] / errors[-1]) / 2 > order - 0.35


CURVES = {
    "diode": lambda x: 1.2 * 0.05 * wrightomega((x - 0.2) / 0.05),
    "clipping": lambda x: 1.2 * 0.05 * (np.logaddexp(0, (x - 0.4) / 0.05)
                                        - np.logaddexp(0, (-0.2 - x) / 0.05)),
    "dead_zone": lambda x: 1.2 * np.clip(x - 0.1, -0.3, 0.3),
    "curvature": lambda x: -0.6 * x**2 - 0.3 * x**3,
}  # fmt: skip


def filtered(k: int, signal: np.ndarray, times: np.ndarray) -> np.ndarray:
    """A signal (N,) behind the first or the second of the filters, by their polynomials."""
    pair, corner, zero = (
        2 * np.pi * np.asarray(f.value)[k]
        for f in (FILTERS.frequencies, FILTERS.corners, FILTERS.zeros)
    )
    zeta, xi = (float(d.value[k]) for d in (FILTERS.dampings, FILTERS.zero_dampings))
    poles = np.polymul([1 / corner, 1], [1 / pair**2, 2 * zeta / pair, 1])
    return lsim(([1 / zero**2, 2 * xi / zero, 1], poles), signal, times)[1]


@pytest.mark.parametrize("name", CURVES)
def test_what_acts_between_filters_is_a_curve_between_filters(name):
    times = np.linspace(0, PERIOD, 1601)
    drive, grid = drive_at(times), Grid(times[1], "rest")
    between = filtered(0, drive, times)
    wanted = 0.5 * filtered(1, between - CURVES[name](0.5 * between), times)
    acted = np.asarray(respond(FILTERS @ SIGNALS[name], drive, grid))
    assert np.abs(acted - wanted).max() < 2e-3 * np.ptp(wanted)


def test_a_diode_may_conduct_below_its_threshold():
    times = np.linspace(0, PERIOD, 401)
    drive, grid = drive_at(times), Grid(times[1], "rest")
    lower = np.asarray(respond(FILTERS @ Diode(1.2, -0.2, 0.05, upward=False), -drive, grid))
    upper = np.asarray(respond(FILTERS @ SIGNALS["diode"], drive, grid))
    np.testing.assert_allclose(lower, -upper, atol=1e-9)


@pytest.mark.parametrize(("name", "site"), [("filters", "between"), ("modes", "joint")])
def test_a_ports_places_differ_in_its_motion_alone(name, site):
    machine = MACHINES[name]
    times = np.linspace(0, PERIOD, 401)
    places = Within(machine).placements(site)
    assert len(places) == {"filters": 8, "modes": 2}[name]
    moved = [
        place.respond_to(jnp.asarray(drive_at(times)), jnp.zeros((1, 401)), Grid(times[1], "rest"))
        for place in places
    ]
    for response, _ in moved[1:]:
        np.testing.assert_allclose(response, moved[0][0], atol=1e-5)
    positions = [np.asarray(motion.position[0]) for _, motion in moved]
    for k, one in enumerate(positions):
        for other in positions[:k]:
            assert np.abs(one - other).max() > 1e-2 * np.ptp(one)
    # With physics there it has its place.
    effect = {"signal": Diode(), "force": CubicStiffness()}[machine.ports()[site].kind]
    assert (machine @ effect).placements(site) == (machine @ effect,)


@pytest.mark.parametrize("measured", ["velocity", "acceleration"])
def test_a_force_moves_what_is_measured(measured):
    machine = Oscillator(0.5, 3.0, ZETA, measured) @ FORCES["cubic_stiffness"]
    times = np.linspace(0, PERIOD, 3201)
    found = np.asarray(respond(machine, drive_at(times), Grid(times[1], "rest")))
    wanted = solved(machine, times, LAWS["cubic_stiffness"])
    assert np.abs(found - wanted).max() < 1e-3 * np.ptp(wanted)


def free_decay(effect, start: float, step: float, seconds: float, damping: float = 1e-4):
    machine = set_values(Oscillator(1.0, 1.0, damping) @ effect, {"start": np.array([start, 0.0])})
    count = round(seconds / step) + 1
    return np.asarray(respond(machine, np.zeros(count), Grid(step, "rest")))


def test_dry_friction_takes_the_same_off_in_each_cycle_and_then_holds():
    """Four times the deflection by the friction force, and at rest below one."""
    position = free_decay(DryFriction(0.05, 1e-4), 1.0, 1e-3, 9.0)
    peaks = [position[round(k / 1e-3)] for k in range(4)]
    np.testing.assert_allclose(np.diff(peaks), -0.2, atol=4e-3)
    late = position[-1500:]
    assert np.ptp(late) < 2e-3
    assert abs(late[-1]) < 0.05


def test_the_backbone_of_duffings_oscillator():
    """The period of free motion of amplitude A is 4 K(m)/(ω √(1 + κ A²)), by elliptic integrals."""
    from scipy.special import ellipk

    amplitude, kappa = 1.3, 0.8
    position = free_decay(CubicStiffness(kappa), amplitude, 1e-3, 3.0)
    rate = 2 * np.pi * np.sqrt(1 + kappa * amplitude**2)
    modulus = kappa * amplitude**2 / (2 * (1 + kappa * amplitude**2))
    period = 4 * ellipk(modulus) / rate
    falls = np.flatnonzero((position[:-1] > 0) & (position[1:] <= 0))
    crossings = falls + position[falls] / (position[falls] - position[falls + 1])
    np.testing.assert_allclose(np.diff(crossings).mean() * 1e-3, period, rtol=2e-3)


def test_a_mass_sticks_below_the_friction_and_slides_at_stribecks_speed():
    machine = Mass(2.0, 0.5, of_velocity=True) @ DryFriction(1.0, 1e-4, 0.3, 0.2)
    grid = Grid(1e-3, "rest")
    stuck = np.asarray(respond(machine, np.full(500, 1.2), grid))
    assert np.abs(stuck).max() < 2e-4
    sliding = np.asarray(respond(machine, np.full(20_000, 1.9), grid))
    assert sliding[-1] == pytest.approx(2.0 * (1.9 - 1.0) / 0.5, rel=1e-3)


def test_a_hysteretic_spring_is_the_equation_and_does_no_work_of_its_own():
    spring = HystereticSpring(2.0, 0.3, 0.2)
    path = 0.8 * np.sin(np.linspace(0, 4 * np.pi, 4001))
    with jax.enable_x64(True):
        zero, z, forces = jnp.zeros(()), jnp.zeros(()), [0.0]
        act = jax.jit(
            lambda a, b, z: spring.act(Motion(a, zero, zero), Motion(b, zero, zero), z, 1)
        )
        for before, now in pairwise(path):
            force, z = act(now, before, z)
            forces.append(float(force))

    def slope(x, z, way):
        loaded = z * way > 0
        return (1 + (-0.8 if loaded else 0.2) * abs(z[0])) / 0.3

    values, z = [], 0.0
    for k in range(4):  # from turn to turn
        ends = {0: (0, 500), 1: (500, 1500), 2: (1500, 2500), 3: (2500, 3500)}[k]
        way = np.sign(path[ends[1]] - path[ends[0]])
        piece = path[ends[0] : ends[1] + 1]
        if way < 0:
            run = solve_ivp(lambda s, z: -slope(s, z, -1), (0, piece[0] - piece[-1]), [z],
                            rtol=1e-9, atol=1e-11, max_step=1e-2)  # fmt: skip
        else:
            run = solve_ivp(lambda s, z: slope(s, z, 1), (0, piece[-1] - piece[0]), [z],
                            rtol=1e-9, atol=1e-11, max_step=1e-2)  # fmt: skip
        z = float(run.y[0, -1])
        values.append((ends[1], -2.0 * 0.3 * z))
    for at, wanted in values:
        assert forces[at] == pytest.approx(wanted, abs=2e-4)
    # Around the last loop it takes energy.
    assert np.trapezoid(np.array(forces)[2500:], path[2500:]) < 0 or forces[2500] > 0
    assert np.trapezoid(np.array(forces)[1500:3501], path[1500:3501]) < -0.1


@pytest.mark.parametrize("name", FORCES | FLOWS | SIGNALS)
def test_derivatives_are_central_differences(name):
    effect = (FORCES | FLOWS | SIGNALS)[name]
    machine = HOSTS[effect.kind] @ effect
    times = np.linspace(0, PERIOD, 601)
    drive, grid = drive_at(times) + (2.0 if name in FLOWS else 0.0), Grid(times[1], "rest")
    values = {n: np.asarray(p.value) for n, p in named_parameters(machine).items() if not p.fixed}
    with jax.enable_x64(True):
        respond_at = jax.jit(lambda v: set_values(machine, v)(jnp.asarray(drive), grid))
        gradient = jax.jit(jax.jacfwd(lambda v: set_values(machine, v)(jnp.asarray(drive), grid)))(
            values
        )
        for parameter, value in values.items():
            found = np.asarray(gradient[parameter]).reshape(times.size, -1)
            for place in range(value.size):
                move = np.zeros(value.size)
                move[place] = 1e-6 * max(0.1, float(np.abs(value).max()))
                shift = move.reshape(value.shape)
                ends = [respond_at(values | {parameter: v}) for v in (value + shift, value - shift)]
                wanted = np.asarray(ends[0] - ends[1]) / (2 * move[place])
                # At a corner that moves over a sample the two differ at that sample alone.
                off = np.abs(found[:, place] - wanted) > 1e-4 * np.abs(wanted).max() + 1e-7
                assert off.mean() < 0.02, parameter


@pytest.mark.parametrize("name", ["cubic_stiffness", "dry_friction"])
def test_a_periodic_history_is_the_last_of_many_cycles(name):
    machine = Oscillator(0.5, 3.0, 0.2) @ FORCES[name]
    angles = 2 * np.pi * np.arange(200) / 200
    cycle, step = 0.8 * np.sin(angles), 1 / 200
    steady = np.asarray(respond(machine, cycle, Grid(step, "periodic")))
    many = np.asarray(respond(machine, np.tile(cycle, 12), Grid(step, "rest")))
    assert np.abs(steady - many[-200:]).max() < 1e-6 * np.ptp(many)


def test_a_constant_drive_is_held_in_equilibrium():
    for machine in (OSCILLATOR, Lag(0.8, (0.4, 1.1)), MACHINES["modes"]):
        held = np.asarray(respond(Within(machine), np.full(50, 2.0), Grid(0.01, "constant")))
        np.testing.assert_allclose(held, 2.0 * np.asarray(machine.static_gain()), rtol=1e-9)


def test_an_impedance_adds_what_acts_to_the_force():
    motion = np.sin(np.linspace(0, 12, 3001))
    grid = Grid(4e-3, "constant")
    plain = Impedance(2.0, 0.5, 0.1, None)
    force = np.asarray(respond(plain, motion, grid))
    rubbed = np.asarray(respond(plain @ DryFriction(0.3, 1e-3), motion, grid))
    moving = np.abs(np.gradient(motion, 4e-3)) > 0.05
    wanted = 0.3 * np.sign(np.gradient(motion))
    np.testing.assert_allclose((rubbed - force)[moving], wanted[moving], atol=1e-6)
    assert plain.leads
    assert not OSCILLATOR.leads


def test_an_impedance_is_the_sum_of_its_parts():
    s = 2j * np.pi * np.array([0.07, 0.9, 20.0])
    impedance = Impedance(2.0, 0.5, 0.1, 0.7, 0.4)
    with jax.enable_x64(True):
        symbol = impedance.symbol(jnp.asarray(s))
    np.testing.assert_allclose(symbol, 2.0 + 0.5 * s + 0.1 * s**2 + 0.7 * s**0.4, rtol=1e-9)
    assert impedance.static_gain() == 2.0


def test_a_store_does_not_pass_its_limit_and_drains_by_the_root():
    full = Lag(2.0, (0.5,)) @ InternalSaturation(1e4, 1.0)
    level = np.asarray(respond(full, np.full(500, 3.0), Grid(0.01, "rest")))
    assert level.max() < 1.001
    # dx/dt = -κ g/τ √x empties in the time 2 √x_0 τ/(κ g): a store that hardly drains otherwise.
    drained = set_values(Lag(1e6, (1e6,)) @ RootOutflow(0.5, 0.0), {"start": np.array([4.0])})
    level = np.asarray(respond(drained, np.zeros(1201), Grid(0.01, "rest")))
    np.testing.assert_allclose(level[::100][:8], (2 - 0.25 * np.arange(8)) ** 2, atol=2e-3)


def test_a_curve_is_straight_between_its_values_and_beyond():
    values = np.array([0.0, 1.0, -2.0, 3.0, 3.0, 2.0, 5.0, 4.0, 4.5])
    drive = np.linspace(-3.0, 3.0, 61)
    curve = np.asarray(respond(StaticCurve(-2.0, 2.0, values), drive, Grid(0.1)))
    inner = np.abs(drive) <= 2
    wanted = np.interp(drive, np.linspace(-2.0, 2.0, 9), values)
    np.testing.assert_allclose(curve[inner], wanted[inner], atol=1e-12)
    np.testing.assert_allclose(curve[[0, -1]], [0.0 - 2 * 1.0, 4.5 + 2 * 0.5], atol=1e-12)


def test_an_effect_needs_its_port():
    with pytest.raises(
        fj.InputError,
        match="Lag @ CubicStiffness: expected a machine with a port for a force, found one with",
    ):
        _ = Lag() @ CubicStiffness()


@pytest.mark.parametrize("name", INSIDE)
def test_trials_are_of_the_size_that_the_motion_has(name):
    effect, rng = INSIDE[name], np.random.default_rng(4)
    motion = Motion(*(k * rng.standard_normal(300) for k in (1e-6, 1e-3, 20.0)))
    trials = effect.trials(motion)
    assert trials
    for trial in trials:
        assert trial.kind == effect.kind
        assert trial.size in named_parameters(trial)
    assert effect.separated_by.keys() <= INSIDE.keys() - {name}


def test_trials_between_filters_lie_within_the_signals_range():
    """Of a signal from -1 to 3 about 1."""
    signal = np.linspace(-1.0, 3.0, 401)
    trials = {name: INSIDE[name].trials(Motion(signal, 0 * signal, signal)) for name in SIGNALS}

    def values(name, parameter):
        return [float(getattr(trial, parameter).value) for trial in trials[name]]

    np.testing.assert_allclose(values("diode", "threshold"), 2 * [0.2, 1.0, 1.8], atol=1e-9)
    np.testing.assert_allclose(values("clipping", "limit"), [0.6, 1.0, 1.4])
    np.testing.assert_allclose(values("clipping", "middle"), 1.0)
    np.testing.assert_allclose(values("dead_zone", "limit"), [0.1, 0.4, 1.0])
    np.testing.assert_allclose(values("dead_zone", "middle"), 1.0)
    for name in ("diode", "clipping"):
        np.testing.assert_allclose(values(name, "width"), 0.12)
    level = float(np.sqrt(np.mean(signal**2)))
    np.testing.assert_allclose(values("curvature", "square"), 0.1 / level)
    np.testing.assert_allclose(values("curvature", "cube"), np.array([0, 0.5, -0.5]) / level)


PLACES = {
    "diode": "threshold",
    "clipping": "middle",
    "dead_zone": "middle",
}
"""The parameters that say where an effect between filters is."""


@pytest.mark.parametrize("name", INSIDE)
def test_what_is_placed_changes_where_the_machine_is_displaced(name):
    effect, rng = INSIDE[name], np.random.default_rng(5)
    motion = Motion(*(k * rng.standard_normal(300) for k in (1.0, 3.0, 2.0)))

    def acted(effect, displaced):
        memory, values = effect.memory(), []
        steps = zip(*(np.asarray(part) for part in motion), strict=True)
        for (x0, v0, u0), (x1, v1, u1) in pairwise(steps):
            before = Motion(jnp.array(x0 + displaced), jnp.array(v0), jnp.array(u0))
            now = Motion(jnp.array(x1 + displaced), jnp.array(v1), jnp.array(u1))
            value, memory = effect.act(now, before, memory, 0.01)
            values.append(float(value))
        return np.array(values)

    for trial in effect.trials(motion)[:2]:
        still, moved = acted(trial, 0.0), acted(trial, 0.5)
        if name in PLACES:
            assert not np.allclose(still, moved, atol=1e-9)
            place = np.asarray(getattr(trial, PLACES[name]).value) + 0.5
            moved = acted(set_values(trial, {PLACES[name]: place}), 0.5)
        assert np.allclose(still, moved, atol=1e-9) != trial.is_placed


def test_the_drives_offset_is_free_where_it_is_none_of_the_response():
    """Without physics inside it is one of the response, unless nothing holds the machine."""

    def is_free(block):
        return not block.drive_offset.fixed

    assert not is_free(Within(OSCILLATOR))
    assert is_free(OSCILLATOR @ CubicStiffness(0.7))
    assert is_free(Within(Mass(2.0, 0.7)))
    assert not is_free(Impedance(1.0) @ DryFriction(0.3, 0.05))
    assert not is_free(OSCILLATOR @ DryFriction(0.3, 0.05))
    assert is_free(OSCILLATOR @ DryFriction(0.3, 0.05) @ CubicStiffness(0.7))
    moved = set_values(
        OSCILLATOR @ CubicStiffness(0.7),
        {"drive_offset": np.array(0.4), "start": np.array([0.1, 0.2])},
    )
    drive = np.sin(np.arange(200) / 20)
    shifted = set_values(moved, {"drive_offset": 0.0})
    np.testing.assert_allclose(
        respond(moved, drive, Grid(0.01)), respond(shifted, drive + 0.4, Grid(0.01))
    )
    # It stays where an effect comes or goes.
    for other in (moved @ EndStop(40.0, 0.5), moved.without(0)):
        assert float(other.drive_offset.value) == 0.4
        np.testing.assert_array_equal(other.start.value, [0.1, 0.2])
