"""The best linear approximation, and noise, odd and even distortions beside it, by closed forms."""

import numpy as np
import pytest
from scipy.signal import lfilter

import fracjax as fj
from fracjax._protocol._multisine import excited_lines, multisine

STEP, PERIOD, PERIODS = 1e-3, 600, 4
RNG = np.random.default_rng(0)


def recorded(wave, response, noise: float = 0.0, level: float = 50.0) -> fj.Recording:
    """Periods of a wave (N,) [V] about a level, between moves, with what answers it [um]."""
    whole = np.tile(wave, PERIODS)
    lead = np.linspace(0, level + wave[0], 400)
    drive = np.concatenate([np.zeros(300), lead, level + whole, lead[::-1], np.zeros(100)])
    values = response(drive - level) + noise * RNG.standard_normal(drive.size)
    return fj.Recording(drive, values, STEP, "V", "um", "tones")


def two_tones(*lines: int) -> np.ndarray:
    """Lines of amplitude 1.5 V over one period (N,)."""
    angles = 2 * np.pi * np.outer(lines, np.arange(PERIOD)) / PERIOD
    return 1.5 * np.cos(angles + np.array(lines)[:, None]).sum(axis=0)


def test_a_cube_of_two_tones_distorts_odd_lines_by_its_closed_form():
    """Of a (cos 3x + cos 5x) the cube has 3/4 a³ at the empty odd line 1 and 9/4 a³ at both."""
    wave = two_tones(3, 5)
    (one,) = fj.best_linear_approximations(recorded(wave, lambda u: 0.2 * u + 0.01 * u**3))
    assert one.frequencies_Hz == pytest.approx(np.array([3, 5]) / (PERIOD * STEP))
    assert one.amplitudes == pytest.approx(1.5)
    assert one.response == pytest.approx(0.2 + 0.01 * 9 / 4 * 1.5**2)
    assert one.odd == pytest.approx(0.01 * 3 / 4 * 1.5**2)
    assert one.even == pytest.approx(0.0, abs=1e-9)
    assert one.noise == pytest.approx(0.0, abs=1e-9)
    assert (one.level, one.unit) == (pytest.approx(50.0), "um/V")
    assert one.size == pytest.approx(np.ptp(wave))


def test_a_square_of_two_tones_distorts_even_lines_by_its_closed_form():
    """The square has a² at the line 2, and nothing at 4; the linear part is untouched."""
    response = recorded(two_tones(3, 5), lambda u: 0.2 * u + 0.01 * u**2)
    (one,) = fj.best_linear_approximations(response)
    assert one.response == pytest.approx(0.2)
    assert one.even == pytest.approx(0.01 * 1.5 / np.sqrt(2))
    assert one.odd == pytest.approx(0.0, abs=1e-9)


def test_of_many_tones_a_cube_adds_its_closed_form_and_the_errors_cover_the_scatter():
    """Of equal lines the mean ratio is <y u>/<u²>, over random phases 3/4 c a² (2 F - 1) more than
    the linear part at each of F lines."""
    rng, cube, size = np.random.default_rng(1), 0.01, 0.5
    lines, angles = excited_lines(99, rng), 2 * np.pi * np.arange(PERIOD) / PERIOD
    expected = 0.2 + 0.75 * cube * size**2 * (2 * lines.size - 1)
    off, odd = [], []
    for _ in range(24):
        phases = rng.uniform(0, 2 * np.pi, (lines.size, 1))
        wave = size * np.cos(lines[:, None] * angles + phases).sum(axis=0)
        (one,) = fj.best_linear_approximations(recorded(wave, lambda u: 0.2 * u + cube * u**3))
        mean = 0.2 + cube * np.mean(wave**4) / np.mean(wave**2)
        assert one.response.mean().real == pytest.approx(mean, rel=1e-6)
        off.append(np.abs(one.response - expected) ** 2)
        odd.append(one.odd**2)
    assert np.mean(off) == pytest.approx(np.mean(odd), rel=0.15)


def test_noise_is_what_differs_between_periods():
    """White noise of σ has 4 σ²/N at a line of amplitude 1, less for the mean of three periods."""
    wave = 3 * multisine(PERIOD, 199, 0.0)
    (one,) = fj.best_linear_approximations(recorded(wave, lambda u: 0.2 * u, noise=0.02))
    expected = np.sqrt(4 * 0.02**2 / PERIOD / (PERIODS - 1)) / one.amplitudes
    assert np.mean(one.noise / expected) == pytest.approx(1.0, abs=0.1)
    assert np.mean(np.abs(one.response - 0.2) ** 2 / one.noise**2) == pytest.approx(1.0, abs=0.4)
    assert np.sqrt(np.mean(one.odd**2)) < np.mean(one.noise)


def test_a_filter_is_its_frequency_response_also_while_the_response_drifts():
    wave = 3 * multisine(PERIOD, 199, 0.5)
    times = 1e-4 * np.arange(300 + 800 + PERIODS * PERIOD + 100)
    (one,) = fj.best_linear_approximations(
        recorded(wave, lambda u: lfilter([0.04], [1, -0.8], u) + times)
    )
    z = np.exp(-2j * np.pi * one.frequencies_Hz * STEP)
    assert one.response == pytest.approx(0.04 / (1 - 0.8 * z), rel=1e-6)


def test_its_table_is_written_and_read_back_with_its_errors(tmp_path):
    wave = 3 * multisine(PERIOD, 199, 0.5)
    response = recorded(wave, lambda u: lfilter([0.04], [1, -0.8], u) + 1e-4 * u**3, noise=0.01)
    (one,) = fj.best_linear_approximations(response)
    one.table.write(tmp_path / "response.csv")
    table = fj.read_frequency_table(tmp_path / "response.csv")
    assert (table.drive_unit, table.response_unit) == ("V", "um")
    assert table.frequencies_Hz == pytest.approx(one.frequencies_Hz)
    assert table.response == pytest.approx(one.response)
    errors = np.hypot(one.noise, one.odd) / np.abs(one.response) / np.sqrt(2)
    for read_back in (table.amplitude_errors, table.phase_errors):
        assert read_back == pytest.approx(errors)


def test_the_tones_of_a_protocol_are_recognised_at_each_of_its_levels(monkeypatch):
    monkeypatch.setattr("fracjax._protocol._protocol._MOST", 1)
    designed = fj.protocol("0..100 V, 5 V/ms", "1 kHz", duration="30 s", effects=["clock_skew"])
    drive = designed.drive.values
    recording = fj.Recording(drive, 0.2 * drive, designed.drive.step, "V", "um", "protocol")
    ones = fj.best_linear_approximations(recording)
    assert [round(one.level) for one in ones] == [25, 50, 75]
    for one in ones:
        assert one.response == pytest.approx(0.2)
        assert one.frequencies_Hz[-1] == pytest.approx(100, rel=0.05)
    assert ones[-1].to_dict()["level"] == pytest.approx(75)
    assert "odd distortions" in repr(ones[-1])


@pytest.mark.parametrize(
    "wave",
    [
        np.interp(np.arange(PERIOD), [0, PERIOD / 2, PERIOD], [-3, 3, -3]),
        3 * np.sin(2 * np.pi * np.arange(PERIOD) / PERIOD),
        np.random.default_rng(3).standard_normal(PERIOD),
        np.repeat([-3.0, 3.0, 1.0], PERIOD // 3),
        np.eye(1, PERIOD, 100)[0],
    ],
    ids=["triangle", "sine", "noise", "steps", "pulse"],
)
def test_a_drive_without_empty_lines_has_none(wave):
    assert fj.best_linear_approximations(recorded(wave, lambda u: 0.2 * u)) == ()
