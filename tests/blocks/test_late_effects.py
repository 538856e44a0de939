"""What nine effects have in common: nothing without amplitude, derivatives, histories."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fracjax._blocks import (
    EFFECTS,
    AbstractBlock,
    ClockSkew,
    GainDrift,
    LostContact,
    Quantisation,
    SlewRateLimit,
    ThrownLoad,
    ViscoelasticLayer,
)
from fracjax._operators import Grid
from fracjax._parameters import named_parameters, set_values
from tests.blocks.motion import GRID, NAMES, STEP, TIMES, friction, lubricated, motion
from tests.helpers import respond

EFFECTS_HERE = [name for name in NAMES if name in EFFECTS]

# Lost contact -------------------------------------------------------------------------------------

thrown = ThrownLoad(120.0, typical=200.0)

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

    def traced(values, signal):
        return aim @ set_values(block, values)(signal, grid)

    def project(values, signal):
        return aim @ respond(set_values(block, values), signal, grid)

    by_value, by_sample = jax.jit(jax.grad(traced, (0, 1)))(values, signal)
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
