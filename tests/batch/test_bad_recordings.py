"""Every bad recording is a row with its reason."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import fracjax as fj
import fracjax._batch._rows
from tests.batch.helpers import STEP, recording, save, told

GOOD = "\n".join(f"{STEP * n:.2f},{np.sin(n)},{np.cos(n)}" for n in range(60))
HEAD = "time_s,voltage_V,displacement_um\n"
BAD = {
    "empty.csv": ("", "expected rows of numbers, found an empty file"),
    "short.csv": (HEAD + "\n".join(GOOD.split("\n")[:9]), "expected at least 32 samples, found 9"),
    "cell.csv": (HEAD + GOOD.replace("0.10,", "oops,"), "line 12"),
    "gap.csv": (HEAD + GOOD.replace("0.30,", "0.304,"), "expected a step of 0.01 s"),
    "columns.csv": (GOOD.replace(",", ",7,").replace(",7,", ",", 1), "column"),
    "unit.csv": (HEAD.replace("_um", " [s]") + GOOD, "displacement"),
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
