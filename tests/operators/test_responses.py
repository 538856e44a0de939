"""Frequency response, Bode, step response and poles, against SciPy and closed forms."""

import numpy as np
import pytest
from scipy import signal

import fracjax as fj
from fracjax._blocks import (
    FOH,
    LFDH,
    BoucWen,
    Creep,
    Delay,
    DriveCircuit,
    DriveLag,
    InverseLFDH,
    PEADynamics,
    QuasiStaticForce,
    Resonance,
    SingleOperator,
)
from fracjax._blocks._block import LinearParallel, LinearSeries
from fracjax._blocks.creep import KelvinVoigtCreep, LogarithmicCreep
from fracjax._blocks.viscoelastic_layer import MaxwellLayer

FREQUENCIES = np.geomspace(0.1, 1e3, 50)
OMEGA = 2 * np.pi * 40.0
MODE = ([OMEGA**2], [1, 2 * 0.1 * OMEGA, OMEGA**2])
TIMES = np.arange(501) * 1e-3


def test_frequency_response_and_bode_are_scipy_s():
    """Of a mode, past which the phase falls below -180° where a lag follows."""
    law = Resonance(40.0, 0.1) >> DriveLag(1e-3)
    numerator, denominator = MODE[0], np.polymul(MODE[1], [1e-3, 1])
    _, magnitude, phase = signal.bode((numerator, denominator), 2 * np.pi * FREQUENCIES)
    found = fj.bode(law, FREQUENCIES)
    np.testing.assert_allclose(found.magnitude_dB, magnitude, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.phase_deg, phase, rtol=0, atol=1e-9)
    assert found.phase_deg[-1] < -200
    response = fj.frequency_response(law, FREQUENCIES)
    s = 2j * np.pi * FREQUENCIES
    wanted = np.polyval(numerator, s) / np.polyval(denominator, s)
    np.testing.assert_allclose(response, wanted, rtol=1e-12)


def test_frequency_response_is_float64_as_a_user_finds_jax(float32_default):
    response = fj.frequency_response(SingleOperator(2.0, 0.3), 1.0)
    assert response.dtype == np.complex128
    assert response[0] == pytest.approx(2 * (2j * np.pi) ** 0.3, rel=1e-14)
    assert fj.step_response(Creep(), TIMES).dtype == np.float64
    assert fj.poles(Resonance(40.0)).dtype == np.complex128


@pytest.mark.parametrize(
    ("block", "system", "error"),
    [
        (Resonance(40.0, 0.1), MODE, 2e-4),
        (PEADynamics(2.0, 0.0, 0.1, 40.0, 0.1), ([2 * OMEGA**2], MODE[1]), 2e-4),
        (DriveCircuit(3.0, 0.02), ([3.0], [0.02, 1]), 1e-4),
    ],
)
def test_step_response_is_scipy_s(block, system, error):
    _, wanted = signal.step(system, T=TIMES)
    found = fj.step_response(block, TIMES)
    np.testing.assert_allclose(found[1:], wanted[1:], rtol=0, atol=error * np.abs(wanted).max())


def test_step_response_of_any_block():
    """A loop saturates, a force follows at once; the jump itself counts half."""
    saturated = fj.step_response(BoucWen(1.0, -2.0), TIMES, 100.0)
    np.testing.assert_allclose(saturated[1:], 98.0, atol=1e-2)
    force = fj.step_response(QuasiStaticForce(5.0), TIMES, 2.0)
    np.testing.assert_allclose(force, 10 * np.heaviside(TIMES, 0.5), atol=1e-9)


def test_poles_of_rational_laws_are_the_roots_of_their_denominators():
    for block, denominator in (
        (DriveLag(0.02), [0.02, 1]),
        (DriveCircuit(3.0, 0.02), [0.02, 1]),
        (Resonance(40.0, 0.1), MODE[1]),
        (PEADynamics(1.0, 0.3, -0.2, 40.0, 0.1), MODE[1]),
        (PEADynamics(1.0, 0.3, -0.2, 40.0, 2.0), [1, 4 * OMEGA, OMEGA**2]),
        (DriveLag(0.02) >> Resonance(40.0, 0.1), np.polymul([0.02, 1], MODE[1])),
    ):
        found = np.sort_complex(fj.poles(block))
        np.testing.assert_allclose(found, np.sort_complex(np.roots(denominator)), rtol=1e-9)
        assert np.all(np.real(found) < 0)


@pytest.mark.parametrize(
    "block",
    [
        LFDH(),
        InverseLFDH(),
        Creep(),
        LogarithmicCreep(),
        SingleOperator(),
        FOH().linear_part,
        QuasiStaticForce(),
    ],
)
def test_powers_have_no_poles(block):
    assert fj.poles(block).shape == (0,)
    both = fj.poles(LinearSeries(block, DriveLag(0.02)))
    np.testing.assert_allclose(both, [-50.0])
    np.testing.assert_allclose(fj.poles(LinearParallel(block, DriveLag(0.02))), both)


@pytest.mark.parametrize(
    "block", [KelvinVoigtCreep(0.02, 0.02, 5.0), MaxwellLayer(0.02, 0.02, 5.0)]
)
def test_relaxations_have_a_pole_each(block):
    np.testing.assert_allclose(np.sort(fj.poles(block)), [-50.0, -10.0, -2.0, -0.4])


def test_lfdh_has_no_pole_on_the_principal_sheet():
    """1 + χ s^μ winds round 0 not once as s runs round the whole sheet."""
    chi, mu = 0.2, 0.44346
    edge = np.exp(1j * np.linspace(-np.pi, np.pi, 4001))
    path = np.concatenate([1e6 * edge, np.geomspace(1e6, 1e-6, 4000) * edge[-1], 1e-6 * edge[::-1]])
    values = 1 + chi * np.abs(path) ** mu * np.exp(1j * mu * np.angle(path))
    assert np.all(values.imag[np.angle(path) > 0] > 0)
    assert np.all(values.imag[np.angle(path) < 0] < 0)
    assert np.all(values.real[np.abs(np.angle(path)) < 1e-9] > 0)


@pytest.mark.parametrize("ask", [fj.frequency_response, fj.bode])
@pytest.mark.parametrize("block", [FOH(), BoucWen(), Creep() >> FOH(), Delay(1e-3, longest=0.1)])
def test_a_law_without_transfer_function_is_refused(ask, block):
    with pytest.raises(fj.InputError, match=r"expected a linear block .*found .*; compute"):
        ask(block, FREQUENCIES)
    with pytest.raises(fj.InputError, match="poles: expected a linear block"):
        fj.poles(block)


def test_poles_not_known_are_refused():
    with pytest.raises(fj.InputError, match="whose poles have a closed form, found Inverse"):
        fj.poles(Resonance(40.0).inverse())


@pytest.mark.parametrize("wrong", [[0.0, 1.0], [-1.0], [np.nan], [np.inf], [[1.0]]])
def test_frequencies_that_are_none_are_refused(wrong):
    with pytest.raises(fj.InputError, match="expected a list of frequencies above 0 Hz"):
        fj.frequency_response(Creep(), wrong)


@pytest.mark.parametrize("wrong", [[0.0, 1.0], TIMES + 1, TIMES**2, -TIMES, [TIMES]])
def test_times_that_are_not_uniform_are_refused(wrong):
    with pytest.raises(fj.InputError, match="expected uniform times from 0"):
        fj.step_response(Creep(), wrong)
