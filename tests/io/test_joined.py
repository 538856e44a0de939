"""Recordings taken one after the other, as one."""

from dataclasses import replace

import numpy as np
import pytest

import fracjax as fj
from fracjax._cli import run
from fracjax._recording import InputError, Recording

STEP, SIZE = 0.01, 400


def sine(first: int, seed: int = 0, **more) -> Recording:
    """A part of a sine that a gain follows, from a sample on."""
    times = STEP * np.arange(first, first + SIZE)
    drive = 50 + 40 * np.sin(2 * np.pi * times)
    noise = 0.01 * np.random.default_rng(seed).standard_normal(SIZE)
    return Recording(drive, 0.1 * drive + noise, STEP, "V", "um", **more)


def masked_in(recording: Recording) -> np.ndarray:
    """The samples that do not count."""
    return np.flatnonzero([] if recording.masked is None else recording.masked)


def stamped(folder, name: str, recording: Recording, began: str) -> str:
    """A file of the recording with dates and times."""
    moments = np.datetime64(began, "ns") + (recording.times * 1e9).round().astype("timedelta64[ns]")
    rows = zip(moments, recording.drive, recording.response, strict=True)
    path = folder / name
    text = "\n".join(f"{t},{u:.9g},{y:.9g}" for t, u, y in rows)
    path.write_text(f"time,drive (V),response (um)\n{text}\n")
    return str(path)


def test_a_pause_counts_for_nothing_and_the_drive_goes_on():
    one, two = sine(0), sine(1000, 1)
    whole = fj.joined([one, two], "6.01 s")
    assert len(whole) == SIZE + 600 + SIZE
    assert np.array_equal(masked_in(whole), np.arange(SIZE, SIZE + 600))
    pause = whole.drive[SIZE - 1 : SIZE + 601]
    np.testing.assert_allclose(np.diff(pause), (two.drive[0] - one.drive[-1]) / 601, atol=1e-12)
    np.testing.assert_array_equal(whole.response[-SIZE:], two.response)
    assert "of 6.01 s, count for no fit" in whole.warnings[-1]


def test_without_a_pause_it_is_what_one_recording_would_be():
    one, two = sine(0), sine(SIZE)
    whole = fj.joined([one, two], STEP)
    assert whole.masked is None
    np.testing.assert_array_equal(whole.drive, np.concatenate([one.drive, two.drive]))


def test_stamps_tell_the_order_and_the_pauses(tmp_path):
    late = stamped(tmp_path, "a.csv", sine(0), "2026-03-01T10:00:30")
    early = stamped(tmp_path, "b.csv", sine(0, 1), "2026-03-01T10:00:20")
    recordings = [fj.read(late), fj.read(early)]
    moments = [np.datetime64("2026-03-01T10:00:30"), np.datetime64("2026-03-01T10:00:20")]
    assert [each.began for each in recordings] == [float(m.astype(int)) for m in moments]
    whole = fj.joined(recordings)
    np.testing.assert_array_equal(whole.drive[:SIZE], recordings[1].drive)
    assert masked_in(whole).size == round((10 - STEP * SIZE) / STEP)


def test_segments_of_one_file_know_their_pause(tmp_path):
    times = np.concatenate([STEP * np.arange(SIZE), 9 + STEP * np.arange(SIZE)])
    drive = 50 + 40 * np.sin(2 * np.pi * times)
    path = tmp_path / "two.csv"
    table = np.column_stack([times, drive, 0.1 * drive + 0.01 * np.sin(99 * times)])
    np.savetxt(path, table, "%.9g", ",", header="time (s),drive (V),response (um)", comments="")
    whole = fj.joined([fj.read(path, segment=k) for k in (1, 2)])
    assert masked_in(whole).size == round((9 - STEP * SIZE) / STEP)


def test_what_is_worn_stays_worn_from_one_file_to_the_next(tmp_path):
    """A gain that falls with the path travelled: two files fitted as two would each begin anew."""
    law, (one, two) = fj.parse_model("gain >> degradation"), (sine(0), sine(SIZE, 1))
    drive = np.concatenate([one.drive, two.drive])
    values = {"first.k": 0.1, "second.gain": -0.2, "second.path": 4.0, "second.zero": 5.0}
    worn = fj.simulate(law.with_values(values), drive, STEP, "constant").response
    noise = 0.005 * np.random.default_rng(3).standard_normal(drive.size)
    parts = [
        Recording(each.drive, response, STEP, "V", "um")
        for each, response in zip((one, two), np.split(worn + noise, 2), strict=True)
    ]
    apart = fj.fit("gain >> degradation", parts)
    whole = fj.fit("gain >> degradation", fj.joined(parts, STEP))
    rms = [np.sqrt(np.nanmean(np.concatenate(each.residuals) ** 2)) for each in (whole, apart)]
    assert rms[0] == pytest.approx(0.005, rel=0.1)
    assert rms[1] > 2 * rms[0]


@pytest.mark.parametrize(
    ("recordings", "pauses", "expected"),
    [
        ([sine(0)], "1 s", "two or more"),
        (sine(0), "1 s", "two or more"),
        (["a.csv", "b.csv"], "1 s", "read a file by"),
        ([sine(0), sine(0)], "-1 s", "times of 0 s or more"),
        ([sine(0), sine(0)], "1 V", "expected a value in s"),
        ([sine(0), sine(0)], "1 s, 2 s", "one between each two"),
        ([sine(0), sine(0)], "1000 s", "each then begins anew"),
        ([sine(0), sine(0)], "stamps", "say the pauses"),
        ([sine(0, began=0.0), sine(0, began=1.0)], "stamps", "after the end of"),
        (
            [sine(0), Recording(sine(0).drive, sine(0).response, 0.02, "V", "um")],
            "1 s",
            "--resample 100Hz",
        ),
        ([sine(0), replace(sine(0), response_unit="mm")], "1 s", "um"),
    ],
)
def test_what_cannot_be_one_is_refused(recordings, pauses, expected):
    with pytest.raises(InputError, match=expected):
        fj.joined(recordings, pauses)


def test_a_command_takes_pauses(tmp_path):
    files = [stamped(tmp_path, f"{k}.csv", sine(0, k), f"2026-03-01T10:0{k}:00") for k in (0, 1)]
    call = ["fit", *files, "--model", "gain", "--out", str(tmp_path / "out"), "--pauses", "2 s"]
    assert run(call) == 0
    assert "0.csv + " in (tmp_path / "out" / "fit.json").read_text()
