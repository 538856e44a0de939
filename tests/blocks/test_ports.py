"""Machines at their drive and their ports against closed forms; the places that a port may have."""

from itertools import pairwise

import jax.numpy as jnp
import numpy as np
import pytest

from fracjax._blocks import (
    FractionalKelvinVoigt,
    FractionalMaxwell,
    FractionalZener,
    Impedance,
    Lag,
    Mass,
    Modes,
    Oscillator,
    Springpot,
    Within,
)
from fracjax._operators import Grid
from fracjax._parameters import named_parameters
from tests.blocks.forms import FILTERS, FORMS, JW, MODES, NAMES, OSCILLATORS, of_system
from tests.helpers import respond


@pytest.mark.parametrize("name", NAMES)
def test_drive_and_ports_have_their_closed_forms(name):
    machine, driven, ports = FORMS[name]
    np.testing.assert_allclose(machine.symbol(jnp.asarray(JW)), driven(JW), rtol=1e-9)
    a, b, c, d = of_system(machine)
    gains = np.stack([c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d for s in JW])
    np.testing.assert_allclose(gains[:, 0, 0], driven(JW), rtol=1e-9, atol=1e-12)
    assert [*machine.ports()] == [*ports]
    kinds = {"outflow": "flow", "last": "flow", "between": "signal"}
    for k, (site, (acted, position, moved)) in enumerate(ports.items(), 1):
        port = machine.ports()[site]
        assert port.kind == kinds.get(site, "force")
        np.testing.assert_allclose(gains[:, 0, k], acted(JW), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(gains[:, k, 0], position(JW), rtol=1e-9)
        np.testing.assert_allclose(gains[:, k, k], moved(JW), rtol=1e-9, atol=1e-9)
        # A force depends on a velocity, a flow and a signal on a level alone.
        rate = gains[:, len(ports) + k, 0]
        np.testing.assert_allclose(rate, JW * position(JW) * (port.kind == "force"), 1e-9, 1e-9)


STATIC = [*(form[0] for form in FORMS.values()), Impedance(2.0, 0.5, 0.1, 0.7), Springpot(2.0, 0.3),
          FractionalMaxwell(2.0, 0.05, 0.4), FractionalKelvinVoigt(2.0, 0.05, 0.4),
          FractionalZener(1.5, 4.0, 0.05, 0.4)]  # fmt: skip


@pytest.mark.parametrize("block", STATIC, ids=lambda block: type(block).__name__)
def test_the_static_gain_is_that_of_a_rate_of_0(block):
    """But of a mass that nothing holds, which counts as at rest."""
    gain = complex(block.symbol(jnp.asarray([0j]))[0]).real
    if isinstance(block, Mass) and not block.of_velocity:
        gain = 0.0
    assert float(np.asarray(block.static_gain())) == pytest.approx(gain, abs=1e-12)


def test_flags_of_machines():
    assert [m.settles for m in (OSCILLATORS["position"], FILTERS, MODES["position"], Lag())] == (
        4 * [True]
    )
    assert not any(m.drifts for m in (OSCILLATORS["position"], FILTERS, Lag(), Impedance()))
    masses = Mass(), Mass(of_velocity=True)
    assert [m.settles for m in masses] == [False, False]
    assert [m.drifts for m in masses] == [True, False]
    assert Within(Impedance()).leads
    assert not Within(FILTERS).leads


ORDERS = {
    "oscillator": (OSCILLATORS["position"], 3),
    "modes": (MODES["position"], 3),
    "filters": (FILTERS, 3),
    "mass": (Mass(2.0, 0.7), 3),
    "lag": (Lag(0.8, (0.4,)), 4),
    "impedance": (Impedance(2.0, 0.5, 0.1, 0.7), 2),
    "springpot": (Springpot(2.0, 0.3), 2),
    "zener": (FractionalZener(1.5, 4.0, 0.05, 0.4), 4),
}


@pytest.mark.parametrize("name", ORDERS)
def test_the_convolution_is_of_its_order(name):
    """Three where poles are near the imaginary axis, two where the response leads."""
    block, order = ORDERS[name]
    responses = []
    for steps in (400, 800, 1600):
        times = np.linspace(0, 2, steps + 1)
        drive = times**6 * np.exp(-3 * times)
        responses.append(respond(block, drive, Grid(times[1], "rest"))[:: steps // 400])
    errors = [np.abs(one - other).max() for one, other in pairwise(responses)]
    assert block.accuracy == order
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.5)


@pytest.mark.parametrize("swaps", range(8))
def test_a_place_between_filters_exchanges_poles_corners_or_zeros(swaps):
    names = ("frequencies", "dampings"), ("corners",), ("zeros", "zero_dampings")
    exchanged = [n for k, part in enumerate(names) for n in part if swaps >> (2 - k) & 1]
    place = Within(FILTERS).placements("between")[swaps].machine
    for name, parameter in named_parameters(FILTERS).items():
        wanted = parameter.value[::-1] if name in exchanged else parameter.value
        np.testing.assert_array_equal(named_parameters(place)[name].value, wanted)


def test_a_machine_has_one_place_at_its_port_but_a_joint_one_in_each_mode():
    assert len(Within(Oscillator()).placements("spring")) == 1
    joints = [p.machine.joint.value for p in Within(Modes()).placements("joint")]  # type: ignore[attr-defined]
    np.testing.assert_array_equal(joints, np.eye(2))
