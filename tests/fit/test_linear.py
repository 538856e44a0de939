"""Linear models as systems of SciPy and python-control, against their own transfer functions."""

import numpy as np
import pytest

import fracjax as fj
from tests.fit.creep import CLEAN, fit, record

control = pytest.importorskip("control")


def fitted(model: str) -> fj.Fit:
    return fit(record(CLEAN), model)


@pytest.fixture(scope="module")
def creep() -> fj.Fit:
    return fitted("creep")


def test_the_error_that_is_stated_is_that_of_the_transfer_function(creep):
    system, band, error = creep.to_scipy((0.5, 100.0))
    frequencies = np.geomspace(band[0], band[1], 77)
    # k_c s^-mu, written out.
    values = {name: float(p.value) for name, p in creep.model.parameters.items()}
    exact = values["k_c"] * (2j * np.pi * frequencies) ** -values["mu"]
    _, response = system.freqresp(2 * np.pi * frequencies)
    worst = np.abs(response / exact - 1).max()
    assert worst <= 1.01 * error
    assert worst == pytest.approx(error, rel=0.2)
    assert error < 2e-3


def test_python_control_gets_the_same_system(creep):
    one, other = creep.to_scipy(), creep.to_control()
    assert other.band == one.band == pytest.approx((1 / 1.2, 250.0))
    assert isinstance(other.system, control.StateSpace)
    s = 2j * np.pi * 10.0
    _, (value,) = one.system.freqresp([abs(s)])
    assert complex(other.system(s)) == pytest.approx(complex(value), rel=1e-9)


def test_a_resonance_keeps_its_poles():
    recording = fj.Recording(*_ringing(), 1e-3, "V", "um")
    found = fj.fit("resonance", recording, noise="1 nm", starts=4, settling=0, history="constant")
    poles = found.to_control((1.0, 400.0)).system.poles()
    ringing = poles[np.argmin(np.abs(np.abs(poles) - 2 * np.pi * 90.0))]
    assert abs(ringing) == pytest.approx(2 * np.pi * 90.0, rel=1e-2)
    assert -ringing.real / abs(ringing) == pytest.approx(0.05, rel=0.1)


def _ringing() -> tuple[np.ndarray, np.ndarray]:
    """Steps through 0.1 µm/V and a mode of 90 Hz with 5 % damping, by SciPy."""
    from scipy.signal import TransferFunction, lsim

    times = 1e-3 * np.arange(2000)
    ramp = np.clip((times % 0.25) / 0.01, 0, 1)
    drive = 40.0 + 20.0 * np.where((times // 0.25) % 2 == 0, ramp, 1 - ramp)
    omega = 2 * np.pi * 90.0
    law = TransferFunction([0.1 * omega**2], [1, 2 * 0.05 * omega, omega**2])
    _, response, _ = lsim(law, drive - drive[0], times)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(times.size)
    return drive, response + noise


def test_what_has_no_transfer_function_or_band_is_refused(creep):
    with pytest.raises(fj.InputError, match='model "foh": expected a linear model'):
        fitted("foh").to_scipy()
    with pytest.raises(fj.InputError, match="expected 0 < low < high in Hz, found 10 to 1"):
        creep.to_scipy((10.0, 1.0))


def test_without_python_control_the_remedy_is_named(creep, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "control", None)
    with pytest.raises(fj.InputError, match=r'run pip install "fracjax\[control\]"'):
        creep.to_control()
