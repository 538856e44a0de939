"""Batches: the results of `fit`, bad recordings as rows, and nothing lost or done twice."""

import io
import json
import os
import pickle
import random
import signal
import subprocess
import sys
import threading
import time
import types
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from distributed import Client, LocalCluster, WorkerPlugin

import fracjax as fj
import fracjax._batch._rows
from fracjax._batch import FITS
from fracjax._batch._cluster import on_cluster
from fracjax._batch._jobs import File, Held, jobs_of
from fracjax._batch._parts import Parts
from fracjax._batch._processes import in_processes
from fracjax._batch._rows import Work, row_of
from fracjax._cli import run
from fracjax._io import write_text
from fracjax._parameters import replace_parameters
from tests.helpers import failure

STEP = 0.01
OUT = Path("results")
pytestmark = pytest.mark.usefixtures("empty_folder")


def signals(seed: int, samples: int = 250) -> tuple[np.ndarray, np.ndarray]:
    """A drive [V] that does not repeat, and a response [um] that lags behind it, with noise."""
    times = STEP * np.arange(samples)
    drive = 40 + 15 * np.sin(3.1 * times) + 10 * np.sin(8.3 * times + seed)
    noise = np.random.default_rng(seed).normal(0, 0.02, samples)
    return drive, 0.1 * drive - 2e-3 * np.gradient(drive, STEP) + noise


def recording(seed: int, samples: int = 250, source: str = "recording") -> fj.Recording:
    return fj.Recording(*signals(seed, samples), STEP, source=source)


def save(path: Path, seed: int, samples: int = 250) -> Path:
    drive, response = signals(seed, samples)
    columns = {"time_s": STEP * np.arange(samples), "voltage_V": drive}
    path.parent.mkdir(exist_ok=True)
    write_text(path, columns | {"displacement_um": response})
    return path


def batch(recordings, **options) -> pd.DataFrame:
    return fj.fit_batch("creep", recordings, **{"out": OUT, "starts": 2} | options)


def told(recordings, **options) -> list[dict[str, Any]]:
    """The rows of a batch, one by one."""
    return [
        {str(k): v for k, v in row.items()}
        for row in batch(recordings, **options).to_dict("records")
    ]


def cheap_model() -> fj.Model:
    """Creep of a known order, which is quick to compile."""
    order = fj.Parameter(0.0072, fixed=True)
    return fj.Model(replace_parameters(fj.blocks.Creep(), {"mu": order}))


@pytest.fixture(scope="module")
def fitted() -> fj.Fit:
    return fj.fit(fj.parse_model("creep"), recording(0), starts=2)


@pytest.fixture
def quick(monkeypatch, fitted) -> list[dict]:
    """Fits that take no time, and what they were called with."""
    calls: list[dict] = []

    def fit(model, recording, **options):
        calls.append({"model": model, "source": recording.source, **options})
        return fitted

    monkeypatch.setattr(fracjax._batch._rows, "fit", fit)
    return calls


def sources(calls: list[dict]) -> list[str]:
    return sorted(Path(call["source"]).name for call in calls)


def parts() -> list[Path]:
    return sorted((OUT / FITS).iterdir()) if (OUT / FITS).exists() else []


# The results are those of fit ---------------------------------------------------------------------


def test_rows_are_fits_to_the_last_bit():
    recordings = [recording(k, 232 + 6 * k, f"number {k}") for k in range(4)]
    rows = batch(recordings)
    assert list(rows["source"]) == ["number 0", "number 1", "number 2", "number 3"]
    assert set(rows["status"]) == {"fitted"}
    for given, row in zip(recordings, rows.to_dict("records"), strict=True):
        expected = fj.fit(fj.parse_model("creep"), given, starts=2).to_dict()
        for name, estimate in expected["parameters"].items():
            assert {key: row[f"{name}.{key}"] for key in estimate} == estimate
        for name, score in expected["scores"].items():
            assert row[name] == score
        assert row["offset"] == expected["offsets"][0]
        assert (row["noise_sigma"], row["noise_method"]) == (
            expected["noise"]["sigma"],
            expected["noise"]["method"],
        )
        assert row["history"] == expected["assumptions"][0]["history"]
        assert (row["samples"], row["step_s"]) == (len(given), STEP)
        assert (row["drive_unit"], row["response_unit"]) == ("V", "um")


def test_a_program_serves_a_bucket_of_lengths(monkeypatch):
    """After one recording of each of two buckets nothing is traced, let alone compiled, again."""
    law, traced = fj.blocks.Creep, []
    whole = law.symbol

    def counted(self, s):
        traced.append(1)
        return whole(self, s)

    monkeypatch.setattr(law, "symbol", counted)
    fj.fit_batch(cheap_model(), [recording(0, length) for length in (50, 60)], out=OUT, starts=1)
    first = len(traced)
    assert first > 0
    lengths = (49, 51, 52, 53, 57, 58, 61, 62)
    rows = fj.fit_batch(
        cheap_model(), [recording(0, length) for length in lengths], out=OUT, starts=1
    )
    assert len(traced) == first
    assert list(rows["samples"]) == list(lengths)


def test_precision_is_left_alone(float32_default):
    import jax.numpy as jnp

    (row,) = told([recording(0)])
    assert jnp.ones(1).dtype == np.float32
    found = fj.fit(fj.parse_model("creep"), recording(0), starts=2)
    assert row["rmse"] == found.scores.rmse


# What is fitted, and how --------------------------------------------------------------------------


def test_files_folders_and_patterns(quick):
    for name in ("data/a.csv", "data/b.txt", "more/c.csv", "more/d.csv", "e.csv"):
        save(Path(name), 1)
    Path("data/notes.md").write_text("no recording")
    rows = batch(["data", "more/*.csv", "e.csv", Path("data/a.csv")])
    assert [Path(source).name for source in rows["source"]] == [
        "a.csv",
        "b.txt",
        "c.csv",
        "d.csv",
        "e.csv",
    ]
    assert all(Path(source).is_absolute() for source in rows["source"])


def test_the_table_itself_is_no_recording(quick):
    save(Path("a.csv"), 1)
    save(Path(FITS) / "b.csv", 2)
    assert list(jobs_of(".", Path(FITS))) == [str(Path("a.csv").resolve())]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("data", r"data: expected files in \.csv.*found none"),
        ("data/*.csv", r"data/\*\.csv: expected a pattern that meets files, found none"),
        ([], "recordings: expected at least one, found none"),
    ],
)
def test_paths_that_lead_nowhere_are_refused(given, said):
    Path("data").mkdir()
    with pytest.raises(fj.InputError, match=said):
        batch(given)
    assert not OUT.exists()


def test_options_reach_every_fit(quick):
    slow = replace(recording(0), dt=0.02, source="slow")
    batch([recording(0), slow], history="rest", settling="100 ms", starts=3, seed=7)
    assert sorted(call["source"] for call in quick) == ["recording", "slow"]
    for call in quick:
        told = (call["history"], call["settling"], call["starts"], call["seed"])
        assert told == ("rest", "100 ms", 3, 7)


def test_what_is_asked_reaches_every_fit_and_the_columns(quick):
    prior = fj.Normal(0.01, 0.1)
    asked: dict[str, Any] = {"fixed": {"k_c": 0.1}, "priors": {"mu": prior}, "loss": "huber"}
    (row,) = told([recording(0)], mask=[(0.1, 0.2)], **asked)
    (call,) = quick
    assert {name: call[name] for name in asked} == asked
    assert call["mask"] == [(0.1, 0.2)]
    assert {"mu.value"} == {name for name in row if name.endswith(".value")}


def test_a_held_parameter_is_held_in_a_batch():
    (row,) = told([recording(0)], bounds={"mu": (0.01, 0.02)})
    assert row["mu.value"] == pytest.approx(0.02)
    assert row["mu.at_bound"]
    expected = fj.fit(fj.parse_model("creep"), recording(0), starts=2, bounds={"mu": (0.01, 0.02)})
    assert row["rmse"] == expected.scores.rmse


def test_a_name_is_made_a_model_for_each_recording(quick):
    save(Path("a.csv"), 1)
    large = replace(recording(0), response=100 * recording(0).response, source="large")
    fj.fit_batch("creep + mains_interference", [recording(0), large], out=OUT)
    sizes = {c["source"]: c["model"].parameters["second.cosines"].value.max() for c in quick}
    assert sizes["large"] == pytest.approx(100 * sizes["recording"])


def test_reading_options_reach_the_reader(quick):
    drive, response = signals(0)
    text = "\n".join(f"{y} {u}" for u, y in zip(drive, response, strict=True))
    Path("plain.dat").write_text(text)
    (row,) = told("plain.dat", read_options={"input": 1, "output": 0, "rate": "200Hz"})
    assert (row["status"], row["step_s"]) == ("fitted", 0.005)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"fixed": {"nu": 1.0}}, 'parameter "nu": expected one of k_c, mu, found none'),
        ({"tied": {"mu": "nu"}}, 'parameter "nu": expected one of'),
        ({"loss": "cauchy"}, "cauchy"),
        ({"settling": "9 um"}, "--settle: expected a value in s"),
        ({"cluster": "nonsense"}, "--cluster nonsense: expected a dask scheduler"),
        ({"cluster": "tcp://127.0.0.1:9"}, "--cluster tcp://127.0.0.1:9: .*connection refused"),
    ],
)
def test_calls_that_cannot_be_used(options, said):
    with pytest.raises(fj.InputError, match=said):
        batch([recording(0)], **options)
    assert not OUT.exists()


def test_a_cluster_needs_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(fj.InputError, match=r'pip install "fracjax\[cluster\]"'):
        batch([recording(0)], cluster="tcp://127.0.0.1:8786")


# Recordings that fail -----------------------------------------------------------------------------

GOOD = "\n".join(f"{STEP * n:.2f},{np.sin(n)},{np.cos(n)}" for n in range(60))
HEAD = "time_s,voltage_V,displacement_um\n"
BAD = {
    "empty.csv": ("", "expected rows of numbers, found an empty file"),
    "short.csv": (HEAD + "\n".join(GOOD.split("\n")[:9]), "expected at least 32 samples, found 9"),
    "cell.csv": (HEAD + GOOD.replace("0.10,", "oops,"), "line 12"),
    "gap.csv": (HEAD + GOOD.replace("0.30,", "0.304,"), "expected a step of 0.01 s"),
    "columns.csv": (GOOD.replace(",", ",7,").replace(",7,", ",", 1), "column"),
    "unit.csv": (HEAD.replace("_um", " [wibble]") + GOOD, "wibble"),
    "binary.csv": ("\x00\x01\x02", "expected text, found binary data"),
}


def test_every_bad_recording_is_a_row_with_its_reason(quick):
    for name, (text, _) in BAD.items():
        Path(name).write_text(text)
    save(Path("good.csv"), 1)
    rows = {Path(row["source"]).name: row for row in told([*BAD, "none.csv", "good.csv"])}
    for name, (_, said) in [*BAD.items(), ("none.csv", ("", "found no such file"))]:
        row = rows[name]
        assert row["status"] == "unreadable", name
        assert said in row["reason"]
        assert "\n" not in row["reason"]
        assert row["samples"] == 0
        assert np.isnan(row["mu.value"])
    assert (rows["good.csv"]["status"], rows["good.csv"]["reason"]) == ("fitted", "")


def test_a_rest_can_be_read_and_holds_nothing_to_fit():
    rest = "\n".join(f"{STEP * n:.2f},5,{np.cos(n)}" for n in range(60))
    Path("rest.csv").write_text(HEAD + rest)
    (row,) = told(["rest.csv"])
    assert (row["status"], row["samples"]) == ("failed", 60)
    assert "rest.csv, drive: expected a signal that varies, found the constant 5" in row["reason"]


def test_a_fit_that_fails_is_a_row_with_its_reason(quick, fitted, monkeypatch):
    def fit(model, recording, **options):
        if recording.source == "breaks":
            raise FloatingPointError("the ground\ngave way")
        return replace(fitted, converged=recording.source != "wanders")

    monkeypatch.setattr(fracjax._batch._rows, "fit", fit)
    names = ["breaks", "wanders", "holds"]
    breaks, wanders, holds = told([recording(0, source=name) for name in names])
    assert (breaks["status"], wanders["status"]) == ("failed", "not converged")
    assert holds["status"] == "fitted"
    assert breaks["reason"] == "FloatingPointError: the ground gave way"
    assert "did not converge" in wanders["reason"]
    assert [np.isfinite(row["rmse"]) for row in (breaks, wanders, holds)] == [False, True, True]
    assert [row["converged"] for row in (breaks, wanders, holds)] == [False, False, True]


def test_too_long_a_settling_time_is_said_of_the_recording_it_concerns():
    short, long = told([recording(0, 40, "short"), recording(0)], settling="0.5 s")
    assert (short["status"], long["status"]) == ("failed", "fitted")
    assert "short, --settle: expected a time from 0 to 0.08 s" in short["reason"]


UNITS = """
import sys
from concurrent.futures import ThreadPoolExecutor
from fracjax._recording import parse_quantity

sys.setswitchinterval(1e-5)
with ThreadPoolExecutor(16) as pool:
    print(set(pool.map(lambda _: parse_quantity("3 um", "mm"), range(64))))
"""


def test_many_threads_may_ask_for_the_first_unit():
    """pint reads its definitions on first use, and is no use to a second thread meanwhile."""
    env = os.environ | {"PYTHONPATH": str(Path(fj.__file__).parents[1])}
    child = [sys.executable, "-c", UNITS]
    run = subprocess.run(child, env=env, capture_output=True, text=True, check=False)
    assert run.stdout == "{0.003}\n", run.stderr


# Nothing lost, nothing twice ----------------------------------------------------------------------


@pytest.fixture
def data() -> Path:
    for k in range(7):
        save(Path(f"data/{k}.csv"), k)
    return Path("data")


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
    assert sources(quick) == sorted({f"{k}.csv" for k in range(7)} - kept)


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
    assert len(quick) == 7 - len(kept)


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


# Processes ----------------------------------------------------------------------------------------


class Mortal(Held):
    """A recording that ends the process which unpacks it."""

    def __reduce__(self):
        return os._exit, (9,)


def test_processes_fit_as_fit_does_and_outlive_one_that_dies():
    work = Work("creep", None, None, 2, 0)
    jobs = [Held(recording(0)), Mortal(recording(1, source="deadly")), Held(recording(2))]
    rows = {row["key"]: row for some in in_processes(jobs, work, 1) for row in some}
    assert len(rows) == 3
    for job in (jobs[0], jobs[2]):
        assert rows[job.key] == row_of(job, work)
    lost = rows[jobs[1].key]
    assert (lost["status"], lost["source"]) == ("failed", "deadly")
    assert lost["reason"] == "the process that fitted it died."


def test_what_no_process_can_unpack_is_fitted_here(quick, monkeypatch):
    class Own(fj.Model):
        pass

    monkeypatch.setattr("fracjax._batch._batch._MANY", 1)
    rows = fj.fit_batch(Own(fj.blocks.Creep(), "creep"), [recording(0)], out=OUT)
    assert (len(quick), list(rows["status"])) == (1, ["fitted"])


def test_processes_end_with_what_asked_for_them():
    found = in_processes(
        [Held(recording(k)) for k in range(40)], Work("creep", None, None, 2, 0), 1
    )
    assert next(found)
    found.close()
    assert not any(thread.name.endswith("(serve)") for thread in threading.enumerate())


# A cluster ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def two_workers(tmp_path_factory) -> Iterator[LocalCluster]:
    """Two workers, a process each."""
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    options: dict[str, Any] = {"n_workers": 2, "threads_per_worker": 1, "silence_logs": 50}
    # Without an address, every cluster asks for one and the same port: two test runs at once do.
    options |= {"local_directory": str(tmp_path_factory.mktemp("dask")), "dashboard_address": ":0"}
    two: Any
    with LocalCluster(**options) as two:
        yield two
    cloudpickle.unregister_pickle_by_value(sys.modules[__name__])


@pytest.fixture
def cluster(two_workers) -> LocalCluster:
    """The cluster as it was at first, whatever a test before this one did to its workers."""
    # One that a test has closed may still count as it goes, and another has to be asked for then.
    for left in reversed(range(8)):
        two_workers.scale(2)
        try:
            two_workers.wait_for_workers(2, timeout=15)
            break
        except TimeoutError:
            if not left:
                raise
    return two_workers


def wait_until(true) -> None:
    while not true():
        time.sleep(0.02)


class QuickFits(WorkerPlugin):
    """Fits that take little time, on every worker that is there or will be."""

    def __init__(self, fitted: fj.Fit):
        self.fitted = fitted

    def setup(self, worker):
        import fracjax._batch._rows as rows

        def fit(*_, **__):
            time.sleep(0.02)
            return self.fitted

        rows.fit = fit


@pytest.fixture
def quick_cluster(cluster, fitted) -> LocalCluster:
    with Client(cluster, set_as_default=False) as client:
        client.register_plugin(QuickFits(fitted))
    return cluster


@dataclass(frozen=True)
class Deadly(File):
    """A recording whose reading kills the process."""

    def recording(self, columns):
        os.kill(os.getpid(), signal.SIGKILL)
        raise AssertionError


def test_a_worker_fits_as_fit_does(cluster):
    rows = fj.fit_batch(
        cheap_model(), [recording(0)], out=OUT, starts=1, cluster=cluster.scheduler_address
    )
    found = fj.fit(cheap_model(), recording(0), starts=1)
    assert rows["rmse"].tolist() == [found.scores.rmse]
    assert rows["k_c.standard_error"].tolist() == [found.estimates[0].standard_error]


def test_workers_that_lack_something_are_said_to(cluster, monkeypatch):
    class Unknown(fj.blocks.Creep):
        """A block whose module only this process has."""

    Unknown.__module__, Unknown.__qualname__ = "only_here", "Unknown"
    module = types.ModuleType("only_here")
    vars(module)["Unknown"] = Unknown
    monkeypatch.setitem(sys.modules, "only_here", module)
    said = "expected workers with the same fracjax, and all that the model needs, found"
    model = fj.Model(Unknown())  # type: ignore[call-arg]
    with pytest.raises(fj.InputError, match=f"{said} ModuleNotFoundError: .*only_here"):
        fj.fit_batch(model, [recording(0)], out=OUT, cluster=cluster.scheduler_address)
    assert not OUT.exists()


def test_a_killed_worker_loses_nothing(quick_cluster):
    for k in range(60):
        save(Path(f"data/{k}.csv"), k)
    address = quick_cluster.scheduler_address
    first, *_ = quick_cluster.workers.values()
    killed: list[int] = []

    def kill(done, total):
        if done and not killed:
            killed.append(first.pid)
            os.kill(first.pid, signal.SIGKILL)

    rows = batch("data", cluster=address, chunk=8, progress=kill)
    assert killed
    assert set(rows["status"]) == {"fitted"}
    assert len(pd.read_parquet(OUT / FITS)) == len(rows) == 60
    pd.testing.assert_frame_equal(batch("data", cluster=address), rows)


def test_a_recording_that_kills_workers_is_a_row(quick_cluster, monkeypatch):
    monkeypatch.setattr(quick_cluster.scheduler, "allowed_failures", 0)
    jobs = [File(save(Path("a.csv").resolve(), 1)), Deadly(Path("b.csv"))]
    work = Work("creep", None, None, 2, 0)
    rows = [r for some in on_cluster(quick_cluster.scheduler_address, jobs, work) for r in some]
    told = {Path(row["source"]).name: (row["status"], row["reason"]) for row in rows}
    assert told == {
        "a.csv": ("fitted", ""),
        "b.csv": ("failed", "every worker that took it died."),
    }


def test_work_does_not_wait_for_ever_for_a_worker(quick_cluster, monkeypatch):
    monkeypatch.setattr("fracjax._batch._cluster._PATIENCE", 5)
    for k in range(60):
        save(Path(f"data/{k}.csv"), k)

    def dismiss(done, total):
        if done:
            quick_cluster.scale(0)

    address = quick_cluster.scheduler_address
    with pytest.raises(fj.InputError, match=r"expected a worker, found none; .* is kept"):
        batch("data", cluster=address, progress=dismiss)
    assert 0 < len(pd.read_parquet(OUT / FITS)) < 60
    monkeypatch.setattr("fracjax._batch._cluster._SECONDS", 1)
    with pytest.raises(fj.InputError, match="expected a worker, found none"):
        batch("data", cluster=address)


def test_results_that_went_with_the_last_worker_are_not_waited_for(quick_cluster, monkeypatch):
    monkeypatch.setattr("fracjax._batch._cluster._PATIENCE", 1)
    for k in range(60):
        save(Path(f"data/{k}.csv"), k)
    scheduler, lost = quick_cluster.scheduler, []

    def dismiss(done, total):
        if done and not lost:
            wait_until(lambda: all(task.state == "memory" for task in scheduler.tasks.values()))
            lost.extend(scheduler.tasks)
            quick_cluster.scale(0)
            wait_until(lambda: not scheduler.workers)

    with pytest.raises(fj.InputError, match=r"expected a worker, found none; .* is kept"):
        batch("data", cluster=scheduler.address, progress=dismiss)
    assert lost
    assert 0 < len(pd.read_parquet(OUT / FITS)) < 60


# The command line ---------------------------------------------------------------------------------


def test_the_command(data, quick, capsys):
    (data / "5.csv").write_text("nonsense")
    call = ["batch", str(data), "--model", "creep", "--out", "results", "--bound", "mu=0.001..0.1"]
    call += ["--mask", "1 s..2 s", "--loss", "huber"]
    assert run([*call, "--settle", "250ms", "--seed", "3", "--history", "rest"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("creep: of 7 recordings 6 fitted, 1 unreadable.\n")
    assert "Unreadable: " in out
    assert out.endswith(f"Written: results/{FITS}\n")
    assert err == ""
    told = (quick[0]["history"], quick[0]["settling"], quick[0]["seed"], quick[0]["starts"])
    assert told == ("rest", "250ms", 3, 4)
    told = {name: quick[0][name] for name in ("bounds", "mask", "loss")}
    assert told == {"bounds": {"mu": (0.001, 0.1)}, "mask": ((1.0, 2.0),), "loss": "huber"}
    assert run([*call, "--seed", "1"]) == 2
    assert "give another --out" in failure(capsys)


def test_the_command_as_json_and_quiet(data, quick, capsys):
    call = ["batch", str(data), "--model", "creep", "--out", "results"]
    assert run([*call, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["counts"] == {"fitted": 7, "not converged": 0, "unreadable": 0, "failed": 0}
    assert (told["table"], told["unfitted"]) == (f"results/{FITS}", [])
    assert run([*call, "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_the_command_where_fits_do_not_converge(data, quick, fitted, monkeypatch, capsys):
    failed = replace(fitted, converged=False)
    monkeypatch.setattr(fracjax._batch._rows, "fit", lambda *_, **__: failed)
    assert run(["batch", str(data), "--model", "creep", "--out", "results", "--quiet"]) == 3
    assert failure(capsys).startswith("7 of 7 fits did not converge; ")


@pytest.mark.parametrize(
    ("call", "said"),
    [
        ("batch --model creep --out results", "Missing argument 'PATH...'"),
        ("batch a.csv --out results", "Missing option '--model'"),
        ("batch a.csv --model nope --out results", 'model "nope": expected names'),
        ("batch *.csv --model creep --out results", "expected a pattern that meets files"),
        ("batch a.csv --model creep --out results --settle 9um", "expected a value in s"),
        ("batch a.csv --model creep --out results --cluster 127.0.0.1:9", "connection refused"),
    ],
)
def test_unusable_calls(call, said, capsys):
    assert run(call.split()) == 2
    assert said in failure(capsys)
    assert list(Path.cwd().iterdir()) == []


def test_where_nothing_can_be_read(capsys):
    assert run(["batch", "none.csv", "--model", "creep", "--out", "results", "--quiet"]) == 2
    assert "Of 1 recordings none could be read; the first: " in failure(capsys)


def test_an_interrupted_command_says_what_it_kept(data, quick, fitted, monkeypatch, capsys):
    def write(self, rows):
        Parts_write(self, rows)
        raise KeyboardInterrupt

    Parts_write = Parts.write
    monkeypatch.setattr(Parts, "write", write)
    assert run(["batch", str(data), "--model", "creep", "--out", "results"]) == 130
    assert f"Interrupted; kept results/{FITS}." in capsys.readouterr().err


def test_a_bar_only_where_someone_watches(data, quick, monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    monkeypatch.setenv("TERM", "xterm")
    assert run(["batch", str(data), "--model", "creep", "--out", "results", "--json"]) == 0
    assert "7/7" in terminal.getvalue()
