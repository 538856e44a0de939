"""Forces, flows and signals inside machines against their formulas, and their trials' sizes."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import wrightomega

from fracjax._blocks import (
    INSIDE,
    AbstractForce,
    AbstractInside,
    Clearance,
    Clipping,
    CubicStiffness,
    Curvature,
    DeadZone,
    Diode,
    DryFriction,
    EndStop,
    HystereticSpring,
    InternalSaturation,
    LuGre,
    Motion,
    NegativeStiffness,
    PositionDependentGain,
    QuadraticDamping,
    QuadraticStiffness,
    RootOutflow,
)
from fracjax._parameters import named_parameters, set_values


def softplus(z):
    return np.log1p(np.exp(-np.abs(z))) + np.maximum(z, 0)


def friction(v):
    return -0.7 * (1 + 0.4 * np.exp(-(v**2) / 2.25)) * np.sign(v) * np.minimum(np.abs(v) / 0.2, 1)


LAWS: dict[str, tuple[AbstractForce, Callable]] = {
    "cubic": (CubicStiffness(0.7), lambda x, v, u: -0.7 * x * x * x),
    "softening": (CubicStiffness(-0.7), lambda x, v, u: 0.7 * x * x * x),
    "quadratic": (QuadraticStiffness(0.7), lambda x, v, u: -0.7 * x * x),
    "drag": (QuadraticDamping(0.7), lambda x, v, u: -0.7 * np.sign(v) * v * v),
    "coil": (PositionDependentGain(0.7, 0.3), lambda x, v, u: (0.7 * x + 0.21 * x * x) * u),
    "gap": (
        Clearance(0.7, 0.6),
        lambda x, v, u: 0.7 * np.sign(x) * np.minimum(np.abs(x), 0.6),
    ),
    "upper stop": (EndStop(3.0, 0.6, 1.0), lambda x, v, u: np.where(x > 0.6, -3.0 * (x - 0.6), 0)),
    "lower stop": (EndStop(3.0, 0.6, -1.0), lambda x, v, u: np.where(x < -0.6, -3 * (x + 0.6), 0)),
    "friction": (DryFriction(0.7, 0.2, 0.4, 1.5), lambda x, v, u: friction(v)),
    "magnet": (
        NegativeStiffness(0.7, 0.6),
        lambda x, v, u: 0.7 * np.sin(np.arctan(x / 0.6)) * 0.6,
    ),
    "orifice": (
        RootOutflow(0.7, -0.4),
        lambda x, v, u: np.where(x > -0.4, -0.7 * np.maximum(x + 0.4, 0) ** 0.5, 0),
    ),
    "overflow": (
        InternalSaturation(3.0, 0.4),
        lambda x, v, u: np.where(x > 0.4, -3.0 * (x - 0.4), 0),
    ),
    "diode": (Diode(0.7, 0.3, 0.2), lambda x, v, u: -0.14 * wrightomega((x - 0.3) / 0.2).real),
    "diode below": (
        Diode(0.7, 0.3, 0.2, upward=False),
        lambda x, v, u: 0.14 * wrightomega((0.3 - x) / 0.2).real,
    ),
    "supply": (
        Clipping(0.7, 0.5, 0.3, 0.2),
        lambda x, v, u: -0.14 * (softplus((x - 0.8) / 0.2) - softplus((-0.2 - x) / 0.2)),
    ),
    "crossover": (
        DeadZone(0.7, 0.5, 0.3),
        lambda x, v, u: -0.7 * np.minimum(np.maximum(x - 0.3, -0.5), 0.5),
    ),
    "bend": (Curvature(0.7, 0.3), lambda x, v, u: 0.7 * x * x + 0.21 * x * x * x),
}

POINTS = np.array(
    [-7.0, -1.3, -0.61, -0.59, -0.35, -0.1, 0.0, 0.1, 0.15, 0.39, 0.41, 0.75, 2.0, 9.0]
)
STATES = Motion(*(part.ravel() for part in np.meshgrid(POINTS, POINTS, np.array([-2.0, 0.5]))))


@pytest.mark.parametrize("name", LAWS)
def test_a_force_is_its_formula_to_both_sides_and_on_both_sides_of_a_threshold(name):
    effect, law = LAWS[name]
    force = effect.force(Motion(*map(jnp.asarray, STATES)))
    np.testing.assert_allclose(force, law(*STATES), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_a_forces_slope_is_finite_and_that_of_its_formula(name):
    """A slope that is no number in a branch not taken would end every fit."""
    effect, law = LAWS[name]
    states, step = [np.asarray(part) + 1e-3 for part in STATES], 1e-7

    def of(x: Any, v: Any, u: Any) -> Any:
        return effect.force(Motion(x, v, u))

    for place in range(3):
        slope = jax.vmap(jax.grad(of, place))(*map(jnp.asarray, states))
        ends = [
            law(*(part + way * step * (k == place) for k, part in enumerate(states)))
            for way in (1, -1)
        ]
        wanted = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(slope, wanted, rtol=1e-6, atol=1e-6)


def test_a_store_that_is_just_empty_has_a_slope():
    """The root's own is infinite there."""
    effect, _ = LAWS["orifice"]
    zero = jnp.zeros(())
    assert float(jax.grad(lambda x: effect.force(Motion(x, zero, zero)))(jnp.array(-0.4))) == 0.0


def test_a_soft_limit_is_a_sharp_one_where_its_width_is_small():
    x = np.linspace(-2, 2, 101)
    motion = Motion(jnp.asarray(x), jnp.zeros(101), jnp.zeros(101))
    soft = Clipping(0.7, 0.5, 0.3, 1e-4).force(motion) + DeadZone(0.7, 0.5, 0.3).force(motion)
    np.testing.assert_allclose(soft, -0.7 * (x - 0.3), atol=1e-4 * 0.7)
    one_way = Diode(0.7, 0.3, 1e-5).force(motion)
    np.testing.assert_allclose(one_way, -0.7 * np.maximum(x - 0.3, 0), atol=2e-4)


# Memory -------------------------------------------------------------------------------------------


def bent(slope: Callable, start: float, way: float, steps: int = 400) -> float:
    """The deflection after a way (Runge and Kutta's rule), from dz/dx = slope(z, sign)."""
    z, h, sign = start, way / steps, float(np.sign(way))
    for _ in range(steps if way else 0):
        a = slope(z, sign)
        b = slope(z + h * a / 2, sign)
        c = slope(z + h * b / 2, sign)
        z += h * (a + 2 * b + 2 * c + slope(z + h * c, sign)) / 6
    return z


def spring_slope(beta: float) -> Callable:
    """Of a hysteretic spring that yields at a deflection of .3."""
    return lambda z, sign: (1 + (beta - (z * sign > 0)) * abs(z)) / 0.3


def bristle_slope(speed: float) -> Callable:
    """Of bristles that bend within .3 and are stronger by .4 about rest."""
    limit = 1 + 0.4 * np.exp(-(speed**2) / 2.25)
    return lambda z, sign: (1 - z * sign / limit) / 0.3


def acted(effect: AbstractInside, start: float, way: float, speed: float) -> tuple[float, float]:
    """The force and the memory after a way from a memory."""
    at = [Motion(jnp.array(x), jnp.array(speed), jnp.array(0.7)) for x in (0.2, 0.2 + way)]
    force, memory = effect.act(at[1], at[0], jnp.array(start), 0.01)
    return float(force), float(memory)


WAYS = [(z, way) for z in (-0.6, 0.0, 0.5) for way in (-0.7, -0.05, 0.0, 0.05, 0.7)]


@pytest.mark.parametrize("beta", [0.0, 1e-7, 0.4, 1.0, 1 - 1e-7, 1.3])
def test_a_hysteretic_spring_is_its_equation_from_any_state(beta):
    """Loaded, relieved, and relieved then loaded; it yields, keeps its stiffness, or hardens."""
    spring = HystereticSpring(2.0, 0.3, beta)
    assert float(spring.memory()) == 0.0
    for start, way in WAYS:
        force, z = acted(spring, start, way, 1.0)
        assert z == pytest.approx(bent(spring_slope(beta), start, way), abs=2e-6)
        assert force == pytest.approx(-2.0 * 0.3 * z)


@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_a_hysteretic_springs_derivative_holds_where_an_exponential_is_its_series(rate):
    """At a release of 0 and of 1, where the closed form would divide by 0."""

    def deflection(beta, start, way):
        spring = set_values(HystereticSpring(2.0, 0.3, 0.5), {"release": beta})
        zero = jnp.zeros(())
        now, before = Motion(jnp.asarray(way), zero, zero), Motion(zero, zero, zero)
        return spring.act(now, before, jnp.asarray(start), 0.01)[1]

    derivative = jax.grad(deflection)
    for start, way in ((0.5, 0.2), (-0.6, 0.05), (-0.3, 0.3), (0.5, 0.0)):
        ends = [float(deflection(jnp.asarray(rate + s), start, way)) for s in (1e-4, -1e-4)]
        wanted = (ends[0] - ends[1]) / 2e-4
        assert float(derivative(jnp.asarray(rate), start, way)) == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("speed", [0.0, 1.2, -5.0])
def test_bristles_are_their_equation_from_any_state(speed):
    bristles = LuGre(2.0, 0.3, 0.4, 1.5)
    assert float(bristles.memory()) == 0.0
    for start, way in WAYS:
        force, z = acted(bristles, start, way, speed)
        assert z == pytest.approx(bent(bristle_slope(speed), start, way), abs=2e-6)
        assert force == pytest.approx(-2.0 * z)


def test_a_force_without_memory_remembers_nothing():
    effect, now = CubicStiffness(0.7), Motion(jnp.array(2.0), jnp.array(0.0), jnp.array(0.0))
    force, memory = effect.act(now, now, effect.memory(), 0.1)
    assert effect.memory() == memory == ()
    assert float(force) == pytest.approx(-5.6)


# The catalogue ------------------------------------------------------------------------------------

KINDS = {"force": [], "flow": ["root_outflow", "internal_saturation"],
         "signal": ["diode", "clipping", "dead_zone", "curvature"]}  # fmt: skip
UNPLACED = {"dry_friction", "quadratic_damping", "hysteretic_spring", "diode", "clipping",
            "dead_zone"}  # fmt: skip
RNG = np.random.default_rng(6)
MOVED = Motion(*(k * RNG.standard_normal(400) for k in (0.3, 5.0, 20.0)))
X, V, U = (float(np.sqrt(np.mean(np.square(part)))) for part in MOVED)


def sizes(name: str, parameter: str, of: type | None = None) -> list[float]:
    """A parameter's values in an effect's trials."""
    trials = INSIDE[name].trials(MOVED)
    return [float(getattr(t, parameter).value) for t in trials if of is None or type(t) is of]


@pytest.mark.parametrize("name", INSIDE)
def test_an_entry_says_what_its_blocks_are(name):
    effect = INSIDE[name]
    assert effect.kind == next((k for k, names in KINDS.items() if name in names), "force")
    for trial in effect.trials(MOVED):
        # A size that physics keeps above 0 has one sign, and is fitted on a logarithmic scale.
        assert named_parameters(trial)[trial.size].logarithmic == effect.one_sided
        assert trial.sticks == isinstance(trial, DryFriction)
        assert trial.is_placed == (name not in UNPLACED)


@pytest.mark.parametrize(
    ("name", "state"),
    [
        ("cubic_stiffness", (X, 0.0, 0.0)),
        ("quadratic_stiffness", (X, 0.0, 0.0)),
        ("quadratic_damping", (0.0, V, 0.0)),
        ("clearance", (9 * X, 0.0, 0.0)),
        ("dry_friction", (0.0, 9 * V, 0.0)),
        ("position_dependent_gain", (X / 100, 0.0, 100 * U)),
    ],
)
def test_a_trials_force_is_a_tenth_of_the_drive(name, state):
    """At the rms position and velocity, or where its force no longer grows."""
    for trial in INSIDE[name].trials(MOVED):
        if isinstance(trial, AbstractForce):
            force = abs(float(trial.force(Motion(*map(jnp.asarray, state)))))
            assert force == pytest.approx(0.1 * U, rel=0.04)


def test_trials_of_a_stop_have_a_tenth_of_the_drive_a_tenth_of_the_motion_beyond_it():
    reach = {1.0: MOVED.position.max(), -1.0: -MOVED.position.min()}
    shapes = [(side, share) for side in (1.0, -1.0) for share in (0.5, 0.7, 0.9)]
    assert sizes("end_stop", "side") == [side for side, _ in shapes]
    np.testing.assert_allclose(sizes("end_stop", "gap"), [s * reach[side] for side, s in shapes])
    np.testing.assert_allclose(sizes("end_stop", "stiffness"), U / X)
    # Where nothing moves to one side, the stop there is at rest.
    upward = Motion(np.abs(MOVED.position), *MOVED[1:])
    gaps = [float(t.gap.value) for t in INSIDE["end_stop"].trials(upward)][3:]
    np.testing.assert_allclose(gaps, np.array([0.5, 0.7, 0.9]) * 1e-9 * X)


def test_trials_of_friction_are_sharp_slow_and_bristling():
    assert len(INSIDE["dry_friction"].trials(MOVED)) == 7
    creep = np.array([0.003, 0.03, 0.3, 0.01, 0.01])
    np.testing.assert_allclose(sizes("dry_friction", "creep", DryFriction), creep * V)
    assert sizes("dry_friction", "excess", DryFriction) == [0, 0, 0, 0.5, 0.5]
    stribeck = sizes("dry_friction", "stribeck", DryFriction)[3:]
    np.testing.assert_allclose(stribeck, np.array([0.1, 0.5]) * V)
    np.testing.assert_allclose(sizes("dry_friction", "coulomb"), 0.1 * U)
    # Of the motion about its mean: where a position is counted from says nothing.
    deviation = MOVED.position.std()
    bristles = sizes("dry_friction", "presliding", LuGre)
    np.testing.assert_allclose(bristles, np.array([0.01, 0.1]) * deviation)


def test_trials_of_springs_have_a_tenth_of_the_drive_within_the_motion():
    level = MOVED.position.std()
    ways = np.repeat([0.1, 0.4, 1.5], 3)
    np.testing.assert_allclose(sizes("hysteretic_spring", "deflection"), ways * level)
    assert sizes("hysteretic_spring", "release") == 3 * [0.0, 0.5, 1.1]
    reached = np.array(sizes("hysteretic_spring", "stiffness")) * np.minimum(ways, 1) * level
    np.testing.assert_allclose(reached, 0.1 * U)
    widths = np.geomspace(0.1, 1, 4)
    np.testing.assert_allclose(sizes("negative_stiffness", "width"), widths * X)
    np.testing.assert_allclose(sizes("negative_stiffness", "stiffness"), 0.1 * U / (widths * X))
    np.testing.assert_allclose(sizes("clearance", "gap"), np.geomspace(0.05, 1.5, 6) * X)
    bends = np.array([0.0, 3.0, -3.0]) / X
    np.testing.assert_allclose(sizes("position_dependent_gain", "curvature"), bends)


def test_trials_of_stores_are_within_their_levels():
    low, span = MOVED.position.min(), np.ptp(MOVED.position)
    limits = low + np.array([0.6, 0.75, 0.9]) * span
    np.testing.assert_allclose(sizes("internal_saturation", "limit"), limits)
    np.testing.assert_allclose(sizes("internal_saturation", "overflow"), U / span)
    below = low - np.array([0.02, 0.2, 1.0]) * span
    np.testing.assert_allclose(sizes("root_outflow", "empty"), below)
    np.testing.assert_allclose(sizes("root_outflow", "outflow"), 0.1 * U / np.sqrt(span))


def test_trials_between_filters_lose_as_much_as_drives_the_signal():
    for name in ("diode", "clipping", "dead_zone"):
        np.testing.assert_allclose(sizes(name, "loss"), U / X)
    ways = [trial.upward for trial in INSIDE["diode"].trials(MOVED)]  # type: ignore[attr-defined]
    assert ways == [True, True, True, False, False, False]


@pytest.mark.parametrize(
    ("name", "parameter", "values"),
    [
        ("root_outflow", "empty", [1.98, 1.8, 1.0]),
        ("internal_saturation", "limit", [2.6, 2.75, 2.9]),
        ("diode", "threshold", 2 * [2.3, 2.5, 2.7]),
        ("clipping", "limit", [0.15, 0.25, 0.35]),
        ("dead_zone", "limit", [0.025, 0.1, 0.25]),
    ],
)
def test_trials_of_what_does_not_move_have_a_range_of_1(name, parameter, values):
    still = Motion(np.full(50, 2.0), np.zeros(50), np.full(50, 3.0))
    trials = [float(getattr(trial, parameter).value) for trial in INSIDE[name].trials(still)]
    np.testing.assert_allclose(trials, values)
