"""Parameters of machines, materials and physics inside: starts, units, bounds, plausible ranges.

A search draws its starts from these ranges, and a fit warns outside them.
"""

import numpy as np
import pytest

from fracjax._blocks import (
    Clearance,
    Clipping,
    CubicStiffness,
    Curvature,
    DeadZone,
    Diode,
    DryFriction,
    EndStop,
    Filters,
    FractionalKelvinVoigt,
    FractionalMaxwell,
    FractionalZener,
    HystereticSpring,
    Impedance,
    InternalSaturation,
    Lag,
    LuGre,
    Mass,
    Modes,
    NegativeStiffness,
    Oscillator,
    PositionDependentGain,
    QuadraticDamping,
    QuadraticStiffness,
    RootOutflow,
    Springpot,
    StaticCurve,
    Within,
)
from fracjax._blocks._inside import rms
from fracjax._parameters import named_parameters

GAIN, FREE, FIXED = "gain", "free", "fixed"
"""A parameter of the response's size, one without bounds, and one that a fit leaves alone."""
PER, ONE, SLOPE, SHAPE = "response/drive", "1", "drive/response", "response"
STIFF, RATE = "response^-1", "response*s^-1"


def decades(bounds: tuple, ratio: float) -> tuple:
    """A logarithmic parameter between bounds, plausible within a factor of its start."""
    return "decades", *bounds, ratio


def between(*bounds_and_range: float) -> tuple:
    """A parameter between bounds on its own scale, and its plausible range."""
    return "between", *bounds_and_range


def logarithmic(*bounds_and_range: float) -> tuple:
    """One between bounds on a logarithmic scale, and its plausible range."""
    return "logarithmic", *bounds_and_range


ABOVE = "above"
"""A parameter above 0, within five decades of its start."""
ORDER = between(0.02, 1.0, 0.05, 0.9)
TIME = decades((1e-9, 1e9), 1e4)
HERTZ = decades((1e-6, 1e9), 20)

SCALES = {
    Oscillator: {
        "gain": (1.0, PER, GAIN),
        "frequency": (100.0, "Hz", decades((1e-6, 1e8), 5)),
        "damping": (0.05, ONE, logarithmic(1e-4, 10.0, 4e-3, 0.5)),
    },
    Mass: {
        "gain": (1.0, "response/drive*s^-2", GAIN),
        "rate": (1.0, "s^-1", decades((1e-6, 1e6), 10)),
    },
    Lag: {
        "gain": (1.0, PER, GAIN),
        "time_constants": ([1.0], "s", decades((1e-9, 1e9), 20)),
    },
    Modes: {
        "gains": ([1.0, 0.5], PER, GAIN),
        "frequencies": ([50.0, 120.0], "Hz", decades((1e-6, 1e8), 2)),
        "dampings": ([0.02, 0.02], ONE, logarithmic(1e-4, 2.0, 2e-3, 0.2)),
        "joint": ([1.0, 1.0], ONE, between(-1e3, 1e3, -1e3, 1e3), FIXED),
        "direct": (0.0, PER, GAIN),
    },
    Filters: {
        "gain": (1.0, PER, GAIN),
        "frequencies": ([100.0, 150.0], "Hz", HERTZ),
        "dampings": ([0.5, 0.5], ONE, logarithmic(1e-4, 10.0, 0.02, 2.0)),
        "corners": ([100.0, 150.0], "Hz", HERTZ),
        "zeros": ([1000.0, 1000.0], "Hz", HERTZ),
        "zero_dampings": ([0.5, 0.5], ONE, between(-1e3, 1e3, -2.0, 2.0)),
    },
    Impedance: {
        "stiffness": (1.0, PER, GAIN),
        "damping": (0.0, "response/drive*s^1", GAIN),
        "mass": (0.0, "response/drive*s^2", GAIN),
        "springpot": (0.1, "response/drive*s^order", GAIN),
        "order": (0.3, ONE, between(0.02, 0.98, 0.05, 0.9)),
    },
    StaticCurve: {
        "values": (np.linspace(-1, 1, 9), "response", GAIN),
        "low": (-1.0, "drive", FREE, FIXED),
        "high": (1.0, "drive", FREE, FIXED),
    },
    Springpot: {"modulus": (1.0, "response/drive*s^order", GAIN), "order": (0.2, ONE, ORDER)},
    FractionalMaxwell: {
        "modulus": (1.0, PER, GAIN),
        "time_constant": (1.0, "s", TIME),
        "order": (0.3, ONE, ORDER),
    },
    FractionalZener: {
        "modulus": (1.0, PER, GAIN),
        "instantaneous": (2.0, PER, GAIN),
        "time_constant": (1.0, "s", TIME),
        "order": (0.3, ONE, ORDER),
    },
    CubicStiffness: {"stiffness": (1.0, "drive/response*response^-2", FREE)},
    QuadraticStiffness: {"stiffness": (1.0, "drive/response*response^-1", FREE)},
    QuadraticDamping: {"drag": (1.0, "drive/response*response^-1*s^2", ABOVE)},
    PositionDependentGain: {"slope": (1.0, STIFF, FREE), "curvature": (0.0, STIFF, FREE)},
    Clearance: {"stiffness": (1.0, SLOPE, ABOVE), "gap": (1.0, SHAPE, ABOVE)},
    EndStop: {
        "stiffness": (1.0, SLOPE, ABOVE),
        "gap": (1.0, SHAPE, ABOVE),
        "side": (1.0, ONE, FREE, FIXED),
    },
    DryFriction: {
        "coulomb": (1.0, "drive", ABOVE),
        "creep": (1e-2, RATE, ABOVE),
        "excess": (0.0, ONE, between(0.0, 10.0, 0.0, 1.0), FIXED),
        "stribeck": (1.0, RATE, ABOVE, FIXED),
    },
    LuGre: {
        "coulomb": (1.0, "drive", ABOVE),
        "presliding": (1.0, SHAPE, ABOVE),
        "excess": (0.0, ONE, between(0.0, 10.0, 0.0, 1.0), FIXED),
        "stribeck": (1.0, RATE, ABOVE, FIXED),
    },
    HystereticSpring: {
        "stiffness": (1.0, SLOPE, ABOVE),
        "deflection": (1.0, SHAPE, ABOVE),
        "release": (0.0, ONE, between(0.0, 2.0, 0.0, 1.5)),
    },
    NegativeStiffness: {"stiffness": (1.0, SLOPE, ABOVE), "width": (1.0, SHAPE, ABOVE)},
    RootOutflow: {"outflow": (1.0, "drive*response^-0.5", ABOVE), "empty": (0.0, SHAPE, FREE)},
    InternalSaturation: {"overflow": (1.0, SLOPE, ABOVE), "limit": (1.0, SHAPE, FREE)},
    Diode: {
        "loss": (1.0, SLOPE, ABOVE),
        "threshold": (0.0, SHAPE, FREE),
        "width": (0.1, SHAPE, ABOVE),
    },
    Clipping: {
        "loss": (1.0, SLOPE, ABOVE),
        "limit": (1.0, SHAPE, ABOVE),
        "middle": (0.0, SHAPE, FREE),
        "width": (0.1, SHAPE, ABOVE),
    },
    DeadZone: {
        "loss": (1.0, SLOPE, ABOVE),
        "limit": (1.0, SHAPE, ABOVE),
        "middle": (0.0, SHAPE, FREE),
    },
    Curvature: {"square": (1.0, "drive*response^-2", FREE), "cube": (0.0, STIFF, FREE)},
}
SCALES[FractionalKelvinVoigt] = SCALES[FractionalMaxwell]


def bounds_of(scale, start: np.ndarray) -> list:
    """The bounds and the plausible range of a scale."""
    if scale == ABOVE:
        return [start / 1e5, start * 1e5] * 2
    if scale in (GAIN, FREE):
        return [np.float64(end) for end in 2 * (-np.inf, np.inf)]
    kind, *ends = scale
    if kind == "decades":
        return [*map(np.float64, ends[:2]), start / ends[2], start * ends[2]]
    return [*map(np.float64, ends)]


@pytest.mark.parametrize("block", SCALES, ids=lambda block: block.__name__)
def test_a_parameter_has_its_start_its_unit_and_its_ranges(block):
    parameters = named_parameters(block())
    assert [*parameters] == [*SCALES[block]]
    for name, (start, unit, scale, *more) in SCALES[block].items():
        parameter, start = parameters[name], np.asarray(start, float)
        np.testing.assert_array_equal(parameter.value, start, name)
        ends = [parameter.lower, parameter.upper, *parameter.plausible]
        for end, wanted in zip(ends, bounds_of(scale, start), strict=True):
            np.testing.assert_allclose(end, np.broadcast_to(wanted, end.shape), 1e-12)
        kind = scale if isinstance(scale, str) else scale[0]
        assert parameter.unit == unit
        assert parameter.gain == (scale == GAIN)
        assert parameter.logarithmic == (kind in (ABOVE, "decades", "logarithmic"))
        assert parameter.fixed == (FIXED in more)
        assert not parameter.per_recording


def test_ranges_follow_the_start():
    for block, name, ratio in (
        (Oscillator(1.0, 7.0), "frequency", 5),
        (Mass(1.0, 7.0), "rate", 10),
        (FractionalMaxwell(1.0, 7.0), "time_constant", 1e4),
        (Lag(1.0, (7.0, 3.0)), "time_constants", 20),
    ):
        parameter = named_parameters(block)[name]
        np.testing.assert_allclose(parameter.plausible[0], parameter.value / ratio)
        np.testing.assert_allclose(parameter.plausible[1], parameter.value * ratio)


@pytest.mark.parametrize("friction", [DryFriction, LuGre])
def test_stribecks_effect_is_fitted_where_a_start_has_it(friction):
    parameters = named_parameters(friction(1.0, 1.0, 0.5, 2.0))
    assert [name for name, p in parameters.items() if p.fixed] == []
    assert [float(p.value) for p in parameters.values()] == [1.0, 1.0, 0.5, 2.0]


def test_an_impedance_has_a_springpot_unless_it_is_none():
    without = named_parameters(Impedance(springpot=None))
    assert [n for n, p in without.items() if p.fixed] == ["springpot", "order"]
    assert float(without["springpot"].value) == 0.0


@pytest.mark.parametrize(
    ("measured", "unit"),
    [
        ("position", "response/drive"),
        ("velocity", "response/drive*s^1"),
        ("acceleration", "response/drive*s^2"),
    ],
)
def test_a_gain_of_a_derivative_has_its_seconds(measured, unit):
    assert Oscillator(measured=measured).gain.unit == unit
    assert Modes(measured=measured).gains.unit == unit
    assert Mass(of_velocity=True).gain.unit == "response/drive*s^-1"


@pytest.mark.parametrize(
    "machine", [Oscillator(), Mass(), Lag(1.0, (1.0, 2.0)), Modes(), Filters()]
)
def test_within_a_machine_gains_are_shapes_and_the_start_is_a_recordings_own(machine):
    """The response is linear in no gain once forces depend on the motion."""
    within = Within(machine)
    parameters = named_parameters(within)
    assert not any(p.gain for p in parameters.values())
    assert not within.linear
    start, offset = parameters["start"], parameters["drive_offset"]
    assert (start.unit, start.per_recording, start.fixed) == ("response", True, False)
    assert start.value.shape == (np.asarray(machine.system().b).size,)
    assert not start.value.any()
    assert (offset.unit, offset.per_recording, float(offset.value)) == ("drive", False, 0.0)


def test_within_an_impedance_gains_stay():
    """What moves is given, so that no force depends on a gain."""
    gains = [n for n, p in named_parameters(Within(Impedance())).items() if p.gain]
    assert gains == [f"machine.{name}" for name in ("stiffness", "damping", "mass", "springpot")]
    assert Within(Impedance()).drive_offset.fixed


@pytest.mark.parametrize(
    ("within", "free"),
    [
        (Lag() @ RootOutflow(), True),
        (Within(Lag()), False),
        (Oscillator() @ DryFriction() @ CubicStiffness(), True),
        (Oscillator() @ DryFriction() @ QuadraticDamping(), False),
        (Mass(of_velocity=True) @ DryFriction(), True),
        (Within(Mass()), True),
        (Impedance() @ CubicStiffness(), False),
    ],
)
def test_the_drives_offset_is_free_where_the_response_is_displaced_otherwise(within, free):
    """By an effect that is placed, or where nothing holds the machine; never of a given motion."""
    assert within.drive_offset.fixed is not free


def test_what_acts_at_a_joint_frees_its_shares():
    modes = Modes()
    assert modes.joint.fixed
    assert not (modes @ CubicStiffness()).machine.joint.fixed
    assert modes.opened("joint").gains.gain


def test_levels_are_about_0_and_1_for_nothing():
    assert rms([3.0, -4.0, 0.0, 0.0]) == pytest.approx(2.5)
    assert rms(np.zeros(4)) == 1.0
