"""The signal processing behind the benchmarks on real recordings, on signals that are known."""

import numpy as np
import pytest
from scipy.signal import welch

import fracjax as fj
from benchmarks.real import fsm_cubespec, nulls, recordings, semi_synthetic

RATE, PERIOD = recordings.FSM_RATE, recordings.FSM_PERIOD


def test_a_low_pass_keeps_phase_below_removes_what_repeats_above_and_leaves_the_noise():
    t = np.arange(PERIOD) / RATE
    below, above = np.sin(2 * np.pi * 150 * RATE / PERIOD * t), np.cos(2 * np.pi * 1000 * t)
    noise = 0.1 * np.cos(2 * np.pi * 700 * RATE / PERIOD * t)
    periods = np.stack([below + above + noise, below + above - noise], axis=1)
    found = recordings.low_passed(periods, 400.0, 2)
    wanted = np.stack([below + noise, below - noise], axis=1)[::2]
    assert found == pytest.approx(wanted, abs=1e-4)


def test_superposition_finds_what_an_axis_answers_to_its_own_drive():
    generator = np.random.default_rng(0)
    drives = np.zeros((PERIOD, 3, 3, 2))
    drives[..., 0] = drives[..., 1] = generator.standard_normal((PERIOD, 3, 3))
    gains = generator.standard_normal((3, 3))
    responses = np.einsum("ij,njrp->nirp", gains, np.roll(drives, 3, axis=0))
    for axis in range(3):
        drive, answer = fsm_cubespec.alone(drives, responses, axis)
        assert np.ptp(drive) > 1
        assert answer == pytest.approx(gains[axis, axis] * np.roll(drive, 3, axis=0), abs=1e-9)


def test_scatter_is_what_realisations_do_not_have_in_common():
    """A law of both and a disturbance of each: the disturbance's rms, whatever the law."""
    generator = np.random.default_rng(3)
    size, line = 4096, 400
    disturbed, sigma = [], 0.02
    for _ in range(2):
        spectrum = np.zeros(size // 2 + 1, complex)
        spectrum[1:line] = np.exp(2j * np.pi * generator.random(line - 1))
        drive = np.fft.irfft(spectrum) * 100
        own = np.fft.irfft(spectrum * generator.standard_normal(spectrum.size))
        answer = 3 * np.roll(drive, 2) + sigma * own / own.std()
        disturbed.append(fj.Recording(drive, answer, 1e-3))
    assert fsm_cubespec.scatter(*disturbed) == pytest.approx(sigma, rel=0.1)


def test_surrogate_noise_has_the_spectrum_it_was_given():
    frequencies = np.linspace(0, 100, 201)
    power = 1e-5 * (1 + 20 * np.exp(-(((frequencies - 58) / 2) ** 2)))
    noise = nulls.surrogate((frequencies, power), 100_000, np.random.default_rng(0))
    assert noise.var() == pytest.approx(np.trapezoid(power, frequencies), rel=0.02)
    found = welch(noise, 1 / nulls.STEP, nperseg=400)[1]
    assert found[4:-4] == pytest.approx(power[4:-4], rel=0.35)


def test_levelling_takes_off_offset_stroke_and_timing_and_nothing_else():
    turns = np.arange(nulls.PERIOD) / nulls.PERIOD
    mean = np.sin(2 * np.pi * turns) + 0.1 * np.sin(4 * np.pi * turns)
    other = 0.01 * np.cos(14 * np.pi * turns)
    changed = 0.3 + 1.02 * mean + 0.05 * np.gradient(mean) + other
    assert nulls.levelled(changed, mean) == pytest.approx(mean + other, abs=1e-6)


def test_sealed_effects_against_closed_forms():
    t = np.arange(2000) * nulls.STEP
    step = np.where(t >= 1.0, 10.0, 0.0)
    crept = semi_synthetic.creep(step, t)
    assert crept[-1] == pytest.approx(10 * (1 + 0.02 * np.log10(1 + (t[-1] - 1) / 0.1)))
    slow = np.sin(2 * np.pi * 0.5 * t)
    gain = 1 / (1 - (0.5 / 18.0) ** 2)
    assert semi_synthetic.resonance(slow, t)[1500:] == pytest.approx(
        gain * slow[1500:], abs=2e-3 + 2 * 0.03 * 0.5 / 18
    )
    loose = semi_synthetic.backlash(10 * slow, t)
    assert np.ptp(loose) == pytest.approx(np.ptp(10 * slow) - 0.6, rel=1e-4)
