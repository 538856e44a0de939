"""What a batch is asked: paths, options, and what cannot be used."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import fracjax as fj
from fracjax._batch import FITS
from fracjax._batch._jobs import jobs_of
from tests.batch.helpers import OUT, batch, recording, save, signals, told


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
        ("data/*.csv", r"data/\*\.csv: expected a pattern that matches files, found none"),
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
    sizes = {
        c["source"]: c["model"].parameters["mains_interference.cosines"].value.max() for c in quick
    }
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
