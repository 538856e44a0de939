"""Creep by TFOCIM and OFOCIM: coverage by simulation, and ratios from recordings."""

import json
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import FOH, Creep, PEADynamics
from fracjax._operators import Grid

TABLE = np.geomspace(0.01, 3e3, 60)  # Hz
TRUTH: dict[str, Any] = {
    "gain": 1.0,
    "creep_gain": 0.5,
    "mu": -0.3,
    "frequency": 800.0,
    "damping": 0.05,
}
NOISE = 0.01
TABLES = 300
# 93 to 97 %, and 2.5 standard deviations of a binomial share of 300 beyond it.
MARGIN = 2.5 * np.sqrt(0.95 * 0.05 / TABLES)


def amplitudes(block, frequencies=TABLE):
    return np.abs(fj.frequency_response(block, frequencies))


def coverage(identify, block, truth: dict[str, Any]) -> dict[str, float]:
    """How often the 95 % interval of each parameter holds the truth, over 300 noisy tables."""
    generator = np.random.default_rng(1)
    exact = amplitudes(block)
    inside = dict.fromkeys(truth, 0)
    for _ in range(TABLES):
        noisy = exact * np.exp(NOISE * generator.standard_normal(TABLE.size))
        found = identify(TABLE, noisy)
        assert found.converged
        for name, value in truth.items():
            inside[name] += found[name].low <= value <= found[name].high
    return {name: count / TABLES for name, count in inside.items()}


def assert_covered(shares: dict[str, float]) -> None:
    assert all(0.93 - MARGIN <= share <= 0.97 + MARGIN for share in shares.values()), shares


def test_tfocim_s_intervals_hold_the_truth_as_often_as_they_say():
    truth: dict[str, Any] = {"k_c": 0.0017, "mu": 0.0072}
    assert_covered(coverage(fj.tfocim, Creep(**truth), truth))


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [{}, {"creep_gain": 0.1, "mu": -0.1}],
    ids=["strong", "slight"],
)
def test_ofocim_s_intervals_hold_the_truth_as_often_as_they_say(changes):
    block = PEADynamics(**TRUTH | changes)
    order = fj.ofocim(TABLE, amplitudes(block))["creep_order"].value
    assert_covered(coverage(fj.ofocim, block, TRUTH | changes | {"creep_order": order}))


# What the methods are -----------------------------------------------------------------------------


def test_tfocim_is_the_straight_line_of_numpy():
    ratios = amplitudes(Creep(0.0017, 0.0072))
    ratios = ratios * np.exp(NOISE * np.random.default_rng(2).standard_normal(TABLE.size))
    found = fj.tfocim(TABLE, ratios)
    x, y = np.log10(2 * np.pi * TABLE), 20 * np.log10(ratios)  # [F 15, 16]
    (slope, level), covariance = np.polyfit(x, y, 1, cov=True)
    assert found["mu"].value == pytest.approx(-slope / 20, rel=1e-9)
    assert found["mu"].standard_error == pytest.approx(np.sqrt(covariance[0, 0]) / 20, rel=1e-9)
    assert found["k_c"].value == pytest.approx(10 ** (level / 20), rel=1e-9)
    assert found.scatter_dB == pytest.approx(20 / np.log(10) * NOISE, rel=0.3)
    np.testing.assert_allclose(amplitudes(found.block), found.fitted, rtol=1e-9)


@pytest.mark.parametrize("wrong", [0.5, 2.0])
def test_weights_are_relative(wrong):
    """Standard errors too large or too small by a factor change nothing; one noisy point does."""
    ratios = amplitudes(PEADynamics(**TRUTH))
    ratios[30] *= 1.5
    errors = np.where(np.arange(TABLE.size) == 30, 0.5, 0.01) * ratios
    for identify in (fj.tfocim, fj.ofocim):
        one, other = identify(TABLE, ratios, errors), identify(TABLE, ratios, wrong * errors)
        for a, b in zip(one.estimates, other.estimates, strict=True):
            assert a.standard_error == pytest.approx(b.standard_error, rel=1e-5)
    weighted, plain = fj.ofocim(TABLE, ratios, errors), fj.ofocim(TABLE, ratios)
    assert abs(weighted["gain"].value - 1) < 0.1 * abs(plain["gain"].value - 1)


@pytest.mark.parametrize("method", [fj.tfocim, fj.ofocim])
def test_an_exact_table_gives_back_its_law(method):
    block = Creep(0.0017, 0.0072) if method is fj.tfocim else PEADynamics(**TRUTH)
    found = method(TABLE, amplitudes(block))
    for name, parameter in fj.Model(block).parameters.items():
        assert found[name].value == pytest.approx(float(parameter.value), rel=1e-5)
    assert found.unidentified == ()
    assert found.scatter_dB < 1e-6
    np.testing.assert_allclose(found.fitted, found.ratios, rtol=1e-6)


def test_dynamics_pass_for_creep_in_a_straight_line_but_not_in_ofocim():
    """The reason for OFOCIM [F §4.3]: below a mode the ratio rises, and hides creep."""
    frequencies = np.geomspace(0.1, 300, 60)
    block = PEADynamics(1.0, 0.1, -0.1, 500.0, 0.05)
    generator = np.random.default_rng(3)
    ratios = amplitudes(block, frequencies) * np.exp(1e-3 * generator.standard_normal(60))
    exact = fj.ofocim(frequencies, amplitudes(block, frequencies))["creep_order"].value
    line, both = fj.tfocim(frequencies, ratios), fj.ofocim(frequencies, ratios)
    assert both["creep_order"].low <= exact <= both["creep_order"].high
    assert line["mu"].value < 0 < exact
    assert both["frequency"].value == pytest.approx(500.0, rel=0.02)


def test_what_a_table_does_not_tell_is_named():
    """Up to 100 Hz a mode at 8 kHz does not show; and slight creep over three decades has a slope
    but no curvature, so that g and g_μ are only known together."""
    frequencies = np.geomspace(0.1, 100, TABLE.size)
    noise = np.sqrt(2) * NOISE * np.random.default_rng(4).standard_normal(TABLE.size)
    block = PEADynamics(1.0, 0.1, -0.1, 8e3, 0.05)
    ratios = amplitudes(block, frequencies) * np.exp(noise)
    found = fj.ofocim(frequencies, ratios)
    assert {"gain", "creep_gain", "frequency", "damping"} <= set(found.unidentified)
    for name, parameter in (("frequency", block.frequency), ("damping", block.damping)):
        assert (found[name].low, found[name].high) == (parameter.lower, parameter.upper)
    assert found["creep_order"].identified
    exact = fj.ofocim(frequencies, amplitudes(block, frequencies))["creep_order"].value
    assert found["creep_order"].low <= exact <= found["creep_order"].high


def test_results_are_plain_data():
    for found in (fj.tfocim(TABLE, amplitudes(Creep())), fj.ofocim(TABLE, amplitudes(Creep()))):
        told = json.loads(json.dumps(found.to_dict(), allow_nan=False))
        assert told["schema"] == "fracjax.creep/1"
        assert told["method"] == found.method
        for estimate in found.estimates:
            assert told["parameters"][estimate.name]["value"] == estimate.value
            assert estimate.low <= estimate.value <= estimate.high
            assert estimate.unit


def test_numbers_are_float64_as_a_user_finds_jax(float32_default):
    block = PEADynamics(**TRUTH)
    found = fj.ofocim(TABLE, amplitudes(block))
    assert found["mu"].value == pytest.approx(-0.3, rel=1e-6)
    assert all(isinstance(e.value, float) for e in found.estimates)


@pytest.mark.parametrize(
    ("frequencies", "ratios", "errors", "message"),
    [
        ([1, 2], [1, 1], None, "expected at least"),
        ([1] * 9, [1] * 9, None, "expected at least . frequencies, found 1"),
        (np.arange(9), [1] * 9, None, "frequencies_Hz: expected positive numbers"),
        (range(1, 10), [1] * 8 + [-1], None, "ratios: expected positive numbers"),
        (range(1, 10), [1] * 8 + [np.nan], None, "ratios: expected positive numbers"),
        (range(1, 10), [1] * 8, None, "frequencies_Hz: expected a list of 8 numbers"),
        (range(1, 10), [1] * 9, [0.1], "standard_errors: expected a list of 9 numbers"),
        (range(1, 10), [1] * 9, [0.0] * 9, "standard_errors: expected positive numbers"),
    ],
)
@pytest.mark.parametrize("method", [fj.tfocim, fj.ofocim])
def test_tables_that_cannot_be_used_are_refused(method, frequencies, ratios, errors, message):
    with pytest.raises(fj.InputError, match=message):
        method(list(frequencies), ratios, errors)


# Ratios from a recording --------------------------------------------------------------------------

STEP = 1 / 2000
TONES = np.array([0.5, 1.0, 2.0, 5.0, 12.0, 30.0, 70.0, 130.0, 180.0, 220.0])
ACTUATOR = PEADynamics(0.1, 0.05, -0.3, 200.0, 0.05)


FINER = 8  # the simulation's grid, so that its own error stays below 0.05 %


def record(drive, block: fj.AbstractBlock = ACTUATOR, sigma=1e-3, seed=0):
    """A recording [V, µm] of a drive given on the finer grid: white noise and a warming frame."""
    clean = block(jnp.asarray(drive), Grid(STEP / FINER, "constant"))
    response = np.asarray(clean)[::FINER]
    noise = sigma * np.random.default_rng(seed).standard_normal(response.size)
    warming = 0.02 * STEP * np.arange(response.size)
    return fj.Recording(drive[::FINER], response + noise + warming, STEP, "V", "um")


def one_after_another():
    parts = []
    for hertz in TONES:
        samples = FINER * round(max(6 / hertz, 0.5) / STEP)
        parts.append(50 - 50 * np.cos(2 * np.pi * hertz * np.arange(samples) * STEP / FINER))
    return np.concatenate(parts)


def together():
    times = np.arange(24000 * FINER) * STEP / FINER
    waves = [7 * np.cos(2 * np.pi * f * times + k**2) for k, f in enumerate(TONES)]
    return 50 + np.sum(waves, axis=0)


@pytest.mark.parametrize("drive", [one_after_another, together])
def test_ratios_of_several_tones(drive):
    """To 0.05 % of the law's |G| below the mode, for memory of the start; near the mode to 0.5 %,
    for the simulation's own step."""
    found = fj.amplitude_ratios(record(drive()))
    np.testing.assert_allclose(found.frequencies_Hz, TONES, rtol=1e-3)
    wanted = amplitudes(ACTUATOR, TONES)
    np.testing.assert_allclose(found.ratios, wanted, rtol=5e-3)
    np.testing.assert_allclose(found.ratios[:7], wanted[:7], rtol=5e-4)
    assert found.unit == "um/V"
    some = fj.amplitude_ratios(record(drive()), [2.0, 30.0])
    np.testing.assert_allclose(some.ratios, found.ratios[[2, 5]], rtol=1e-12)


def test_multi_sine_takes_the_frequencies_it_is_told():
    found = fj.amplitude_ratios(record(together()), TONES * 1.0001)
    np.testing.assert_allclose(found.frequencies_Hz, TONES, rtol=1e-6)


@pytest.mark.slow
def test_standard_errors_are_the_scatter_of_repeats():
    """Over 16 recordings with other noise, 10 tones: their mean scatter is known to 6 %."""
    one = record(together(), sigma=0.0)
    runs = [
        fj.amplitude_ratios(
            replace(
                one,
                response=one.response + 0.05 * np.random.default_rng(k).standard_normal(len(one)),
            )
        )
        for k in range(16)
    ]
    scatter = np.std([run.ratios for run in runs], axis=0, ddof=1)
    assert np.mean(scatter / runs[0].standard_errors) == pytest.approx(1.0, abs=0.15)


def test_hysteresis_does_not_disturb_the_fundamental():
    """FOH without its rate term is linear: its fundamental is |k_l + k_h (jω)^α|."""
    foh = FOH(0.05, 0.05, 0.0, -0.14)
    found = fj.amplitude_ratios(record(one_after_another(), foh))
    np.testing.assert_allclose(found.ratios, amplitudes(foh.linear_part, TONES), rtol=5e-4)


@pytest.mark.slow
def test_creep_and_dynamics_from_a_recording():
    """The whole path, and both methods take the ratios as they come."""
    ratios = fj.amplitude_ratios(record(one_after_another(), sigma=0.5))
    table = (ratios.frequencies_Hz, ratios.ratios, ratios.standard_errors)
    found = fj.ofocim(*table)
    for name, parameter in fj.Model(ACTUATOR).parameters.items():
        assert found[name].low <= float(parameter.value) <= found[name].high
    assert found["frequency"].value == pytest.approx(200.0, rel=2e-3)
    assert found.unidentified == ()
    below = slice(0, 5)  # where the mode has no say
    assert fj.tfocim(*(column[below] for column in table))["mu"].value > 0.02
    told = json.loads(json.dumps(ratios.to_dict(), allow_nan=False))
    assert told["ratios"] == list(ratios.ratios)


TIMES = np.arange(8000) * STEP


@pytest.mark.parametrize(
    "drive",
    [
        50 * np.sin(2 * np.pi * (TIMES + 3 * TIMES**2)),
        np.cumsum(np.random.default_rng(1).standard_normal(8000)),
        np.where(TIMES > 2, 50.0, 0.0),
    ],
    ids=["chirp", "random walk", "step"],
)
def test_a_drive_without_steady_tones_is_refused(drive):
    recording = fj.Recording(drive, drive, STEP, "V", "um")
    with pytest.raises(fj.InputError, match="drive: expected steady tones"):
        fj.amplitude_ratios(recording)


def test_tones_that_are_not_there_are_refused():
    with pytest.raises(fj.InputError, match=r"expected a tone of 3 Hz, found tones of 0.5, 1, 2"):
        fj.amplitude_ratios(record(one_after_another()), [3.0])
    for wrong in ([0.0], [1000.0], [np.nan]):
        with pytest.raises(fj.InputError, match="expected numbers between 0 and 1000 Hz"):
            fj.amplitude_ratios(record(one_after_another()), wrong)


def test_frequencies_are_refined_from_the_drive_to_far_below_a_line_s_width():
    times = np.arange(40_000) / 2000
    tones = (1.3717, 7.0913)
    parts = [30 * np.sin(2 * np.pi * f * times[:20_000]) for f in tones]
    drive = 50 + np.concatenate(parts)
    found = fj.amplitude_ratios(fj.Recording(drive, 0.1 * drive, 1 / 2000, "V", "um"))
    assert found.frequencies_Hz == pytest.approx(tones, rel=1e-6)
    together = 50 + 15 * np.sum([np.sin(2 * np.pi * f * times) for f in tones], axis=0)
    found = fj.amplitude_ratios(fj.Recording(together, 0.1 * together, 1 / 2000, "V", "um"))
    assert found.frequencies_Hz == pytest.approx(tones, rel=1e-6)


@pytest.mark.parametrize("in_turn", [True, False])
def test_a_parabola_of_time_is_drift_and_no_tone(in_turn):
    waves = np.sin(2 * np.pi * np.array([[2.0], [7.0]]) * TIMES)
    drive = np.concatenate(waves) if in_turn else waves.sum(axis=0)
    drift = (np.arange(drive.size) / drive.size) ** 2
    found = fj.amplitude_ratios(fj.Recording(drive, 0.1 * drive + drift, STEP, "V", "um"))
    assert found.ratios == pytest.approx([0.1, 0.1], rel=1e-9)
