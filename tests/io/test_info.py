"""What is as_model of a recording before anything is fitted to it."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import chirp, lfilter

from fracjax._cli import run
from fracjax._io import read, read_segments, write
from fracjax._prepare import prepare
from fracjax._recording import Recording
from fracjax._report._description import describe, loop_opening
from fracjax._report._doubts import doubts_about
from fracjax._report._drive_kind import KINDS, kind_of_drive

DEMO = Path(__file__).resolve().parents[2] / "fracjax" / "_demo" / "training.csv"
STEP = 0.01
TIMES = STEP * np.arange(1000)
TURNS = 2 * np.pi * TIMES
GENERATOR = np.random.default_rng(0)
BITS = GENERATOR.integers(0, 2, 20)
PHASES = GENERATOR.uniform(0, 2 * np.pi, 24)


def recording_of(drive: np.ndarray, step: float = STEP) -> Recording:
    """A drive and a response that follows it."""
    return Recording(drive, np.asarray(lfilter([0.3], [1, -0.7], drive)), step)


def noisy(signal: np.ndarray, share: float) -> np.ndarray:
    """A signal with white noise of a share of its range."""
    noise = np.random.default_rng(1).normal(0, share * np.ptp(signal), signal.size)
    return signal + noise


# The kind of drive --------------------------------------------------------------------------------

DRIVES = {
    "sine": ("sine", np.sin(TURNS)),
    "sine between samples": ("sine", 5 + np.sin(0.73 * TURNS)),
    "fast sine": ("sine", np.sin(5.3 * TURNS)),
    "sine after a rest": ("sine", np.where(TIMES < 2, 0, np.sin(1.3 * (TURNS - 4 * np.pi)))),
    "triangle": ("triangle", np.abs((TIMES + 0.003) % 1 - 0.5)),
    "triangle between samples": ("triangle", np.abs(0.63 * TIMES % 1 - 0.5)),
    "staircase": ("steps", np.floor(TIMES) % 3),
    "square": ("steps", np.sign(np.sin(1.3 * TURNS + 0.1))),
    "one step": ("steps", np.where(TIMES > 2, 1.0, 0.0)),
    "binary": ("steps", np.repeat(BITS, 50).astype(float)),
    "steps through a lag": ("steps", lfilter([0.5], [1, -0.5], np.floor(TIMES) % 3)),
    "few lines": ("multisine", sum(np.sin(k * TURNS + k * k) for k in (1, 3, 7))),
    "many lines": ("multisine", sum(np.cos((k + 1) * TURNS + p) for k, p in enumerate(PHASES))),
    "two periods of many lines": (
        "multisine",
        sum(np.cos(0.2 * (k + 1) * TURNS + p) for k, p in enumerate(PHASES)),
    ),
    "linear sweep": ("chirp", chirp(TIMES, 0.2, 10, 5)),
    "logarithmic sweep": ("chirp", chirp(TIMES, 0.3, 10, 5, method="logarithmic")),
    "sweep down": ("chirp", chirp(TIMES, 4, 10, 0.3)),
    "repeated sweep": ("chirp", np.tile(chirp(TIMES[:250], 1, 2.5, 4), 4)),
    "ramp": ("other", TIMES),
    "decay": ("other", np.exp(-0.3 * TIMES) * np.sin(TURNS)),
    "sines in turn": ("other", np.concatenate([np.sin(f * TURNS[:250]) for f in (1, 2, 4, 8)])),
    "two sines": ("other", np.sin(TURNS) + 0.5 * np.sin(np.sqrt(2) * TURNS)),
    "noise": ("other", np.random.default_rng(2).normal(size=1000)),
    "repeated noise": ("other", np.tile(np.random.default_rng(3).normal(size=100), 10)),
    "walk": ("other", np.cumsum(np.random.default_rng(4).normal(size=1000))),
}


@pytest.mark.parametrize("noise", [0.0, 0.001, 0.01])
@pytest.mark.parametrize("name", DRIVES)
def test_kinds_of_drive(name, noise):
    kind, drive = DRIVES[name]
    assert kind_of_drive(recording_of(noisy(np.asarray(drive, float), noise))) == kind


@given(
    st.sampled_from([name for name in DRIVES if name not in ("noise", "walk")]),
    st.floats(1e-6, 1e6),
    st.floats(-1e3, 1e3),
    st.floats(1e-6, 1e3),
)
def test_the_kind_knows_neither_unit_nor_offset_nor_rate(name, gain, offset, step):
    kind, drive = DRIVES[name]
    moved = gain * (noisy(np.asarray(drive, float), 1e-3) + offset)
    assert kind_of_drive(recording_of(moved, step)) == kind


def test_a_drive_that_never_moves_is_a_rest_and_what_it_is_good_for_is_said():
    rest = Recording(np.full(500, 3.0), np.random.default_rng(5).normal(size=500), STEP, "V")
    told = describe(rest)
    assert (told["drive"]["kind"], told["drive"]["top_frequency_Hz"]) == ("rest", None)
    assert told["noise"]["sigma"] == pytest.approx(1, rel=0.1)
    (warning,) = told["warnings"]
    assert "constant at 3 V: such a rest" in warning
    assert "--input" in warning


@given(st.lists(st.floats(-1, 1), min_size=32, max_size=200))
def test_any_drive_is_of_some_kind(values):
    drive = np.asarray(values)
    if np.ptp(drive) > 1e-9:
        assert kind_of_drive(Recording(drive, np.sin(np.arange(drive.size)), STEP)) in KINDS


@pytest.mark.parametrize(
    ("name", "columns", "kind"),
    [
        ("piezo_dbo/Model_Vi_Do.dat", {"input": 0, "output": 4, "rate": 200}, "sine"),
        ("piezo_dbo/Test_Vi_Do_Di.dat", {"input": 0, "output": 4, "rate": 200}, "other"),
        (
            "mr_damper/ensaio1.2.mat",
            {"input": "dist", "output": "forc", "input_unit": "mm", "output_unit": "N"},
            "sine",
        ),
    ],
)
def test_kinds_of_real_drives(data_folder, name, columns, kind):
    recording = read(data_folder / name, **columns)
    assert kind_of_drive(recording) == kind
    assert not any("missing" in doubt for doubt in doubts_about(recording))


def test_two_periods_of_the_mirror_are_a_multisine(data_folder):
    folder = data_folder / "fsm_cubespec"
    drive, response = (np.load(folder / f"{s}_100mV_test.npy")[:, 0, 0].T.ravel() for s in "uy")
    recording = Recording(drive, response, 1 / 6400)
    assert kind_of_drive(recording) == "multisine"
    assert not any("missing" in doubt for doubt in doubts_about(recording))


# What may be lost ---------------------------------------------------------------------------------


def doubt(recording: Recording, word: str) -> str | None:
    return next((text for text in doubts_about(recording) if word in text), None)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("missing", [1, 3, 20])
def test_missing_samples_are_found(missing, noise):
    times = np.delete(STEP * np.arange(1200), slice(500, 500 + missing))
    drive = noisy(np.sin(0.8 * np.pi * times), noise)
    told = doubt(Recording(drive, noisy(np.sin(0.8 * np.pi * times - 0.2), noise), STEP), "missing")
    assert told is not None
    assert f"at 1 place(s), first at {500 * STEP:g} s" in told


def test_samples_held_are_found():
    drive, response = np.sin(TURNS), np.sin(TURNS - 0.2)
    drive[205:207], response[205:207] = drive[204], response[204]
    told = doubt(Recording(drive, response, STEP), "held")
    assert told is not None
    assert "first at 2.05 s" in told


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("name", DRIVES)
def test_no_sample_is_missed_where_none_is_missing(name, noise):
    drive = noisy(np.asarray(DRIVES[name][1], float), noise)
    assert doubt(recording_of(drive), "missing") is None


def test_a_jump_of_the_response_alone_is_no_missing_sample():
    response = np.sin(TURNS - 0.2) + 0.2 * (TIMES > 5)
    assert doubt(Recording(np.sin(TURNS), response, STEP), "missing") is None


@pytest.mark.parametrize(
    ("begins", "drive", "response"),
    [
        ("at rest", np.where(TIMES < 1, 0, np.sin(TURNS)), None),
        ("in a steady cycle", np.sin(TURNS), np.sin(TURNS - 0.2)),
        ("in motion", np.sin(TURNS), None),
        ("in motion", chirp(TIMES, 0.2, 10, 5, phi=90), None),
    ],
)
def test_a_beginning_in_motion_is_told(begins, drive, response):
    if response is None:  # it still remembers how it began
        response = np.asarray(lfilter([0.02], [1, -0.98], drive))
    told = doubt(Recording(drive, noisy(response, 1e-3), STEP), "baseline")
    assert (told is not None) == (begins == "in motion")


# The loop and the table ---------------------------------------------------------------------------


@pytest.mark.parametrize("lag", [0.02, 0.3])
def test_loop_opening_of_an_ellipse(lag):
    recording = Recording(np.sin(TURNS), np.sin(TURNS - lag), STEP)
    assert loop_opening(recording) == pytest.approx(100 * np.sin(lag), rel=2e-3)


def test_a_recording_without_repeats_says_so():
    told = describe(recording_of(np.sin(2 * np.pi * TIMES**2)))
    assert (told["period"], told["loop_opening_percent"]) == (None, None)
    json.dumps(told, allow_nan=False)


def test_the_columns_that_were_read(tmp_path):
    signals = {"i": TIMES**0, "time_ms": 1e3 * TIMES, "u_V": np.sin(TURNS), "y_um": np.cos(TURNS)}
    write(tmp_path / "named.csv", signals)
    found = read_segments(tmp_path / "named.csv")[0].columns
    assert found == {"time": "time_ms", "input": "u_V", "output": "y_um"}
    np.savetxt(tmp_path / "nameless.dat", np.stack([TIMES**0, *list(signals.values())[2:]], axis=1))
    found = read_segments(tmp_path / "nameless.dat", input=1, output=2, rate=100)[0].columns
    assert found == {"input": 1, "output": 2}


def test_all_that_is_told(tmp_path, capsys):
    drive = 50 - 45 * np.cos(TURNS)
    response = np.clip(0.1 * noisy(50 - 45 * np.cos(TURNS - 0.2), 1e-3), 0.55, 9.3)
    path = tmp_path / "loop.csv"
    write(path, {"time_s": TIMES, "voltage_V": drive, "displacement_um": response})
    assert run(["info", str(path)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    for said in (
        "time: time_s; drive: voltage_V [V]; response: displacement_um [um]",
        "1000 at 100 Hz, 10 s",
        "drive sine, 5 to 95 V, up to",
        "period 1 s, 10 repeats from 0 to 10 s",
        "loop opening 2",
        "% of the stroke",
        "noise floor 0.00",
        "from repeats",
        "Warning: The response stays at its largest value",
    ):
        assert said in text
    assert run(["info", str(path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["schema"] == "fracjax.info/1"
    assert told["time"] == {"column": "time_s"}
    assert told["drive"] | {"top_frequency_Hz": 0} == {
        "column": "voltage_V",
        "unit": "V",
        "low": pytest.approx(5),
        "high": pytest.approx(95),
        "kind": "sine",
        "top_frequency_Hz": 0,
    }
    assert told["period"]["repeats"] == 10


def test_the_demonstration_is_understood(capsys):
    assert run(["info", str(DEMO), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["samples"], told["rate_Hz"]) == (3900, pytest.approx(150))
    assert told["noise"]["method"] == "static"
    assert told["warnings"] == []


def test_few_samples_per_period_are_told(tmp_path, capsys):
    drive = np.sin(15 * TURNS)
    write(tmp_path / "loop.csv", {"time_s": TIMES, "voltage_V": drive, "y_um": drive + 1})
    assert run(["info", str(tmp_path / "loop.csv")]) == 0
    assert "at least 10 are needed to follow its loop" in capsys.readouterr().out


@pytest.mark.parametrize(("edge", "is_told"), [(1, True), (12, False)])
def test_edges_between_samples_are_told(edge, is_told):
    steps = np.repeat([0.0, 60.0, 20.0, 90.0], 500)
    drive = np.convolve(np.pad(steps, 10, mode="edge"), np.ones(edge) / edge, "same")[10:-10]
    drive = np.convolve(drive, np.ones(edge) / edge, "same")
    told = [warning for warning in recording_of(drive).checks() if "edge(s)" in warning]
    assert bool(told) == is_told
    assert all("3 edge(s)" in warning for warning in told)


def test_how_it_begins_does_not_depend_on_how_many_cycles_follow():
    for count in (4, 10, 40):
        times = np.arange(500 * count) / 500
        drive = 50 - 50 * np.cos(2 * np.pi * times)
        assert doubt(Recording(drive, drive + np.exp(-times), 1 / 500), "baseline") is None


def test_rests_do_not_overlap():
    """Two rests a small step apart are no longer than both together."""
    for seed in range(40):
        generator = np.random.default_rng(seed)
        levels = np.repeat(generator.integers(0, 3, 40).astype(float), 90)
        noise = generator.choice([0, 1e-4, 3e-4]) * generator.standard_normal(levels.size)
        drive = levels + noise + 2e-3 * np.linspace(0, 1, levels.size)
        rests = recording_of(drive).static_stretches()
        assert all(stop <= start for (_, stop), (start, _) in pairwise(rests))
        assert sum(stop - start for start, stop in rests) <= drive.size


def test_what_is_left_out_is_no_part_of_what_is_told():
    drive = np.tile(np.sin(2 * np.pi * np.arange(250) / 250), 4)
    response = noisy(np.asarray(lfilter([0.3], [1, -0.7], drive)), 1e-3)
    spoilt, bad = response.copy(), np.zeros(drive.size, bool)
    bad[[3, 130, 400, 777]] = True
    spoilt[bad] = [50, -30, 0, 80]
    clean, left_out = (Recording(drive, each, STEP, masked=bad) for each in (response, spoilt))
    assert loop_opening(left_out) == loop_opening(clean)
    assert np.array_equal(left_out.response, clean.response)
    (kept,) = prepare([left_out]).takes
    assert kept.noise is not None
    assert kept.noise.sigma == pytest.approx(1e-3 * np.ptp(response), rel=0.2)
    assert kept.noise.method == "repeats"
