"""Nothing is lost or done twice: resumed, interrupted, killed."""

import os
import pickle
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest

import fracjax as fj
import fracjax._batch._rows
from fracjax._batch import FITS
from fracjax._batch._jobs import jobs_of
from tests.batch.helpers import OUT, batch, recording, save, told


def sources(calls: list[dict]) -> list[str]:
    return sorted(Path(call["source"]).name for call in calls)


def parts() -> list[Path]:
    return sorted((OUT / FITS).iterdir()) if (OUT / FITS).exists() else []


def test_the_same_call_again_does_nothing(data, quick):
    rows = batch(data, chunk=3)
    assert sources(quick) == [f"{k}.csv" for k in range(7)]
    before = {part: part.stat().st_mtime_ns for part in parts()}
    assert len(before) >= 2
    quick.clear()
    pd.testing.assert_frame_equal(batch(data, chunk=2), rows)
    assert quick == []
    assert {part: part.stat().st_mtime_ns for part in parts()} == before
    assert sorted(pd.read_parquet(OUT / FITS)["source"]) == sorted(rows["source"])


def test_only_what_is_new_changed_or_unfitted_is_done(data, quick, fitted, monkeypatch):
    (data / "5.csv").write_text("nonsense")
    batch(data, chunk=3)
    quick.clear()
    save(data / "1.csv", 100)
    os.utime(data / "2.csv")  # touched, not changed
    save(data / "8.csv", 8)
    rows = batch(data, chunk=3)
    assert sources(quick) == ["1.csv", "8.csv"]
    assert rows["status"].tolist() == [*["fitted"] * 5, "unreadable", *["fitted"] * 2]
    save(data / "5.csv", 5)
    quick.clear()
    rows = batch(data)
    assert sources(quick) == ["5.csv"]
    assert set(rows["status"]) == {"fitted"}
    assert pd.read_parquet(OUT / FITS)["key"].is_unique
    assert len(pd.read_parquet(OUT / FITS)) == 8


def test_rows_that_are_there_twice_are_made_one(data, quick):
    """As two calls at once would leave them."""
    batch(data, chunk=3)
    twice, *_ = parts()
    twice.with_name("copy.parquet").write_bytes(twice.read_bytes())
    count = pq.read_metadata(twice).num_rows
    quick.clear()
    assert len(batch(data)) == 7
    assert len(quick) == count
    assert sorted(pd.read_parquet(OUT / FITS)["key"]) == sorted(jobs_of(data, OUT))


def test_recordings_in_memory_are_known_by_name_and_content(quick):
    one, other = recording(0), recording(1)
    assert len(batch([one, other, one])) == 2
    assert len(quick) == 2
    _, second = told([recording(2), other])
    assert len(quick) == 3
    assert told([other]) == [second]
    assert len(quick) == 3


@pytest.mark.parametrize(
    ("model", "options", "said"),
    [
        ("creep", {"seed": 1}, r"\(seed: 0\), found others \(seed: 1\)"),
        ("creep", {"starts": 3}, "starts: 2.*starts: 3"),
        ("creep", {"history": "rest"}, "history: auto.*history: rest"),
        ("creep", {"settling": "1 s"}, "settling: auto.*settling: 1 s"),
        ("creep", {"fixed": {"mu": 0.01}}, r"fixed: not given.*fixed: \{'mu': 0.01\}"),
        ("creep", {"priors": {"mu": fj.Normal(0.01, 0.1)}}, "priors: not given.*priors: .*0.01"),
        ("creep", {"loss": "huber"}, "loss: not given.*loss: 'huber'"),
        ("creep", {"read_options": {"input": "voltage_V"}}, "input: not given.*input: voltage_V"),
        ("lfdh", {}, "model: creep.*model: lfdh"),
        (fj.Model(fj.blocks.Creep(mu=0.0072 + 1e-12)), {}, "model made by: name.*values"),
    ],
)
def test_other_settings_are_refused(quick, model, options, said):
    batch([recording(0)])
    before = parts()
    with pytest.raises(fj.InputError, match=f"fits.parquet: expected the settings.*{said}.*--out"):
        fj.fit_batch(model, [recording(1)], **{"out": OUT, "starts": 2} | options)
    assert parts() == before
    assert len(quick) == 1


def test_a_model_at_other_values_is_another_model(quick):
    fj.fit_batch(fj.Model(fj.blocks.Creep()), [recording(0)], out=OUT)
    with pytest.raises(fj.InputError, match="model's values"):
        fj.fit_batch(fj.Model(fj.blocks.Creep(mu=0.0072 + 1e-12)), [recording(0)], out=OUT)


def test_a_folder_of_other_tables_is_refused(quick):
    (OUT / FITS).mkdir(parents=True)
    pd.DataFrame({"a": [1.0]}).to_parquet(OUT / FITS / "other.parquet")
    with pytest.raises(fj.InputError, match="expected rows written by fracjax"):
        batch([recording(0)])
    (OUT / FITS / "other.parquet").write_bytes(b"PAR1 torn")
    with pytest.raises(fj.InputError, match="expected rows written by fracjax"):
        batch([recording(0)])


def test_what_is_half_written_is_passed_over_and_cleared_away(data, quick):
    (OUT / FITS).mkdir(parents=True)
    torn = OUT / FITS / ".0123.parquet.part"
    batch([recording(0)])
    torn.write_bytes(b"PAR1 torn")
    assert len(pd.read_parquet(OUT / FITS)) == 1
    batch(data)
    assert not torn.exists()


def test_an_interrupt_keeps_what_is_finished(data, quick):
    def interrupt(done, total):
        if done >= 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch(data, progress=interrupt)
    kept = {Path(source).name for source in pd.read_parquet(OUT / FITS)["source"]}
    assert len(kept) >= 3
    quick.clear()
    assert len(batch(data)) == 7
    # A fit that ran when the first call was interrupted may end, for nobody, beside the second's.
    assert set(sources(quick)) == {f"{k}.csv" for k in range(7)} - kept


def test_an_interrupt_while_writing_leaves_whole_parts(data, quick, monkeypatch):
    """At the worst moment, between a part's name and the note that it is written."""
    whole = Path.replace

    def interrupted(self, target):
        whole(self, target)
        monkeypatch.setattr(Path, "replace", whole)
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        batch(data, chunk=2)
    kept = pd.read_parquet(OUT / FITS)
    assert kept["key"].is_unique
    assert len(kept) >= 2
    quick.clear()
    assert len(batch(data)) == 7
    done = {Path(source).name for source in kept["source"]}
    # As above, a fit that was interrupted may end late.
    assert set(sources(quick)) == {f"{k}.csv" for k in range(7)} - done


def test_a_full_disk_tears_nothing(data, quick, monkeypatch):
    def full(descriptor):
        raise OSError(28, "No space left on device")

    batch([recording(0)])
    before = parts()
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        batch(data)
    assert parts() == before


KILLED = """
import pickle, sys, time
import fracjax._batch._batch, fracjax._batch._rows
from fracjax import fit_batch

fitted = pickle.load(open("fit.pickle", "rb"))

def fit(model, recording, **options):
    time.sleep(0.005)
    return fitted

fracjax._batch._rows.fit = fit
fracjax._batch._batch._MANY = 1000
fit_batch("creep", "data", out="results", starts=2, chunk=3)
"""


def test_kill_9_loses_no_part_and_does_nothing_twice(quick, fitted, monkeypatch):
    """Killed twice, each time at a moment of its own after the first part of that run."""
    # In a process of its own, a recording would be fitted in earnest.
    monkeypatch.setattr("fracjax._batch._batch._MANY", 1000)
    count = 240
    Path("fit.pickle").write_bytes(pickle.dumps(fitted))
    save(Path("data/0.csv"), 0)
    for k in range(1, count):
        Path(f"data/{k}.csv").write_bytes(Path("data/0.csv").read_bytes())
    moments = random.Random(5)
    for _ in range(2):
        before = len(parts())
        child = subprocess.Popen(
            [sys.executable, "-c", KILLED],
            env=os.environ | {"PYTHONPATH": str(Path(fj.__file__).parents[1])},
        )
        while child.poll() is None and len(parts()) <= before:
            time.sleep(0.01)
        time.sleep(moments.uniform(0, 0.2))
        child.kill()
        assert child.wait() == -signal.SIGKILL, "it ended before it was killed"
        assert pd.read_parquet(OUT / FITS)["key"].is_unique
    kept = len(pd.read_parquet(OUT / FITS))
    assert 6 <= kept < count
    rows = batch("data")
    assert len(quick) == count - kept
    assert len(rows) == len(pd.read_parquet(OUT / FITS)) == count
    assert {Path(source).name for source in rows["source"]} == {f"{k}.csv" for k in range(count)}
    assert all(part.suffix == ".parquet" and pq.read_table(part).num_rows for part in parts())


def test_rows_do_not_wait_long_to_be_written(data, quick, monkeypatch):
    monkeypatch.setattr("fracjax._batch._batch._PATIENCE", 0.0)
    batch(data)
    assert len(parts()) > 1
