"""The recording's border, units, periods, rests and warnings."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.signal import find_peaks

from fracjax._recording import (
    UNSTATED,
    InputError,
    Recording,
    Repeats,
    conversion,
    fastest,
    inspect_together,
    parse_quantity,
    thinned,
    unit,
)
from fracjax._recording._periods import maxima_of, repeats_in, unit_range
from fracjax._recording._units import _SIMPLE, _by_pint

SAMPLES = np.arange(8000)
SINE = np.sin(2 * np.pi * SAMPLES / 200)
NOISE = np.random.default_rng(7).standard_normal(100_000)


@given(st.lists(st.integers(-2, 2), min_size=1, max_size=30))
def test_maxima_are_those_of_scipy(values):
    """Flat ones too, which integers have."""
    series = np.array(values, float)
    assert maxima_of(series).tolist() == find_peaks(series)[0].tolist()


def record(drive, response=None, dt=0.005, **rest) -> Recording:
    """A recording of `drive`, shape (N,), with a response that merely varies."""
    units: dict[str, Any] = {"drive_unit": "V", "response_unit": "um"} | rest
    return Recording(drive, NOISE[: len(drive)] if response is None else response, dt, **units)


# The border ---------------------------------------------------------------------------------------


def test_what_it_holds():
    drive = [float(k % 7) for k in range(40)]
    recording = record(drive, dt=0.5, drive_unit="mV", response_unit="nm")
    assert len(recording) == 40
    assert recording.rate == 2.0
    np.testing.assert_array_equal(recording.times, np.arange(40) / 2)
    np.testing.assert_array_equal(recording.drive, drive)
    assert recording.drive.dtype == recording.response.dtype == np.float64


def test_units_that_nobody_stated_are_those_of_no_other_quantity():
    recording = Recording(SINE[:50], NOISE[:50], 0.5)
    assert (recording.drive_unit, recording.response_unit) == ("drive units", "response units")
    assert "response units" in repr(recording)
    assert conversion("response units", "um") is None
    assert conversion("response units/drive units", "response units/drive units") == 1.0


def test_the_common_units_are_those_of_pint():
    for name in _SIMPLE:
        if name not in UNSTATED.values():
            own, pints = unit(name), _by_pint(name.replace("Nm", "N*m"))
            assert pints is not None
            assert own.base == pints.base
            assert float(own.scale / pints.scale) == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize("name", ["rad/s", "T", "inch", "1/V", "deg/s", "m/s**2", "rpm", "%", "°"])
def test_rarer_units_are_pints(name):
    assert unit(name) == _by_pint(name)
    assert not unit("rad/s").is_compatible_with(unit("Hz"))


def test_arrays_are_copies_that_cannot_be_written():
    drive = SINE[:100].copy()
    recording = record(drive)
    drive[0] = 9.0
    assert recording.drive[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        recording.response[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        recording.dt = 1.0  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"drive": SINE[:31], "response": NOISE[:31]}, "at least 32 samples, found 31"),
        ({"drive": SINE[:40]}, "40 of the drive and 50 of the response"),
        ({"drive": SINE[:50].reshape(-1, 2)}, r"one axis, found shape \(25, 2\)"),
        ({"drive": 1.0}, r"one axis, found shape \(\)"),
        ({"drive": [[1.0], [1.0, 2.0]]}, "rows of unequal length"),
        ({"drive": ["a"] * 50}, "drive: expected real numbers"),
        ({"response": SINE[:50] * 1j}, "response: expected real numbers, found complex128"),
        ({"response": np.zeros(50)}, "response: expected a signal that varies"),
        ({"response": np.r_[SINE[:49], np.nan]}, "response, sample 49: .* found nan"),
        ({"response": np.r_[np.inf, SINE[:49]]}, "response, sample 0: .* found inf"),
        ({"drive": np.r_[SINE[:49], 1e300]}, "drive, sample 49: expected a finite number"),
        ({"dt": 0.0}, "positive step in seconds, found 0"),
        ({"dt": -1.0}, "positive step in seconds, found -1"),
        ({"dt": np.nan}, "dt: expected"),
        ({"dt": np.inf}, "dt: expected"),
        ({"drive_unit": "wumpus"}, 'drive: expected a unit such as um.* found "wumpus"'),
        ({"response_unit": "1"}, "response: expected a unit"),
    ],
)
def test_refusals(change, sentence):
    good = {"drive": SINE[:50], "response": NOISE[:50], "dt": 0.1, "source": "loop.csv"}
    with pytest.raises(InputError, match=f"^loop.csv.*{sentence}.*; .*\\.$"):
        Recording(**good | change)


def test_window():
    recording = record(SINE, source="loop.csv", warnings=("assumed",), response_unit="nm")
    part = recording.window(100, 300)
    np.testing.assert_array_equal(part.response, recording.response[100:300])
    assert (part.source, part.warnings, part.response_unit) == ("loop.csv", ("assumed",), "nm")
    assert part.times[0] == 0.0
    for start, stop in ((-1, 100), (0, 8001), (200, 100), (0, 10)):
        with pytest.raises(InputError):
            recording.window(start, stop)


# Units --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "same", "ratio"),
    [
        ("um", "µm", 1),
        ("um", "\u03bcm", 1),
        ("Microns", "micron", 1),
        ("mm", " um ", 1000),
        ("Volts", "V", 1),
        ("Seconds", "ms", 1000),
        ("kHz", "Hz", 1000),
        ("N", "kg*m/s**2", 1),
        ("N·m", "J", 1),
        ("um / V", "nm/mV", 1),
        ("mm²", "um**2", 1e6),
    ],
)
def test_units(text, same, ratio):
    assert conversion(text, same) == pytest.approx(ratio)


@pytest.mark.parametrize(
    ("text", "default", "value"),
    [
        ("200Hz", "Hz", 200.0),
        (" 200 Hz ", "Hz", 200.0),
        ("0.2 kHz", "Hz", 200.0),
        ("200", "Hz", 200.0),
        (200, "Hz", 200.0),
        (np.float64(0.1), "Hz", 0.1),
        ("0.07 um", "um", 0.07),
        ("-70nm", "um", -0.07),
        ("1.5e-3 s", "ms", 1.5),
    ],
)
def test_quantities(text, default, value):
    assert parse_quantity(text, default) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize("text", ["", "Hz", "5 ms", "5 wumpus", "1,5 Hz", "nan", "1e999", "3 dB"])
def test_quantities_refused(text):
    with pytest.raises(InputError, match=r"^--rate: expected"):
        parse_quantity(text, "Hz", "--rate")


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=12) | st.text("mVus/*^-2 (_N.e", max_size=8))
@example("¼")
def test_any_text_is_a_unit_or_an_input_error(text):
    for reading in (unit, lambda text: parse_quantity(text, "Hz")):
        try:
            reading(text)
        except InputError as error:
            assert str(error).endswith(".")


# Periods ------------------------------------------------------------------------------------------

PATTERN = np.cumsum(NOISE[:1000])
SQUARE = np.tile(np.repeat([0.0, 1.0], 50), 10)
HOLD, RAMP = np.full(1000, 0.3), np.linspace(0.0, 1.0, 2000)


@pytest.mark.parametrize(
    ("drive", "expected"),
    [
        (SINE, (200, 0, 8000)),
        (SQUARE, (100, 0, 1000)),
        (np.tile(PATTERN, 3), (1000, 0, 3000)),
        (np.tile(NOISE[:127] > 0, 4).astype(float), (127, 0, 508)),
        (np.abs(SAMPLES % 300 - 150.0), (300, 0, 8000)),
        (np.sin(2 * np.pi * SAMPLES / 200) + np.sin(2 * np.pi * SAMPLES / 250), (1000, 0, 8000)),
        (SINE + 0.01 * np.sin(np.pi * SAMPLES / 200), (400, 0, 8000)),
        ((-1.0) ** SAMPLES, (2, 0, 8000)),
        (np.r_[HOLD, SINE[:3000]], (200, 1000, 4000)),
        (np.r_[HOLD, SINE[:3000], RAMP], (200, 1000, 4000)),
        (np.r_[SINE[:2000], HOLD, np.sin(np.pi * SAMPLES[:4000] / 25)], (50, 3000, 7000)),
    ],
)
@pytest.mark.parametrize("noise", [0.0, 3e-4])
def test_period(drive, expected, noise):
    noisy = 40 + 3 * (drive + noise * np.ptp(drive) * NOISE[: len(drive)])
    found = record(noisy).drive_period()
    assert found is not None
    assert found.period == expected[0]
    assert found == pytest.approx(expected, abs=1 if noise or expected[1] else 0)


def test_a_rare_pulse_makes_the_period_longer():
    drive = SINE[:6000].copy()
    drive[50::600] += 0.1
    assert record(drive).drive_period() == Repeats(600, 0, 6000)


def test_a_long_period_is_found_to_the_sample():
    drive = np.sin(2 * np.pi * np.arange(100_000) / 20_011)
    found = record(drive + 6e-4 * NOISE).drive_period()
    assert found == Repeats(20_011, 0, 100_000)


@pytest.mark.parametrize("period", [53, 30_011])
def test_a_period_of_millions_of_samples_is_found_to_the_sample(period):
    count = 2_200_000  # so that every second sample is looked at first
    rest = np.zeros(period)
    drive = np.concatenate([rest, np.sin(2 * np.pi * np.arange(count - period) / period)])
    found = repeats_in(unit_range(drive))
    assert found is not None
    assert (found.period, found.stop) == (period, count)
    # The sine leaves the rest slowly.
    assert abs(found.start - period) <= 2 + period / 500


@pytest.mark.parametrize("frequency", [1e-6, 2e-5, 0.01, 0.2])
def test_how_fast_a_long_signal_moves_is_what_its_whole_spectrum_tells(frequency):
    phase = 2 * np.pi * frequency * np.arange(2_100_000)
    assert fastest(np.sin(phase)) == pytest.approx(frequency, rel=0.05, abs=1e-6)
    means = thinned(np.sin(phase))
    assert len(means) == (700_000 if frequency < 1e-4 else len(phase))


@pytest.mark.parametrize("noise", [0.0, 3e-4])
@pytest.mark.parametrize(
    "drive",
    [
        np.sin(2 * np.pi * (SAMPLES / 2000 + SAMPLES**2 * 2e-6)),
        np.sin(20 * np.pi * np.exp(SAMPLES / 1000)),
        *(SINE * np.exp(-SAMPLES / samples) for samples in (500, 3000, 10_000, 50_000)),
        SINE * SAMPLES,
        SINE + SAMPLES / 2000,
        np.tile(PATTERN, 2),
        np.tile(PATTERN, 3)[:-1],
        (SAMPLES > 4000).astype(float),
        np.floor(SAMPLES / 500),
        SAMPLES.astype(float),
        NOISE[:8000],
        np.cumsum(NOISE[:8000]),
    ],
)
def test_no_period(drive, noise):
    assert record(drive + noise * np.ptp(drive) * NOISE[-len(drive) :]).drive_period() is None


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_period_of_any_tiled_pattern(data):
    pattern = np.array(data.draw(st.lists(st.integers(-9, 9), min_size=11, max_size=60)), float)
    shifts = (np.array_equal(np.roll(pattern, k), pattern) for k in range(1, len(pattern)))
    repeats = data.draw(st.integers(3, 9))
    if np.ptp(pattern) == 0:
        return
    fundamental = 1 + next((k for k, same in enumerate(shifts) if same), len(pattern) - 1)
    drive = np.tile(pattern, repeats)
    assert record(drive).drive_period() == Repeats(fundamental, 0, len(drive))


# Rests --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.0, 3e-4])
def test_rests_are_found(noise):
    drive = np.r_[SINE[:2000], np.zeros(1000), SINE[:1550], np.full(500, 0.2), RAMP]
    rests = record(drive + noise * NOISE[: len(drive)]).static_stretches()
    assert np.abs(np.array(rests) - [(2000, 3000), (4550, 5050)]).max() <= (20 if noise else 1)


def test_rests_last_as_long_as_asked():
    recording = record(np.r_[np.zeros(100), SINE[:2000], np.zeros(1000)], dt=0.01)
    assert len(recording.static_stretches()) == 2
    assert len(recording.static_stretches(minimum_seconds=5.0)) == 1
    assert recording.static_stretches(minimum_seconds=1e4) == []


@pytest.mark.parametrize("noise", [0.0, 3e-4])
@pytest.mark.parametrize("period", [20, 200, 5000, 30_000])
def test_the_turning_points_of_a_sine_are_no_rests(period, noise):
    drive = np.sin(2 * np.pi * np.arange(100_000) / period) + noise * NOISE
    assert record(drive).static_stretches() == []


# Warnings -----------------------------------------------------------------------------------------


def test_a_good_recording_has_no_warnings():
    assert record(SINE, np.roll(SINE, 9) + 1e-3 * NOISE[:8000]).checks() == ()


@pytest.mark.parametrize(("sign", "name"), [(1, "largest"), (-1, "smallest")])
def test_clipping(sign, name):
    response = sign * np.minimum(SINE + 1e-3 * NOISE[:8000], 0.9)
    (warning,) = record(SINE, response).checks()
    assert f"{name} value, {sign * 0.9:g} µm" in warning


def test_a_held_drive_or_coarse_codes_do_not_look_clipped():
    trapezoid = np.clip(2 * SINE, -1, 1)
    assert record(trapezoid, 40 * trapezoid**3).checks() == ()
    (warning,) = record(SINE, np.round(20 * SINE)).checks()
    assert "41 distinct values, about 1 µm apart" in warning


def test_few_samples_per_period():
    drive = np.sin(2 * np.pi * SAMPLES / 6)
    (warning,) = record(drive, dt=1e-3).checks()
    assert "near 167 Hz, has only 6.0 samples per period" in warning


# Many recordings at once --------------------------------------------------------------------------


def test_recordings_show_the_same_together_as_alone():
    """Spikes and grids, of two lengths; of the longer ones more than are taken at once."""
    generator = np.random.default_rng(11)
    spiked, coded, steep = SINE.copy(), np.round(SINE / 0.01) * 0.01, np.sign(SINE) * SINE**2
    spiked[[500, 2000, 2001, 7000]] += 3.0
    responses = [spiked, SINE, coded, steep, spiked + 0.01 * NOISE[:8000], coded + spiked - SINE]
    responses += [each[:900] for each in responses]
    order = generator.permutation(len(responses))
    alone = [record(np.arange(len(responses[k])), responses[k]) for k in order]
    together = [record(np.arange(len(responses[k])), responses[k]) for k in order]
    inspect_together(together)
    for one, other in zip(together, alone, strict=True):
        np.testing.assert_array_equal(one.spikes, other.spikes)
        assert one.resolution == other.resolution
    assert [int(each.spikes.sum()) for each in together if len(each) == 8000].count(4) == 3
    assert sum(each.resolution == pytest.approx(0.01) for each in together) == 4


def test_cusps_are_no_spikes():
    """|u̇| of a fast drive returns from each of its tips within a few samples."""
    times = 2e-3 * np.arange(4000)
    cusps = np.abs(np.cos(2 * np.pi * 11 * times)) + 0.2 * np.sin(2 * np.pi * 0.7 * times)
    cusps += 1e-3 * np.random.default_rng(3).standard_normal(times.size)
    assert not record(times, cusps, dt=2e-3).spikes.any()
    spiked = cusps.copy()
    spiked[[700, 1501, 1502, 3110]] += [0.4, -0.3, -0.3, 0.4]
    found = np.flatnonzero(record(times, spiked, dt=2e-3).spikes)
    assert found.tolist() == [700, 1501, 1502, 3110]


def test_a_channel_recorded_twice_is_said():
    twice = record(SINE, 3 * SINE + 1)
    assert any("repeats the drive sample by sample" in check for check in twice.checks())
    lagging = 3 * SINE + 0.01 * NOISE[: len(SINE)]
    assert not any("repeats" in check for check in record(SINE, lagging).checks())


def test_a_response_that_overflowed_is_said():
    moved = 1.3 * np.sin(2 * np.pi * SAMPLES / 200 - 0.1) + 0.001 * NOISE[: len(SAMPLES)]
    wrapped = (moved + 1) % 2 - 1
    (warning,) = [check for check in record(SINE, wrapped).checks() if "overflowed" in check]
    assert "jumps through its range" in warning
    # It overflows for two samples only where it turns: two jumps that are no spike.
    brief = (moved + 2 - np.sort(moved)[-400]) % 2
    checks = record(SINE, brief).checks()
    assert [check for check in checks if "overflowed" in check]
    assert not [check for check in checks if "spikes" in check]
    assert not any("overflowed" in check for check in record(SINE, moved).checks())
    square = np.sign(SINE) + 0.001 * NOISE[: len(SAMPLES)]
    assert not any("overflowed" in check for check in record(np.sign(SINE), square).checks())
