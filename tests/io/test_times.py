"""When samples were taken: stamps, rates, resampling."""

import os
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fracjax._cli import run
from fracjax._io import _FORMATS, read, read_drive, read_segments, write
from fracjax._io._even import is_time
from fracjax._recording import InputError
from tests.io.layouts import (
    COUNT,
    DRIVE,
    LOOP,
    SIGNALS,
    TIME,
    refused,
    timed,
    with_value,
)


def test_resampling_follows_the_signal(tmp_path):
    jitter = np.random.default_rng(0).uniform(-0.2, 0.2, 2000)
    times = (np.arange(2000) + jitter) / 200 + 17
    recording = read(timed(tmp_path / "loop.csv", times), resample="200Hz")
    assert recording.rate == 200
    expected = times[0] + recording.times
    assert times[-1] - expected[-1] < 1 / 200
    bound = (2 * np.pi * np.diff(times).max()) ** 2 / 8
    for samples, wave in ((recording.drive, np.sin), (recording.response, np.cos)):
        error = np.abs(samples - wave(2 * np.pi * expected))
        assert error.max() < bound
        assert np.sqrt(np.mean(error**2)) < bound / 8
    (note,) = recording.warnings
    assert "resampled to 200 Hz by monotone cubics; the largest gap bridged is 0.00" in note
    assert "folds down" not in note
    (note,) = read(tmp_path / "loop.csv", resample=50).warnings
    assert "The file has about 200 Hz: what is faster than 25 Hz folds down" in note


def test_resampling_bridges_a_gap_and_says_how_much_it_invents(tmp_path):
    times = np.arange(400) / 200
    path = timed(tmp_path / "loop.h5", times[(times <= 0.5) | (times > 0.525)])
    with pytest.raises(
        InputError, match=r"sample 101: .* 0\.53 after 0\.5; .*200Hz, which invents 5 samples"
    ):
        read(path)
    recording = read(path, resample=200)
    assert len(recording) == 400
    (note,) = recording.warnings
    assert "the largest gap bridged is 0.03 s, 0.5 s after the first sample." in note
    assert "5 of 400 samples lie in gaps and were invented." in note
    kept = (times <= 0.5) | (times > 0.535)
    np.testing.assert_allclose(recording.drive[kept], np.sin(2 * np.pi * times[kept]), atol=1e-9)
    samples, step, _ = read_drive(path, resample="0.2 kHz")
    np.testing.assert_array_equal(samples, recording.drive)
    assert step == 1 / 200


def test_a_gap_of_more_than_ten_steps_parts_two_recordings(tmp_path):
    times = np.arange(400) / 200
    path = timed(tmp_path / "loop.h5", times[(times <= 0.5) | (times > 0.8)])
    for resample in (None, 200):
        with pytest.raises(InputError, match=r"one recording, found two segments of .*0.3.* s"):
            read(path, resample=resample)
        first, second = (each.recording for each in read_segments(path, resample=resample))
        assert (len(first), len(second)) == (101, 239)
        np.testing.assert_allclose(second.drive, np.sin(2 * np.pi * times[161:]), atol=1e-9)
        assert (first.source, second.source) == (
            f"{path}, segment 1 of 2",
            f"{path}, segment 2 of 2",
        )
        assert (
            "two segments of 0.505, 1.19 s with gaps of 0.305 s between them" in first.warnings[0]
        )
    assert len(read(path, segment=2)) == 239
    with pytest.raises(InputError, match="--segment: expected one from 1 to 2, found 3"):
        read(path, segment=3)


def test_resampling_of_uniform_samples(tmp_path):
    write(tmp_path / "loop.csv", LOOP)
    same = read(tmp_path / "loop.csv", resample=200)
    np.testing.assert_allclose(same.drive, DRIVE, rtol=0, atol=1e-12)
    write(tmp_path / "loop.npz", SIGNALS)
    finer = read(tmp_path / "loop.npz", rate=200, resample=400)
    np.testing.assert_allclose(finer.drive[::2], DRIVE, rtol=0, atol=1e-12)
    assert len(finer) == 2 * COUNT - 1


@settings(max_examples=60)
@given(
    st.lists(st.floats(-1e6, 1e6), min_size=40, max_size=40),
    st.lists(st.floats(1e-6, 1e3), min_size=39, max_size=39),
    st.floats(0.5, 50),
)
def test_resampling_invents_no_swing(values, steps, factor):
    values[0], values[1] = 0.0, 1.0
    times = np.concatenate([[0.0], np.cumsum(steps)])
    rate = factor * 40 / times[-1]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "loop.npz"
        write(path, {"t_s": times, "u_V": np.array(values), "y_um": times})
        try:
            recording = read(path, resample=rate)
        except InputError as error:
            assert re.search("a rate from|no gap of more than", str(error))
            return
    at = np.minimum(recording.times, times[-1])
    np.testing.assert_allclose(recording.response, at, rtol=1e-9, atol=1e-9)
    left = np.clip(np.searchsorted(times, at, side="right") - 1, 0, 38)
    pair = np.sort(np.c_[np.array(values)[left], np.array(values)[left + 1]], axis=1)
    slack = 1e-9 * np.ptp(values)
    assert (recording.drive >= pair[:, 0] - slack).all()
    assert (recording.drive <= pair[:, 1] + slack).all()


@pytest.mark.parametrize(
    ("times", "resample", "sentence"),
    [
        (with_value(TIME, TIME[15]), 200, "expected time to increase, found 0.075 after 0.075;"),
        (TIME[::-1].copy(), 200, "expected time to increase, found 0.31 after 0.315;"),
        (TIME**2, "5um", "--resample: expected a value in Hz"),
        (TIME**2, 0, "--resample: expected a positive rate"),
        (
            TIME**2,
            100,
            r"--resample: expected a rate from 322 Hz, .* to 6.45e\+04 Hz, .* found 100 Hz",
        ),
        (TIME + 3600 * (TIME > 0.1), 200, r"; split the file at its gap of 3600 s\."),
        (TIME**2, 1e9, r"--resample: expected a rate from .*; give one such as 6..\..Hz"),
    ],
)
def test_resampling_refuses(tmp_path, capfd, times, resample, sentence):
    path = tmp_path / "loop.npz"
    write(path, {**LOOP, "time_s": times})
    assert re.search(sentence, refused(path, capfd, resample=resample))


@pytest.mark.parametrize("form", ["{:.4f}", "{:.5g}", "{:.4e}"])
@pytest.mark.parametrize("suffix", _FORMATS)
def test_stamps_that_were_rounded(tmp_path, form, suffix):
    times = np.array([float(form.format(count / 300)) for count in range(2000)])
    path = timed(tmp_path / f"loop{suffix}", times)
    recording = read(path)
    assert recording.dt == pytest.approx(1 / 300, rel=1e-5)
    (note,) = recording.warnings
    assert "its stamps are rounded; a step of 0.00333333" in note
    gap = timed(path, times + (times > 3.001) / 300)
    with pytest.raises(
        InputError, match=r"expected a step of 0\.00333.* s, .*; give --resample 300Hz"
    ):
        read(gap)


def test_stamps_as_text_with_their_zeros(tmp_path):
    path = tmp_path / "loop.csv"
    rows = (f"{n / 300:.4f},{np.sin(n / 9)},{np.cos(n / 9)}" for n in range(900))
    path.write_text("time_s,voltage_V,displacement_um\n" + "\n".join(rows))
    assert read(path).dt == pytest.approx(1 / 300, rel=1e-5)


@pytest.mark.parametrize("start", [0, 40, 3000])
def test_stamps_in_single_precision(tmp_path, start):
    times = (start + np.arange(4000) / 1000).astype(np.float32)
    signal = np.sin(np.arange(4000) / 9)
    path = tmp_path / "loop.npz"
    np.savez(path, t=times, u=signal, y=signal)
    assert read(path).dt == pytest.approx(1e-3, rel=1e-4)


def test_stamps_since_1970(tmp_path):
    times = 1.7e9 + np.arange(4000) / 1e5
    signal = np.sin(np.arange(4000) / 9)
    write(tmp_path / "loop.npz", {"t": times, "u": signal, "y": signal})
    assert read(tmp_path / "loop.npz").dt == pytest.approx(1e-5, rel=1e-3)


@pytest.mark.parametrize("times", [np.arange(64) % 2, np.arange(64) > 62, np.arange(64) > 31])
def test_stamps_that_no_clock_shows(tmp_path, times):
    write(tmp_path / "loop.csv", {**LOOP, "time_s": times.astype(float)})
    for rate in (None, 0.1):
        with pytest.raises(InputError, match=r"expected (time to increase|a step of)"):
            read(tmp_path / "loop.csv", rate=rate)


def test_stamps_rounded_until_they_repeat(tmp_path):
    path = timed(tmp_path / "loop.csv", np.round(np.arange(1000) / 300, 2))
    times, drive, _ = np.loadtxt(path, delimiter=",", skiprows=1).T
    write(path, {"time_s": times, "voltage_V": drive, "displacement_um": np.arange(1000.0)})
    with pytest.raises(InputError, match=r"line 3,.* 0\.0 after 0\.0.*if .*, give --rate 300Hz"):
        read(path)
    assert read(path, rate="300Hz").dt == 1 / 300
    with pytest.raises(InputError, match=r"a step of 0\.01 s by --rate, found 0\.0033"):
        read(path, rate="100Hz")


@settings(max_examples=200)
@given(
    st.floats(0.3, 100),
    st.floats(-500, 500),
    st.integers(32, 300),
    st.integers(0, 6),
    st.integers(1, 298),
)
def test_rounding_explains_what_it_can_and_no_more(step, start, count, places, at):
    """Stamps of any step, in units of their last digit, pass; with one off by two digits, not."""
    digits = np.round(start + step * np.arange(count))
    if (np.diff(digits) <= 0).any():
        return
    times = np.array([float(f"{int(digit)}e-{places}") for digit in digits])
    assert is_time(times)
    digits[at % (count - 2) + 1] += 2
    off = np.array([float(f"{int(digit)}e-{places}") for digit in digits])
    assert is_time(off) == bool(
        (np.abs(np.diff(digits) / np.median(np.diff(digits)) - 1) < 1e-3).all()
    )


# The command line ---------------------------------------------------------------------------------


def test_info_of_a_resampled_recording(tmp_path, capsys):
    path = timed(tmp_path / "loop.tdms", np.cumsum(np.linspace(0.004, 0.006, 1000)))
    assert run(["info", str(path)]) == 2
    assert capsys.readouterr().err.endswith("give --resample 200Hz.\n")
    assert run(["info", str(path), "--resample", "200Hz"]) == 0
    out = capsys.readouterr().out
    assert "1000 at 200 Hz" in out
    assert "Warning: " in out


def test_simulate_knows_the_suffixes(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "")
    write(tmp_path / "loop.npz", LOOP)
    call = ["simulate", str(tmp_path / "loop.npz"), "--model", "creep"]
    assert run([*call, "--out", str(tmp_path / "loop.ods")]) == 2
    assert ": expected one of the suffixes .csv" in capsys.readouterr().err
    assert os.listdir(tmp_path) == ["loop.npz"]


@pytest.mark.parametrize("suffix", [".mat", ".parquet"])
def test_simulate_writes_what_the_suffix_tells(tmp_path, monkeypatch, suffix):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "")
    drive = timed(tmp_path / "loop.h5", np.cumsum(np.linspace(0.004, 0.006, 200)))
    out = tmp_path / f"simulated{suffix}"
    call = ["simulate", str(drive), "--resample", "200Hz", "--model", "creep", "--out", str(out)]
    assert run([*call, "--quiet"]) == 0
    assert read(out, input_unit="V").response_unit == "response units"
    assert run([*call, "--quiet", "--unit", "response=um"]) == 0
    simulated = read(out)
    np.testing.assert_array_equal(simulated.drive, read(drive, resample=200).drive)
    assert (simulated.drive_unit, simulated.response_unit) == ("V", "um")
