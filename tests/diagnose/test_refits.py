"""Refits of modes that ring."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, chirp, lsim

import fracjax as fj
from fracjax._recording import Recording

STEP, SIGMA = 1e-4, 2e-3
TIMES = STEP * np.arange(2500)


FINE = STEP / 16 * np.arange(16 * TIMES.size)


def moved(frequency: float, damping: float, drive: np.ndarray) -> np.ndarray:
    """A drive at the times `FINE` through a mode, at the times `TIMES`."""
    w = 2 * np.pi * frequency
    mode = TransferFunction([w * w], [1, 2 * damping * w, w * w])
    return (np.asarray(lsim(mode, drive - drive[0], FINE)[1]) + drive[0])[::16]


def ringing(first_share: float) -> Recording:
    """A drive with corners through two lightly damped modes, and nothing else."""
    generator = np.random.default_rng(0)
    corners = np.arange(0, TIMES[-1] + 0.02, 0.02)
    drive = np.interp(TIMES, corners, generator.uniform(10, 90, corners.size))
    held = np.interp(FINE, TIMES, drive)
    one, other = moved(610, 0.01, held), moved(985, 0.02, held)
    response = 0.1 * (first_share * one + (1 - first_share) * other)
    noise = SIGMA * generator.standard_normal(drive.size)
    return Recording(drive, response + noise, STEP, "V", "um")


@pytest.mark.parametrize(
    ("share", "name"),
    [
        pytest.param(
            0.6,
            "second_mode",
            marks=pytest.mark.slow,
        ),
        (1.0, "resonance"),
    ],
)
def test_a_mode_that_rings_is_refitted_to_the_noise_and_two_are_two(share, name):
    diagnosis = fj.diagnose("creep", ringing(share), noise=SIGMA)
    assert [e.name for e in diagnosis.effects] == [name]
    found = {p.name: p.value for p in diagnosis.effects[0].parameters}
    assert found["frequency"] == pytest.approx(610, rel=0.01)
    assert found["damping"] == pytest.approx(0.01, rel=0.3)
    assert diagnosis.held_out.extended_rmse == pytest.approx(SIGMA, rel=0.1)


@pytest.mark.slow
def test_a_sweep_through_a_mode_finds_it_alone():
    """The mode lies in the band of the drive, where the base fit follows it as well as it can."""
    sweep = 50 + 40 * np.asarray(chirp(FINE, 50, FINE[-1], 900, phi=-90))
    noise = 0.02 * np.random.default_rng(0).standard_normal(TIMES.size)
    recording = Recording(sweep[::16], 0.1 * moved(610, 0.01, sweep) + noise, STEP, "V", "um")
    diagnosis = fj.diagnose("bouc_wen", recording, noise=0.02)
    (effect,) = diagnosis.effects
    assert (effect.name, effect.confusable_with) == ("resonance", ())
    found = {p.name: p.value for p in effect.parameters}
    assert found["frequency"] == pytest.approx(610, rel=2e-3)
    assert found["damping"] == pytest.approx(0.01, rel=0.1)
